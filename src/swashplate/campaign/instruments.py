"""What an instrument cannot read or has not read: beyond its kind, clipped, or without a sign."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.dropouts import find_dropouts
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.campaign.schema import shown_unit
from swashplate.campaign.spikes import step_of_reading
from swashplate.units import display_unit

Array = NDArray[np.float64]


class Bound(NamedTuple):
    """Largest magnitude that any machine's signal has."""

    largest: float
    """[SI]"""
    reason: str


BOUNDS: Mapping[tuple[str, str], Bound] = MappingProxyType(
    {
        ("current", "A"): Bound(10.0, "proportional solenoids take 0.6 to 4 A"),
        ("signed_current", "A"): Bound(10.0, "proportional solenoids take 0.6 to 4 A"),
        ("current_plus", "A"): Bound(10.0, "proportional solenoids take 0.6 to 4 A"),
        ("current_minus", "A"): Bound(10.0, "proportional solenoids take 0.6 to 4 A"),
        ("rectified_current", "A"): Bound(10.0, "proportional solenoids take 0.6 to 4 A"),
        ("shaft_speed", "rad/s"): Bound(1200.0, "the fastest hydraulic motors turn at 11,000 rpm"),
        ("shaft_speed", "m/s"): Bound(20.0, "the fastest servo cylinders reach 15 m/s"),
        ("position", "m"): Bound(100.0, "draw-wire sensors reach 60 m"),
        ("stroker_pressure", "Pa"): Bound(1e8, "hydraulic machines stay below 1,000 bar"),
        ("swash_angle", "rad"): Bound(0.8, "bent-axis units, the steepest, reach 45 deg"),
        ("spool_position", "m"): Bound(0.05, "spools travel up to 25 mm"),
    }
)
"""By kind and unit, whatever the drive: data sheets of Bosch Rexroth (4WRA and 4WRZ valves, A2FM
motors of size 5, 45 deg of the A2F), of servo cylinders with hydrostatic bearings and of draw-wire
sensors, with a margin. A shaft's angle and an encoder's counts have none; a command in V has the
range of its card."""
FEWEST = 10
"""Turns that show noise."""
WORDS = (16, 32)
"""Bits of a controller's words."""
CONTINUOUS = 0.25
"""Part of the jumps of words without a sign that is left with it: a motion is continuous. [1]"""
PLACES, EXACT = 7, 1e15
"""Places of decimal numbers that are looked at, and whole numbers that a double holds exactly."""
STANDS = 0.3
"""Time for which a reading stands at its very end only if it is clipped there. [s]"""
TO_AND_FRO = 0.2
"""Share of the samples at which a noisy signal turns back: three quarters of those of white noise,
of which at least a third stand out from the steps of the converter. [1]"""


def instrument_sentences(experiment: Experiment, signal: Channel | InputSignal) -> Iterator[str]:
    """Sentences on readings beyond their kind, words read without their sign, and clipping."""
    values = signal.values[signal.used]
    if values.size < 2:
        return
    if word := unsigned_word_sentence(signal):
        yield word
        return
    largest = float(values[np.abs(values).argmax()])
    if beyond := beyond_any_machine(signal.kind, signal.unit, largest):
        yield f"reaches {beyond}: check unit, scale and offset"
    lost = {dropout.value for dropout in find_dropouts(experiment, signal)}
    for level in clipping_levels(signal):
        if level not in lost:
            yield _clipped(experiment, signal, level)


def unsigned_word_sentence(signal: Channel | InputSignal) -> str:
    """What to do about a signal of words whose sign was not read; empty if it is none."""
    bits = unsigned_word(signal)
    if not bits:
        return ""
    half, whole = 1 << (bits - 1), 1 << bits
    return (
        f"values above {half - 1} are negative words of {bits} bits: read '"
        f"{signal.source.column}' as int{bits}, or subtract {whole} from them"
    )


def beyond_any_machine(kind: str, unit: str, value: float) -> str:
    """A value of a kind [SI] and why no machine has it, "100 A, but ..."; empty if one may."""
    bound = BOUNDS.get((kind, unit))
    if bound is None or abs(value) <= bound.largest:
        return ""
    display = display_unit(shown_unit(kind, unit), abs(value))
    return f"{display.factor * value:.4g} {display.name}, but {bound.reason}"


def _clipped(experiment: Experiment, signal: Channel | InputSignal, level: float) -> str:
    """A sentence on a signal that is clipped at a level, with what leaves it out."""
    time, values = signal.time[signal.used], signal.values[signal.used]
    at_level = time[values == level]
    stretches = np.split(at_level, np.flatnonzero(np.diff(at_level) > STANDS) + 1)
    display = display_unit(shown_unit(signal.kind, signal.unit), float(np.ptp(values)))
    said = (
        f"clipped at {display.factor * level:.4g} {display.name}, which it reads {at_level.size} "
        f"times between {at_level[0]:.4g} and {at_level[-1]:.4g} s, without its noise"
    )
    if not isinstance(signal, Channel):
        return (
            f'{said}: what was commanded beyond is lost; leave the run out with role = "ignore", '
            "or cut it before with span"
        )
    half = 0.5 * float(np.median(np.diff(time)))
    windows = [
        f'{{ from = {part[0] - half:.6g}, to = {part[-1] + half:.6g}, why = "clipped" }}'
        for part in stretches
    ]
    return (
        f"{said}: leave out with axes.{experiment.axis}.channels.{signal.name}.ignore = "
        f"[{', '.join(windows)}] in this run"
    )


def unsigned_word(signal: Channel | InputSignal) -> int:
    """Bits of the words that a signal's readings are if their sign was not read, 0 if they are not.

    Such readings jump by most of a word, and hardly if those of its upper half are taken as
    negative. A decimal scale in the log is allowed for, and any other if single steps of the word
    are among its small readings.
    """
    values = signal.values[signal.used]
    if values.size < 2 or values.min() < 0.0 < values.max():
        return 0
    size = signal.stated if isinstance(signal, Channel) else 1.0
    numbers = np.abs(values) / size
    small_ones = numbers[numbers < 0.25 * numbers.max()]
    for step in (_decimal_step(numbers), step_of_reading(small_ones), step_of_reading(numbers)):
        for bits in WORDS if step > 0.0 else ():
            word = step * float(1 << bits)
            as_signed = np.where(numbers > 0.5 * word, numbers - word, numbers)
            jump, signed_jump = (np.abs(np.diff(each)).max() for each in (numbers, as_signed))
            within = 0.5 * word < numbers.max() < word
            if within and jump > 0.5 * word and signed_jump < CONTINUOUS * jump:
                return bits
    return 0


def _decimal_step(numbers: Array) -> float:
    """Largest step of which all numbers (n,) are multiples and that a decimal number has, or 0."""
    for places in range(PLACES):
        scaled = numbers * 10.0**places
        whole = np.rint(scaled)
        if whole.max() < EXACT and np.abs(scaled - whole).max() < 1e-3:
            return float(np.gcd.reduce(whole.astype(np.int64))) / 10.0**places
    return 0.0


def clipping_levels(signal: Channel | InputSignal) -> Iterator[float]:
    """Ends at which a noisy signal stands without noise, for 0.3 s or longer.

    Zero is none: it is what a current or a speed at rest reads. Positions are passed over, as they
    stand still by themselves, and so is what has limits, which say where it ends.
    """
    if signal.kind == "other" or signal.limits is not None:
        return
    if isinstance(signal, Channel) and signal.is_position:
        return
    time, values = signal.time[signal.used], signal.values[signal.used]
    if np.ptp(values) == 0.0 or not _is_noisy(values):
        return
    for level in (float(values.min()), float(values.max())):
        edges = np.flatnonzero(np.diff(values == level, prepend=False, append=False))
        stretches = edges.reshape(-1, 2)
        longest = max(float(time[stop - 1] - time[first]) for first, stop in stretches)
        if abs(level) > 0.1 * np.abs(values).max() and longest >= STANDS:
            yield level


def _is_noisy(values: Array) -> bool:
    """Whether samples (n,) go to and fro about a smooth curve by more than their rounding does.

    Second differences of noise turn back in three of four samples; those of a motion do not, and
    those of a rounded one are a step or two.
    """
    bends = np.diff(values, 2)
    least = np.minimum(np.abs(bends[1:]), np.abs(bends[:-1]))
    turns = (bends[1:] * bends[:-1] < 0.0) & (least > 1.5 * step_of_reading(values))
    # what is clipped, or rests, does not bend
    return bool(turns.sum() > max(TO_AND_FRO * np.count_nonzero(least), FEWEST))
