"""Sines: one frequency, at least a whole period of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from swashplate.campaign.recognition.ending import (
    Ending,
    Refusal,
    ending_windows,
    find_ending,
    follow,
    judge,
    rounded_ends,
)
from swashplate.campaign.recognition.recognised import Recognised, Window
from swashplate.campaign.recognition.rounding import roundest
from swashplate.campaign.recognition.trace import Array, Trace

BAND = 0.3
"""A crossing is a change between +BAND and -BAND of the peak. [1]"""
EVEN = 0.15
"""How much half a period may differ from the median half period. [1]"""
COARSEST = 6.0
"""Samples in a period, at least."""


@dataclass(frozen=True)
class _Tone:
    sine: float
    cosine: float
    mean: float
    omega: float
    origin: float
    """Instant from which its phase counts. [s]"""
    error: float
    """Standard error of omega. [rad/s]"""

    @property
    def amplitude(self) -> float:
        return float(np.hypot(self.sine, self.cosine))

    @property
    def crossing(self) -> float:
        """An upward crossing of its mean. [s]"""
        return self.origin - float(np.arctan2(self.cosine, self.sine)) / self.omega

    def __call__(self, time: Array) -> Array:
        # one sine, not two: it is computed over the whole record
        return self.mean + self.amplitude * np.sin(self.omega * (time - self.crossing))

    def slope(self, time: Array) -> Array:
        return self.amplitude * self.omega * np.cos(self.omega * (time - self.crossing))


def find_sine(trace: Trace, unit: str) -> Recognised | Refusal:
    """A sine, or why it is none."""
    crossings, upward = _crossings(trace)
    guess = _guess(trace, crossings, upward)
    if isinstance(guess, Refusal):
        return guess
    departs = trace.first(np.abs(trace.values) > trace.tolerance, 0)
    certain = int(np.searchsorted(trace.time, guess[1]))
    if certain - departs < COARSEST:
        return Refusal("it is too short")
    tone = _fit(trace, guess[0], departs, certain)
    start = _start(trace, tone, departs)
    first = int(np.searchsorted(trace.time, start - 1e-9))
    leaves = _leaves(trace, tone, first)
    if leaves < certain:
        return Refusal(f"it is no sine at {trace.time[leaves]:.4g} s")
    tone = _fit(trace, tone, first, leaves)
    ending = find_ending(trace, leaves, tone, tone.slope, start)
    if isinstance(ending, Refusal):
        return ending
    tone = _fit(trace, tone, first, min(ending.first, leaves))
    if (ending.start - start) * tone.omega < 2.0 * np.pi * 0.99:
        return Refusal("it is less than a period long")
    if abs(tone.mean) > max(0.02 * tone.amplitude, trace.noise) and first:
        return Refusal(f"its mean lies {tone.mean:.2g} {unit} from rest")
    model = tone(trace.time)
    model[:first] = 0.0
    judged = follow(trace, ending, model)
    residual = trace.values - model
    rms = judge(trace, residual if judged.all() else residual[judged])
    if isinstance(rms, Refusal):
        return rms
    if not first:  # there is no rest to see
        trace = replace(trace, rest=trace.rest + tone.mean)
    return _described(trace, unit, tone, start, ending, rms)


def _crossings(trace: Trace) -> tuple[Array, bool]:
    """Instants at which the record changes its sign for good, and whether the first is upward."""
    band = BAND * trace.peak
    beyond = np.flatnonzero(np.abs(trace.values) > band)
    changes = np.flatnonzero(np.diff(np.signbit(trace.values[beyond])))
    before, after = beyond[changes], beyond[changes + 1]
    middle = 0.5 * (trace.time[before] + trace.time[after])
    return middle, bool(changes.size and trace.values[after[0]] > 0.0)


def _guess(trace: Trace, crossings: Array, upward: bool) -> tuple[_Tone, float] | Refusal:
    """A tone through the crossings and the last instant up to which they are those of a sine."""
    if crossings.size < 2:
        return Refusal("it changes its sign fewer than twice")
    halves = np.diff(crossings)
    half = float(np.median(halves))
    uneven = np.abs(halves - half) > EVEN * half
    regular = int(uneven.argmax()) if uneven.any() else halves.size
    if regular < max(halves.size - 1, 1):
        return Refusal(f"its changes of sign are uneven at {crossings[regular]:.4g} s")
    if 2.0 * half < COARSEST * trace.spacing:
        return Refusal("it has fewer than six samples in a period")
    # the last may be a part of the return
    even = crossings[: min(regular + 1, max(crossings.size - 1, 2))]
    half, first = np.polynomial.Polynomial.fit(np.arange(even.size), even, 1).convert().coef[::-1]
    sign = 1.0 if upward else -1.0
    tone = _Tone(sign * trace.peak, 0.0, 0.0, float(np.pi / half), float(first), 0.0)
    return tone, float(even[-1])


def _fit(trace: Trace, guess: _Tone, first: int, last: int) -> _Tone:
    """Least-squares sine of four parameters through samples `first` to before `last`.

    Gauss-Newton from a guess whose phase is right to a small part of a turn over the whole record,
    as IEEE Std 1057 does it.
    """
    chosen = trace.picked(first, last)
    time, values = trace.time[chosen], trace.values[chosen]
    origin = float(0.5 * (time[0] + time[-1]))
    omega = guess.omega
    # carried along to where it hardly correlates with the frequency
    phase = omega * (origin - guess.crossing)
    sine, cosine = guess.amplitude * np.cos(phase), guess.amplitude * np.sin(phase)
    mean = guess.mean
    since = time - origin
    design = np.ones((time.size, 4))
    for _ in range(6):
        s, c = np.sin(omega * since), np.cos(omega * since)
        design[:, 0], design[:, 1] = s, c
        design[:, 3] = since * (sine * c - cosine * s)
        normal = design.T @ design
        # a minimum-norm solution where few samples leave a direction open
        sine, cosine, mean, step = np.linalg.lstsq(normal, design.T @ values)[0]
        omega += float(np.clip(step, -0.1 * omega, 0.1 * omega))
        if abs(step) < 1e-12 * omega:
            break
    error = trace.noise * float(np.sqrt(np.linalg.pinv(normal)[3, 3]))
    return _Tone(float(sine), float(cosine), float(mean), float(omega), origin, error)


def _start(trace: Trace, tone: _Tone, departs: int) -> float:
    """Where it begins: at the crossing before it is seen, or elsewhere where it is seen."""
    seen = float(trace.time[departs])
    if departs == 0:
        return seen
    half = np.pi / tone.omega
    # so long it takes from the crossing to the tolerance
    hidden = np.arcsin(min(trace.tolerance / tone.amplitude, 1.0)) / tone.omega
    crossing = tone.crossing + half * round((seen - hidden - tone.crossing) / half)
    if abs(crossing - (seen - hidden)) > 0.1 * half + trace.spacing or crossing > seen:
        return seen
    return max(float(crossing), float(trace.time[0]))


def _leaves(trace: Trace, tone: _Tone, first: int) -> int:
    """First sample that is not on the tone, or the record's length; long records are leapt over."""
    chosen = trace.picked(first, trace.time.size)
    away = np.abs(trace.values[chosen] - tone(trace.time[chosen])) > trace.tolerance
    if not away.any():
        return trace.time.size
    late = int(away.argmax())
    begin, end = int(chosen[max(late - 1, 0)]), int(chosen[late]) + 1
    near = slice(begin, end)
    return trace.first(np.abs(trace.values[near] - tone(trace.time[near])) > trace.tolerance, begin)


def _described(
    trace: Trace, unit: str, tone: _Tone, start: float, ending: Ending, rms: float
) -> Recognised:
    hertz = tone.omega / (2.0 * np.pi)
    frequency = roundest(hertz, max(3.0 * tone.error / (2.0 * np.pi), 0.001 * hertz))
    down = float(np.cos(tone.omega * (start - tone.crossing))) < -1e-9
    fitted_amplitude = -tone.amplitude if down else tone.amplitude
    amplitude = roundest(fitted_amplitude, 0.002 * tone.amplitude)
    begin = float(trace.time[0])
    shown = max(roundest(start, trace.spacing), begin)
    stop = rounded_ends(trace, ending)[0] if ending.kind != "none" else float(trace.time[-1])
    period = 1.0 / hertz
    # the last sample of a period may come before its end
    whole = int((stop - start + trace.spacing) / period)
    edges = [shown, *(min(start + number * period, stop) for number in range(1, whole + 1))]
    half = 0.5 * period
    # the beginning itself is no change of sign
    after = tone.crossing + half * np.ceil((start - tone.crossing) / half + 1e-3)
    crossings = np.arange(after, stop, half)
    windows: dict[str, tuple[Window, ...]] = {}
    if shown > begin:
        windows["before"] = (Window(begin, shown),)
    windows["run"] = (Window(shown, stop),)
    windows["periods"] = tuple(Window(a, b) for a, b in pairwise(edges))
    fitted = {
        "amplitude": fitted_amplitude,
        "frequency": hertz,
        "mean": tone.mean,
        "start": start,
    }
    if ending.kind != "none":
        fitted |= {"return start": ending.start, "return stop": ending.stop}
    return Recognised(
        "sine",
        f"sine {amplitude:g} {unit} {frequency:g} Hz",
        unit,
        trace.rest,
        trace.noise,
        rms,
        f"a sine of {amplitude:g} {unit} at {frequency:g} Hz fits to {rms:.2g} {unit} RMS",
        amplitude=amplitude,
        frequency=frequency,
        fitted=fitted,
        windows=windows | ending_windows(trace, ending),
        zero_crossings=tuple(crossings.tolist()),
    )
