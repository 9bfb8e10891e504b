"""From a record to the manoeuvre that it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.recognition.ending import Refusal
from swashplate.campaign.recognition.levels import find_levels
from swashplate.campaign.recognition.recognised import Recognised, Window
from swashplate.campaign.recognition.slopes import find_ramp
from swashplate.campaign.recognition.trace import Trace, trace_of
from swashplate.campaign.recognition.waves import find_sine
from swashplate.maneuvers.pieces import not_negative

SHORTEST = 16
"""Samples below which nothing is told apart."""
LARGEST_ZERO = 0.5
"""Reading at rest beyond which it is no zero error of an instrument. [V]"""


def recognise(
    time: ArrayLike,
    voltage: ArrayLike,
    *,
    unit: str = "V",
    rest: float | None = None,
    smallest: float | None = None,
    settling: float = 1.0,
) -> Recognised:
    """Name the manoeuvre of a record of a command, from the command alone.

    Parameters
    ----------
    time : (n,) array_like
        Increasing stamps, even or not. [s]
    voltage : (n,) array_like
        The command, with the noise and steps of its instrument. [unit]
    unit : str
        Its unit, for the name. All levels are relative to `rest`.
    rest : float, optional
        The command at rest; by default what the record begins with, which in V must then be within
        0.5 V of zero. [unit]
    smallest : float, optional
        Smallest change that counts as a command; by default 0.1 V, in other units any. [unit]
    settling : float
        How long ``"rise"`` and ``"fall"`` of a step last from its jumps on. [s]

    Returns
    -------
    Recognised
        Of kind ``"free"`` wherever none of the manoeuvres fits: its RMS over the record must be
        below 1 % of the peak, noise apart, and below three times that in every fiftieth part.

    Raises
    ------
    InputError
        If the columns differ in length, hold what is no number, or the time does not increase.

    Notes
    -----
    Step, stairs, ramp and sine are those of `swashplate.maneuvers`. How they return to rest is free
    as long as they do, within three quarters of the time that the command took; where it is the
    package's cubic return, its ends are fitted, it is judged as well and may take as long as the
    command. A sine may begin at any phase, but has a whole period at least, about rest. Chirps,
    multisines, joysticks and different manoeuvres after one another are free.
    """
    settling = not_negative("settling", settling)
    trace = trace_of(time, voltage, unit, rest, smallest)
    if unit == "V" and rest is None and abs(trace.rest) > LARGEST_ZERO:
        return _free(trace, unit, f"it begins at {trace.rest:.3g} V, which is no rest")
    if trace.idle:
        return _rest(trace, unit)
    if trace.time.size < SHORTEST:
        return _free(trace, unit, f"{trace.time.size} samples are too few to tell")
    found = find_levels(trace, unit, settling)
    if not isinstance(found, Refusal):
        return found
    reasons = [f"no step or stairs: {found.reason}"]
    found = find_ramp(trace, unit)
    if not isinstance(found, Refusal):
        return found
    reasons.append(f"no ramp: {found.reason}")
    found = find_sine(trace, unit)
    if not isinstance(found, Refusal):
        return found
    reasons.append(f"no sine: {found.reason}")
    return _free(trace, unit, "; ".join(reasons))


def _rms(trace: Trace) -> float:
    return float(np.sqrt(np.mean(trace.values**2)))


def _rest(trace: Trace, unit: str) -> Recognised:
    whole = Window(float(trace.time[0]), float(trace.time[-1]))
    return Recognised(
        "rest",
        "rest",
        unit,
        trace.rest,
        trace.noise,
        _rms(trace),
        f"it stays within {trace.least:.2g} {unit} of {trace.rest:.4g} {unit}",
        windows={"rest": (whole,)},
    )


def _free(trace: Trace, unit: str, reason: str) -> Recognised:
    return Recognised("free", "free", unit, trace.rest, trace.noise, _rms(trace), reason)
