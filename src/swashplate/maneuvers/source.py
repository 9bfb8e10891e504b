"""The manoeuvres of the source's test campaign."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from swashplate.errors import InputError
from swashplate.maneuvers.pieces import Maneuver
from swashplate.maneuvers.shapes import ramp, step
from swashplate.maneuvers.sines import sine


class _Axis(NamedTuple):
    settle: float  # [s]
    ramps: Sequence[float]  # [V/s]
    steps: Sequence[float]  # [V]
    sines: Sequence[tuple[float, float, float]]  # amplitude [V], frequency [Hz], length [s]


_AXES = {
    "hoist": _Axis(
        settle=2.5,
        ramps=(1, -1),
        steps=(4, -4, 6.5, -6.5, 9, -9),
        sines=((4, 0.1, 30), (6.5, 0.1, 30), (9, 0.1, 30), (6.5, 0.3, 20), (9, 0.3, 20)),
    ),
    "slew": _Axis(
        settle=4.5,
        ramps=(1,),
        steps=(2,),
        sines=((4, 0.05, 40), (4, 0.1, 30), (6, 0.05, 40)),
    ),
    "luff": _Axis(
        settle=2.5,
        ramps=(1,),
        steps=(4, 6.5, 9),
        sines=((4, 0.1, 30), (6.5, 0.1, 30), (9, 0.05, 40)),
    ),
}


def source_tests(axis: str) -> dict[str, Maneuver]:
    """Runs of the source's test campaign on the axis "hoist", "slew" or "luff".

    Returns
    -------
    dict of str to Maneuver
        By their names, such as "ramp +1 V/s", "step -4 V" and "sine 6.5 V 0.1 Hz".

    Raises
    ------
    InputError
        If there is no such axis.
    """
    if axis not in _AXES:
        raise InputError(f"no tests of axis {axis!r}: the source has {', '.join(_AXES)}.")
    settle, ramps, steps, sines = _AXES[axis]
    runs = [replace(ramp(slope, settle=settle), name=f"ramp {slope:+g} V/s") for slope in ramps]
    runs += [replace(step(volts), name=f"step {volts:+g} V") for volts in steps]
    runs += [sine(volts, hertz, settle=settle, length=length) for volts, hertz, length in sines]
    return {run.name: run for run in runs}
