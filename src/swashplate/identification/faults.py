"""Faults of machine and instruments: how each would change a reading, and how it is called."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees, inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.errors import DomainError
from swashplate.identification.drive_model import CURRENTS, DriveModel, with_edges
from swashplate.identification.model import Model, simulated
from swashplate.identification.stage_fit import StageFit
from swashplate.tables import listed

Array = NDArray[np.float64]


class Kind(NamedTuple):
    """A kind of fault: its name, the unit of its size, and what else it may be."""

    words: str
    factor: float = 100.0
    """From SI to the unit."""
    unit: str = "%"
    plausible: float = inf
    """Size that occurs without notice; inf for what is no fault of an instrument. [unit]"""
    also: str = ""

    @property
    def tolerated(self) -> float:
        """Half of what is plausible: a third was exceeded in 5 of 500 sound campaigns. [unit]"""
        return 0.5 * self.plausible


SCALE = Kind("scale of {}", plausible=3.0)
LATE = Kind("time stamps of {}", 1e3, "ms", 10.0, " (or a delay or lag that the model leaves out)")
SLOW = Kind("lag of {}", 1e3, "ms", also=" (a slow instrument)")
SLOW_COMMAND = SLOW._replace(also=" (an amplifier or filter that the model leaves out)")
DRIFT = Kind("drift of {} over the campaign")
LOSS = Kind("loss at the largest speeds of {}")
LEAKAGE = Kind("load or leakage, as a loss of {},")
FRICTION = Kind("friction or hysteresis, as a lag of {},")
FIXED = Kind("{}")
"""A fixed parameter that has another value."""

EXPLAINS = 0.2
"""Part of the residuals' squares from which a fault is named as a likely cause."""
SIGNIFICANT = 25.0
"""Standard errors from which a fault's size is taken for one. They are those of one step and of
independent samples: sizes that would matter reach 28 and 23 of them in two of 131 sound campaigns
of slew, 13 where fixed parameters are 3 % off, as stated, and 32 to 44 where its ammeter reads 3 %
too much."""
SAME_DIRECTION = 1e-6
"""Part of a fault's effect outside the estimates' below which both are the same: derivatives are
exact to about 1e-9, and a fault of 3 % would then leave 3e-8 of the signal."""
FAR = 100.0
"""One-step estimate of a relative error beyond which one step says nothing, tau's apart. [%]"""
FAR_OFF = 10.0
"""The same of an instrument, over what is plausible: sound encoders, beside models that missed by
0.5 % of range, seemed to have scales 85 and 93 % off. [1]"""
SAME_STAMPS = 0.01
"""The same of late stamps and a longer delay, compared by whole samples: stamps have jitter. [1]"""
COMMAND_CHANGE = 1e-3
"""Relative change of the command by which its effect is found, downwards: 10 V is the limit. [1]"""
LAG = 0.01
"""Time constant by which the effect of a slow instrument or amplifier is found. [s]"""
FASTEST, WINDOW = 0.99, 0.0625
"""Part of the largest measured speed beyond which a counter is asked whether it follows, and the
time over which that speed is taken. [s]"""
TO_AND_FRO = 0.05
"""Share of a channel's changes that turn back by more than one step where it is noisy. [1]"""
ALL_OF_IT = 100.0
"""Error from which a number says nothing of what is seen. [%]"""
DWELLS = 0.1
"""Time for which a noisy channel stands at its very largest value only if it is clipped. [s]"""


@dataclass(frozen=True, eq=False)
class Fault:
    """Something wrong with machine or instruments that would change what is measured in one way."""

    kind: Kind
    name: str
    """``"scale of counts"``, ``"time stamps of current"``, or a fixed parameter: ``"tau"``."""
    size: float
    """One-step estimate from the residuals, all estimates following. [unit of the kind]"""
    standard_error: float
    """Of the size, all estimates following; inf where they make up for it. [unit]"""
    share: float
    """Part of the residuals' squares that it explains beyond the estimates. [1]"""
    outside: float
    """Part of its effect that no change of the estimates makes up for. [1]"""
    same_as: tuple[str, ...]
    """Estimates that make up for it, the largest effect first."""
    with_fixed: float = 0.0
    """Standard error of the size if each fixed parameter may be off by 10 %. [unit]"""
    fixed: tuple[str, ...] = ()
    """Fixed parameters that then make up for it, the largest effect first."""

    @property
    def instrumental(self) -> bool:
        """Whether it is one of an instrument, of which a plausible size is known."""
        return isfinite(self.kind.plausible)

    @property
    def visible(self) -> bool:
        """Whether the logs tell one of plausible size from other estimates."""
        return self.outside > SAME_DIRECTION and 2.0 * self.standard_error < self.kind.plausible

    @property
    def hidden(self) -> bool:
        """Whether one of plausible size passes as other estimates, or as other fixed values."""
        told = self.visible and 2.0 * self.with_fixed < self.kind.plausible
        return self.instrumental and not told

    @property
    def explains(self) -> bool:
        """Whether it explains a large part of the residuals."""
        return self.share > EXPLAINS

    @property
    def significant(self) -> bool:
        """Whether its size is told from none."""
        return abs(self.size) > SIGNIFICANT * self.standard_error

    @property
    def near(self) -> bool:
        """Whether one step says how large it is, or it has no size; no lag or loss is below 0."""
        if self.kind in (SLOW, SLOW_COMMAND, LOSS):
            return self.size > 0.0
        if self.instrumental:
            return abs(self.size) <= FAR_OFF * self.kind.plausible
        return self.kind.unit != "%" or self.name == "tau" or abs(self.size) <= FAR

    @property
    def words(self) -> str:
        """Its name, and the fixed parameters that might be wrong in its place."""
        either = self.visible and self.hidden and self.fixed
        return f"{self.name}, or of the fixed {listed(self.fixed)}," if either else self.name

    @property
    def cause(self) -> str:
        """It as a likely cause, in words."""
        size = "" if self.kind is LOSS else f" by {self.size:+.3g} {self.kind.unit}"
        return f"{self.name}{self.kind.also}{size}"

    def _smaller_than(self, size: float) -> str:
        """In words how small an error stays unseen; empty if one as large as the signal does."""
        if not isfinite(size) or (self.kind.unit == "%" and size >= ALL_OF_IT):
            return ""
        shown = f"{size:.0f}" if size >= 100.0 else f"{size:.2g}"
        return f" smaller than {shown} {self.kind.unit}"

    @property
    def assumption(self) -> str:
        """It as an assumption, in words."""
        if self.visible:
            smaller = self._smaller_than(2.0 * self.with_fixed)
            return (
                f"{self.name}: an error{smaller} cannot be told from one of the fixed "
                f"{listed(self.fixed)}"
            )
        smaller = self._smaller_than(2.0 * self.standard_error)
        if smaller:
            return f"{self.name}: an error{smaller} would not be noticed"
        if isfinite(self.standard_error):
            return f"{self.name}: these runs do not check it at all; check it at the machine"
        others = ", ".join(self.same_as)
        return f"{self.name}: equal to other values of {others} for any measurement of these runs"


Effects = dict[str, tuple[Kind, Array]]
"""(m,) change of a reading per SI unit of a fault's size, by the fault's name."""


def measurement_error(channel: Channel) -> float | None:
    """Known standard deviation of a channel's measurement error, in its unit.

    The stated noise, or that of rounding to an encoder's steps, 1/√12 of one; None where neither is
    known.
    """
    if channel.noise is not None:
        return channel.noise
    return channel.resolution and channel.resolution / sqrt(12.0)


def fastest(name: str, experiments: Sequence[Experiment]) -> float:
    """Largest measured rate of a position in any run, over short windows; 0 of others."""
    rates = [0.0]
    for channel in (each[name] for each in experiments if name in each.channels):
        time, values = channel.time[channel.used], channel.values[channel.used]
        if channel.is_position and time.size > 1:
            width = max(round(WINDOW / float(np.median(np.diff(time)))), 1)
            moved = np.abs(values[width:] - values[:-width])
            rates.append(float((moved / (time[width:] - time[:-width])).max(initial=0.0)))
    return max(rates)


def of_instrument(
    experiment: Experiment, name: str, output: Array, place: float, largest: float
) -> Effects:
    """Effects of faults of a channel's instrument, and of those of the machine that it shows.

    `output` (m,) is what is simulated at the channel's stamps, `place` that of the run in the
    campaign, from -1/2 to 1/2, `largest` the `fastest` rate of the channel.
    """
    channel, time = experiment[name], experiment[name].time
    slope = np.gradient(output, time) if time.size > 2 else np.zeros_like(output)
    about = output - output[0] if channel.is_position else output
    made = [
        (SCALE, output),
        (LATE, -slope),
        (SLOW, (_lagged(time, output) - output) / LAG),
        (DRIFT, about * place),
    ]
    if channel.kind not in CURRENTS:
        signal = experiment.input.at(time)
        turned = np.sign(np.diff(signal, prepend=signal[:1]))
        # the direction of the last change of the command, 0 before the first
        last = np.maximum.accumulate(np.where(turned != 0.0, np.arange(turned.size), 0))
        way = turned[last] * (np.abs(slope) > 1e-3 * np.abs(slope).max(initial=0.0))
        lost, angle = np.ones_like(time), channel.unit.startswith("rad")
        unit, factor = channel.unit.replace("rad", "deg"), degrees(1.0) if angle else 1.0
        if channel.is_position:
            step, unit = np.diff(time, prepend=time[:1]), f"{unit}/s"
            beyond = np.sign(slope) * np.maximum(np.abs(slope) - FASTEST * largest, 0.0)
            way, lost = np.cumsum(way * step), time - time[0]
            made.append((LOSS, -np.cumsum(beyond * step)))
        made.append((LEAKAGE._replace(factor=factor, unit=unit), -lost))
        made.append((FRICTION._replace(factor=factor, unit=unit), -way))
    return {kind.words.format(name): (kind, effect) for kind, effect in made}


def of_command(
    model: Model, values: Mapping[str, float], experiment: Experiment
) -> dict[str, Effects]:
    """By channel, the effects of a scale error and of a lag of the command, by differences."""
    if not isinstance(model, DriveModel) or model.part == "pump":
        return {}
    # a slower command has no jumps, whose instants the values would say
    experiment = with_edges(experiment, values)
    signal = experiment.input
    changed = ((1.0 - COMMAND_CHANGE) * signal.values, _lagged(signal.time, signal.values))
    try:
        before, less, later = (
            simulated(model, values, replace(experiment, input=replace(signal, values=x)))
            for x in (signal.values, *changed)
        )
    except DomainError:
        return {}
    scale, lag = (kind.words.format("the command") for kind in (SCALE, SLOW_COMMAND))
    return {
        name: {
            scale: (SCALE, (before[name] - less[name]) / COMMAND_CHANGE),
            lag: (SLOW_COMMAND, (later[name] - before[name]) / LAG),
        }
        for name in before
    }


def late_command(stage: StageFit) -> Fault | None:
    """Late stamps of the command, where they are the same as a fixed tau that is longer by them."""
    model, runs = stage.problem.model, stage.problem.experiments
    # instants of jumps belong to single samples
    number = next((k for k, each in enumerate(runs) if not each.input.edges), 0)
    experiment, values = runs[number], stage.problem.model_values(stage.solution.vector, number)
    if not isinstance(model, DriveModel) or model.part == "pump" or "tau" in values:
        return None
    signal, tau = experiment.input, model.parameters.numbers["tau"]
    step = float(np.median(np.diff(signal.time)))
    late = replace(signal, values=np.concatenate([signal.values[:1], signal.values[:-1]]))
    first = simulated(model, values, replace(experiment, input=late))
    others = (simulated(model, {**values, "tau": each}, experiment) for each in (tau + step, tau))
    apart, moved = (sum(float(np.sum((first[k] - y[k]) ** 2)) for k in first) for y in others)
    outside = sqrt(apart / moved) if moved > 0.0 else inf
    if outside > SAME_STAMPS:
        return None
    name, same = LATE.words.format("the command"), (f"the fixed tau = {1e3 * tau:.3g} ms",)
    return Fault(LATE, name, 0.0, inf, 0.0, outside, same)


def _lagged(time: Array, values: Array) -> Array:
    """(m,) values behind a first-order lag of `LAG`, at rest before."""
    kept = np.exp(-np.diff(time) / LAG)
    bands = np.vstack([np.ones(time.size), np.append(-kept, 0.0)])
    made = solve_banded((1, 0), bands, np.append(values[:1], (1.0 - kept) * values[1:]))
    # a full command stays one, whatever the last digit
    return np.asarray(np.clip(made, values.min(), values.max()))


def clipped_channels(experiments: Sequence[Experiment]) -> tuple[str, ...]:
    """Sentences on channels that stand at an end of their instrument, with the limits to state.

    A channel is clipped where it reads its very largest or smallest value for 0.1 s and longer
    while the input moves by more than a tenth of its range: no noisy signal does that. Nor does one
    stand there so long at inputs that far apart, a machine at its stop included; but one without
    noise does, and one that reads it at a run's first sample is at rest. Positions are passed over,
    as they stand still by themselves.
    """
    said = []
    for name in dict.fromkeys(name for each in experiments for name in each.channels):
        runs = [each for each in experiments if name in each.channels]
        if runs[0][name].is_position:
            continue
        values = np.concatenate([each[name].values for each in runs])
        low, high = float(values.min()), float(values.max())
        reach = float(np.ptp(np.concatenate([each.input.values for each in runs])))
        stated = (each[name].limits for each in runs)
        limits = [pair for pair in stated if pair is not None]
        for end in (low, high):
            # limits may be stated a little within the end at which the readings stand
            if any(not lower < end < upper for lower, upper in limits):
                continue
            spans = np.array([span for each in runs for span in _inputs_at(end, each, name)])
            if not spans.size or low == high:
                continue
            rests = any(each[name].values[0] == end for each in runs)
            moved, apart = float(np.ptp(spans, axis=1).max()), float(np.ptp(spans))
            # a rounded reading stands still by itself for as long as a step of it lasts
            coarse = float(np.diff(np.unique(np.round(values / (high - low), 9))).min())
            step = max(coarse, 3e-4) * (high - low)
            if apart > moved and not rests and _is_noisy(values, step):
                moved = apart
            if moved > (0.1 + 2.0 * coarse) * reach:
                said.append(
                    f"'{name}' stands at exactly {end:.6g} {runs[0][name].unit} at inputs that "
                    f"differ by {moved:.3g} {runs[0].input.unit}: it is clipped there. "
                    f"Set limits = [{low:.6g}, {high:.6g}] in its channel, and such samples are "
                    "ignored."
                )
    return tuple(said)


def _inputs_at(end: float, experiment: Experiment, name: str) -> list[tuple[float, float]]:
    """Smallest and largest input of each stretch in which a channel stands at an end.

    In its first three quarters: a rounded reading that lags stays where it is when the input has
    left already.
    """
    channel, spans = experiment[name], list[tuple[float, float]]()
    edges = np.flatnonzero(np.diff(channel.values == end, prepend=False, append=False))
    for first, after in edges.reshape(-1, 2):
        if channel.time[after - 1] - channel.time[first] >= DWELLS:
            inputs = experiment.input.at(channel.time[first : after - (after - first) // 4])
            spans.append((float(inputs.min()), float(inputs.max())))
    return spans


def _is_noisy(values: Array, step: float) -> bool:
    """Whether samples (n,) go to and fro by two of their steps or more, both ends left out.

    No motion does that from sample to sample, nor rounding. Of the pairs of changes that noise of
    one step makes, a tenth are such.
    """
    inner = (values > values.min()) & (values < values.max())
    first, after = np.diff(values)[:-1], np.diff(values)[1:]
    within = inner[:-2] & inner[1:-1] & inner[2:]
    least = np.minimum(np.abs(first), np.abs(after))
    turns = within & (first * after < 0.0) & (least > 1.5 * step)
    return bool(turns.sum() > TO_AND_FRO * max(within.sum(), 1))
