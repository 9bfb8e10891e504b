"""Judgement of runs of one variant in one sea: do they stay within the limits, and in the model?

One judgement decides for a verdict, for its remedies, and for each cell of a year.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isfinite, nan, pi, radians
from typing import Literal, NamedTuple

import numpy as np

from swashplate.crane.closed_loop.result import FARTHEST_SWING
from swashplate.crane.limits import LIMITED
from swashplate.crane.sea.confidence import ConfidenceInterval, mean_of, share_of
from swashplate.crane.sea.extremes import THREE_HOURS, largest_of_peaks
from swashplate.crane.studies.run_outcome import RunOutcome
from swashplate.tables import count
from swashplate.units import DisplayUnit

Decision = Literal["yes", "no", "not decided"]

ALLOWED_SHARE = 0.05
"""Share of seaways in which control may be worse than none, or may fail to take over."""
TAKEOVER = 180.0
"""Time after the run-in, of two minutes, in which a run that leaves the model has failed to take
over the swing that it was switched on in: 5 min from the start, some thirty swings. Later ones are
counted by the time that they ran. [s]"""


class AssessedQuantity(NamedTuple):
    """A quantity with a limit, of one variant."""

    name: str
    limit: float
    largest: ConfidenceInterval
    """Most probable largest value in three hours; of the saturation its mean. If a run left the
    model it is not known: NaN, from what the other runs surely reach to inf."""
    left: int = 0
    """Runs that left the model."""
    runs: int = 0

    @property
    def within(self) -> Decision:
        """Whether it stays within the limit; not decided if its interval holds the limit."""
        if self.largest.low > self.limit:
            return "no"
        return "yes" if self.largest.high <= self.limit else "not decided"

    @property
    def shown_unit(self) -> DisplayUnit:
        """Unit in which it is shown."""
        if self.name == "saturation":
            return DisplayUnit("%", 100.0)
        unit = LIMITED[self.name].unit
        if unit == "rad":
            return DisplayUnit("deg", 180.0 / pi)
        return DisplayUnit(unit.replace("1", ""), 1.0)

    def description(self) -> str:
        """Its value and limit: ``"off-lead 9.1 deg (8.7 to 9.5), limit 8 deg"``."""
        label = LIMITED[self.name].label
        unit, factor = self.shown_unit
        limit = f"limit {factor * self.limit:.3g} {unit}".rstrip()
        if self.largest.high == inf:
            left = f" (left the model in {self.left} of {count(self.runs, 'seaway')})"
            known = f"> {FARTHEST_SWING:g} deg" if self.name == "swing" else "unknown"
            if self.name != "swing" and self.within == "no":
                known = "beyond its limit"
            return f"{label} {known}{left if self.left else ''}, {limit}"
        if not all(map(isfinite, self.largest)):
            return f"{label} unknown: too few peaks"
        value, low, high = (factor * number for number in self.largest)
        largest = f"{label} {value:.3g} {unit}".rstrip()
        return f"{largest} ({low:.3g} to {high:.3g}), {limit}"


class Judgement(NamedTuple):
    """Whether a variant works in a sea."""

    limited: tuple[AssessedQuantity, ...]
    """Quantities that have a limit."""
    share_of_failed_starts: ConfidenceInterval
    """Share of switchings-on after which it leaves the model."""
    stays: Decision
    """Whether it stays in the model, however long its runs are.

    No, if it fails to take over the swing that it is switched on in more often than is allowed, by
    the interval of `share_of_failed_starts`, or leaves the model after that once in three hours or
    more often. Not decided if it left the model more seldom.
    """

    @property
    def sufficient(self) -> Decision:
        """Whether all stays within its limits in three hours, and in the model."""
        return all_of([*(quantity.within for quantity in self.limited), self.stays])


def judge(
    outcomes: Sequence[RunOutcome],
    limits: Mapping[str, float],
    *,
    length: float,
    allowed: float = ALLOWED_SHARE,
    other_starts: Sequence[bool] = (),
) -> Judgement:
    """Judge runs of one variant in one sea.

    Parameters
    ----------
    outcomes : sequence of RunOutcome
        Of independent seaways.
    limits : mapping of str to float
        In SI, by name.
    length : float
        Time for which each run counts. [s]
    allowed : float
        Share of switchings-on that may fail.
    other_starts : sequence of bool
        Further switchings-on of which only that is known: whether each failed.
    """
    times = [outcome.evaluated_time for outcome in outcomes if has_left(outcome)]
    late = sum(time > TAKEOVER for time in times)
    failed = len(times) - late + sum(other_starts)
    share = share_of(failed, len(outcomes) + len(other_starts))
    time_after = len(outcomes) * (length - TAKEOVER)
    stays: Decision = "not decided" if times or failed else "yes"
    if share.low > allowed or (late > 0 and late * THREE_HOURS >= time_after):
        stays = "no"
    return Judgement(assessed_limits(outcomes, limits), share, stays)


def has_left(outcome: RunOutcome) -> bool:
    """Whether a run left the model, or was stopped."""
    return bool(outcome.departure_reason)


def largest_of(outcomes: Sequence[RunOutcome], name: str) -> ConfidenceInterval:
    """Most probable largest value of a quantity in three hours, from its peaks in many runs.

    Peaks of a run that left the model are cut off at its edge, and tell nothing of what lies
    beyond. If there is such a run, or three hours would have a swing beyond that edge, the value is
    NaN, from what the other runs surely reach to inf.
    """
    stayed = [outcome for outcome in outcomes if not has_left(outcome)]
    largest = _largest_in(stayed, name)
    swing = largest if name == "swing" else _largest_in(stayed, "swing")
    if len(stayed) == len(outcomes) and not swing.value > radians(FARTHEST_SWING):
        return largest
    return ConfidenceInterval(nan, largest.low, inf)


def _largest_in(outcomes: Sequence[RunOutcome], name: str) -> ConfidenceInterval:
    runs = [outcome.peaks[name] for outcome in outcomes if name in outcome.peaks]
    evaluated_time = sum(outcome.evaluated_time for outcome in outcomes)
    return largest_of_peaks(runs, max(evaluated_time, 1.0))


def assessed_limits(
    outcomes: Sequence[RunOutcome], limits: Mapping[str, float]
) -> tuple[AssessedQuantity, ...]:
    """Quantities that have a limit and that the runs have.

    Limits of quantities that the runs lack, such as a place if the operator moves, are left out.
    """
    quantities = []
    for name, limit in limits.items():
        if name == "saturation":
            shares = np.array([outcome.saturation for outcome in outcomes])
            if np.isfinite(shares).any():
                quantities.append(AssessedQuantity(name, limit, mean_of(shares, 0.0)))
        elif any(name in outcome.peaks for outcome in outcomes):
            left = sum(map(has_left, outcomes))
            largest = largest_of(outcomes, name)
            quantities.append(AssessedQuantity(name, limit, largest, left, len(outcomes)))
    return tuple(quantities)


def all_of(decisions: Sequence[Decision]) -> Decision:
    """Whether all are yes; no if one is no."""
    if "no" in decisions:
        return "no"
    return "not decided" if "not decided" in decisions else "yes"
