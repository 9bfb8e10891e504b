"""``swashplate linearize`` and ``bode``: small motions, and sines of any size."""

from __future__ import annotations

from math import degrees, radians
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from swashplate.cli.options import DriveChoice, FigureFile, Interpolation, TableFile
from swashplate.cli.terminal import Outputs, note, show, working
from swashplate.errors import InputError
from swashplate.tables import FIGURE, TABLE

if TYPE_CHECKING:
    from swashplate.linear import LinearDrive

MOST_POINTS = 2000
AMPLITUDES = (1.0, 4.0, 6.5, 9.0)

Input = Literal["voltage", "current", "solenoid_force"]


def linearize(
    drive: DriveChoice,
    *,
    at: float | None = None,
    current: float | None = None,
    speed_deg_s: float | None = None,
    input: Input | None = None,
    sample_time: float | None = None,
    interpolation: Interpolation = "linear",
    loop_gain: float | None = None,
    frequency: float = 0.3,
    out: Path | None = None,
) -> None:
    """Linearise a drive at a voltage, a current or a speed.

    Prints the operating point, the gain, the lag of the pump, the poles, the
    bandwidth and what a speed loop closed over the drive can bear. The model is
    exact for small motions; 'swashplate bode' shows what becomes of large ones.

    Options:
      at V: Linearise at this constant voltage.
      current A: Or at this constant signed current.
      speed_deg_s DEG/S: Or at the voltage that settles at this speed.
      input: What moves the model; by default the voltage, or the current with --current.
      sample_time S: Sample the model, with the recurrences of the simulation.
      interpolation: The input between samples: linear, or zero-order hold.
      loop_gain V/(DEG/S): Print the margins of a proportional speed loop of this gain.
      frequency HZ: Frequency to print gain and phase at.
      out FILE: Write the model, in SI, to a .toml or .json file.

    For example:
      swashplate linearize hoist --at 4
      swashplate linearize hoist --speed-deg-s -50 --loop-gain 0.1
      swashplate linearize slew --at 2 --sample-time 0.01 --out slew.toml
      swashplate linearize luff --current 0 --input solenoid_force
    """
    from swashplate.linear import LINEAR_MODEL, model_tables

    files = Outputs((out, LINEAR_MODEL))
    if sum(each is not None for each in (at, current, speed_deg_s)) != 1:
        raise InputError(
            "A drive is linearised at a voltage, a current or a speed: give one of --at, --current "
            "and --speed-deg-s."
        )
    if current is not None and input == "voltage":
        raise InputError("--input voltage needs --at or --speed-deg-s, not --current.")
    with working("Linearising"):
        chosen = drive.chosen
        speed = None if speed_deg_s is None else radians(speed_deg_s)
        model = chosen.linearize(at, current=current, speed=speed, input=input)
        if sample_time is not None:
            model = model.discrete(sample_time, interpolation)
        gain = None if loop_gain is None else degrees(loop_gain)
        tables = model_tables(model, frequency, gain)
    files.write(out, "Model, in SI", model.write)
    kind = "" if model.sample_time is None else f", sampled at {model.sample_time:g} s"
    drive.note(f"{drive.title}, small motions of the {model.input.replace('_', ' ')}{kind}")
    for switch in model.operating_point.one_sided:
        note(f"One-sided at the {switch}.")
    if model.input == "voltage" and _has_coulomb(model):
        note("The card's Coulomb term C, which only motions below 0.01 A/s see, is left out.")
    show(*tables)
    files.say()


def _has_coulomb(model: LinearDrive) -> bool:
    voltage = model.operating_point.voltage
    assert voltage is not None
    return model.parameters.numbers["C_plus" if voltage >= 0.0 else "C_minus"] > 0.0


def bode(
    drive: DriveChoice,
    *,
    amplitudes: list[float] | None = None,
    bias: float = 0.0,
    lowest: float = 0.02,
    highest: float = 5.0,
    points: int = 40,
    frequency: float = 0.3,
    linear_at: float | None = None,
    plot: FigureFile = None,
    out: TableFile = None,
) -> None:
    """Sweep sines of several amplitudes through a drive.

    Each sine is simulated until the answer repeats itself; gain and phase are
    those of its first harmonic, the distortion is all the rest of it. Prints the
    gain, the phase and the time by which the speed lags at one frequency: what a
    controller that is to damp a swing of that frequency has to make up for.

    Options:
      amplitudes --amplitude V: Amplitude of the sine; may be repeated. By default 1, 4, 6.5 and 9.
      bias V: Mean of the sine.
      lowest --from HZ: Lowest frequency.
      highest --to HZ: Highest frequency.
      points N: Frequencies, evenly spaced on a logarithmic axis.
      frequency HZ: Frequency to print and to mark.
      linear_at V: Draw the linear model at this voltage beside the sines.

    For example:
      swashplate bode hoist
      swashplate bode hoist --amplitude 1 --amplitude 9 --plot bode.png
      swashplate bode slew --bias 3 --amplitude 0.1 --linear-at 3 --out bode.csv
    """
    import numpy as np

    files = Outputs((out, TABLE), (plot, FIGURE))
    if not 2 <= points <= MOST_POINTS:
        raise InputError(f"--points is {points}, but must be 2 to {MOST_POINTS}.")
    if not (np.isfinite([lowest, highest]).all() and 0.0 < lowest < highest):
        raise InputError(
            f"--from and --to must rise from above 0 Hz, not {lowest:g} to {highest:g}."
        )
    with working("Sweeping"):
        from swashplate.linear import response_table

        linear = None if linear_at is None else drive.chosen.linearize(linear_at)
        grid = np.union1d(np.geomspace(lowest, highest, points), [frequency])
        response = drive.chosen.frequency_response(grid, amplitudes or AMPLITUDES, bias=bias)
        made = response_table(response, frequency)
    files.write(out, "Gain, phase and distortion, in SI", response.write)
    files.draw(plot, "plot_bode", response, linear=linear, mark=frequency)
    span = f"{grid.size} frequencies from {grid[0]:g} to {grid[-1]:g} Hz"
    drive.note(f"{drive.title}, sines about {bias:g} V: {span}")
    note(f"At {frequency:g} Hz:")
    show(made)
    files.say()
