"""Uncertainty of the estimates: standard errors and confidence intervals, priors taken in."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import inf, log
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.identification.estimation.drive_model import (
    LIMIT_COLUMNS,
    LIMITS,
    limits_unreached,
)
from swashplate.identification.estimation.problem import LinearisedFit, Problem, linearised_fit
from swashplate.identification.estimation.unknowns import Prior, Unknown, Unknowns
from swashplate.identification.noise import (
    Covariance,
    NoiseColour,
    coloured_noise_covariance,
    noise_colours,
    spectral_covariance,
)
from swashplate.identification.optimum import Interval, Optimum, Status, once_per_fit
from swashplate.identification.statistics.effects import (
    IN_RUN,
    RunToRun,
    effect_of_fixed,
    effects_of,
    slopes_by,
)
from swashplate.identification.statistics.interval_ends import CheckedEnd, checked_ends
from swashplate.results import Result
from swashplate.tables import listed, percent

Array = NDArray[np.float64]
Systematic = Mapping[str, Array]
"""(K,) changes of the solver's vector for a standard uncertainty of each systematic effect."""
DECADES = 100.0
"""Factor each way from which an interval says nothing; for an unknown that is not logarithmic, half
width in its scales."""
ALONE = 0.01
"""Largest correlation of an error that goes with no other. [1]"""
LEAST = 1e-6
"""Smallest worth of a prior: residuals that are all but zero leave it its say on what they leave
open."""


@dataclass(frozen=True, eq=False)
class Estimate(Result):
    """One number of a model with what is known of its error.

    The value is there immediately. Status, standard error and interval are computed when one of
    them is first asked for, unless the estimate is that of a folder which has stored them.

    Examples
    --------
    >>> from swashplate import identify, maneuvers, rig
    >>> tests = rig.run("hoist", {"step": maneuvers.step(9.0), "sine": maneuvers.sine(9.0, 0.1)})
    >>> file = rig.write(tests, "tests")
    >>> estimate = identify(file, "hoist", {"Z8": (0.5, 2), "Z16": (0.5, 2)})["Z8"]
    >>> estimate.unit
    'sqrt(Pa)/(m s)'
    >>> estimate.standard_error < 0.05 * estimate.value
    True
    """

    name: str
    value: float
    unit: str = ""
    run: str | None = None
    """The experiment that it belongs to, None for one of the machine."""
    source: Interval | Callable[[], Interval] = field(
        default_factory=lambda: Interval("undetermined"), repr=False
    )
    """What is known of its error, or what computes it."""

    @cached_property
    def _interval(self) -> Interval:
        return self.source if isinstance(self.source, Interval) else self.source()

    @property
    def status(self) -> Status:
        """How it came about, or what its interval lacks."""
        return self._interval.status

    @property
    def standard_error(self) -> float | None:
        """Standard error, in `unit`; None unless estimated.

        That of a logarithmic unknown is the value times the logarithm's.
        """
        return self._interval.standard_error

    @property
    def lower(self) -> float | None:
        """Lower end of the 95 % interval, in `unit`; None if there is no end.

        The interval of a logarithmic unknown is asymmetric about the value.
        """
        return self._interval.lower

    @property
    def upper(self) -> float | None:
        """Upper end of the 95 % interval, in `unit`; None if there is no end."""
        return self._interval.upper

    @property
    def interval(self) -> tuple[float | None, float | None]:
        """Both ends of the 95 % interval; None if there is no end."""
        return self.lower, self.upper

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Estimate):
            return NotImplemented
        same = (self.name, self.value, self.unit) == (other.name, other.value, other.unit)
        return same and self._interval == other._interval

    def __hash__(self) -> int:
        return hash((self.name, self.value, self.unit))

    @property
    def free(self) -> bool:
        """Whether the fit estimated it, or took it as it was."""
        return self.status != "fixed"

    def ends(self, factor: float = 1.0) -> tuple[str, str]:
        """Both ends in words, times a factor; the status if there is none."""
        if self.lower is None and self.upper is None:
            return self.status, ""
        low = "none below" if self.lower is None else f"{factor * self.lower:.5g}"
        high = "none above" if self.upper is None else f"{factor * self.upper:.5g}"
        return low, high

    @property
    def relative_half_width(self) -> float:
        """Half of the interval over the value's size; infinite if an end is missing."""
        if self.lower is None or self.upper is None or self.value == 0.0:
            return inf
        return 0.5 * (self.upper - self.lower) / abs(self.value)


def reach(covariance: Covariance) -> Array:
    """(K,) half widths of the intervals in the solver's vector; 0 for unknowns without one."""
    has_interval = covariance.determined & covariance.variables.free
    half_widths: Array = covariance.quantiles * np.where(
        has_interval, covariance.standard_errors, 0.0
    )
    return half_widths


def estimates(
    covariance: Covariance, ends: Mapping[tuple[int, bool], float] = MappingProxyType({})
) -> tuple[Estimate, ...]:
    """Estimates with 95 % intervals from a covariance of the solver's vector.

    `ends` are distances of ends that differ from the covariance's, in that vector, inf where there
    is none, by the unknown's number and the side, True for the upper one.

    Notes
    -----
    An interval is symmetric in the solver's vector, ± Student's quantile times the standard error,
    and carried over from there: a positive unknown never has a negative end. Student's rather than
    the normal quantile, because the variance is itself estimated, from a number of independent
    stretches of residual that may be small.
    """
    half_widths = reach(covariance)
    variables = covariance.variables
    below = np.array([ends.get((k, False), width) for k, width in enumerate(half_widths)])
    above = np.array([ends.get((k, True), width) for k, width in enumerate(half_widths)])
    with np.errstate(invalid="ignore"):
        lower = variables.to_values(variables.vector - below)
        upper = variables.to_values(variables.vector + above)
    errors = np.abs(variables.slopes) * covariance.standard_errors
    vast = half_widths > np.where(variables.logarithmic, log(DECADES), DECADES)
    has_interval = covariance.determined & ~vast
    return tuple(
        Estimate(
            name=name,
            value=float(variables.estimates[k]),
            unit=unknown.unit,
            run=unknown.run,
            source=_interval(
                side=int(variables.at_bound[k]),
                has_interval=bool(has_interval[k]),
                error=float(errors[k]),
                lower=None if np.isinf(below[k]) else float(lower[k]),
                upper=None if np.isinf(above[k]) else float(upper[k]),
            ),
        )
        for k, (name, unknown) in enumerate(zip(variables.names, variables.items, strict=True))
    )


def _interval(
    *, side: int, has_interval: bool, error: float, lower: float | None, upper: float | None
) -> Interval:
    """The interval of one unknown, and its status; `side` is that of the bound at which it is."""
    if side:
        return Interval("at its lower bound" if side < 0 else "at its upper bound")
    if not has_interval or (lower is None and upper is None):
        return Interval("undetermined")
    if lower is None:
        return Interval("no lower end", None, None, upper)
    if upper is None:
        return Interval("no upper end", None, lower, None)
    return Interval("estimated", error, lower, upper)


# --- what is taken for granted --------------------------------------------------------------------


def with_effects(own: Covariance, systematic: Systematic) -> Covariance:
    """A covariance with systematic effects.

    The degrees of freedom are Satterthwaite's, of the sum of the variances; a standard uncertainty
    that was stated has infinitely many (JCGM 100:2008, G.4).
    """
    if not systematic:
        return own
    both_determined = np.outer(own.determined, own.determined)
    columns = np.array(list(systematic.values())).reshape(-1, len(own.variables))
    total = own.matrix + np.where(both_determined, columns.T @ columns, 0.0)
    spread = np.diag(own.matrix) ** 2 / own.degrees_of_freedom
    variance = np.diag(total)
    freedom = np.divide(variance**2, spread, out=np.full_like(variance, np.inf), where=spread > 0.0)
    return replace(own, matrix=total, degrees_of_freedom=freedom)


def with_runs(noise: Covariance, runs: RunToRun | None) -> Covariance:
    """A covariance of the noise with what runs differ by."""
    if runs is None:
        return noise
    both_determined = np.outer(noise.determined, noise.determined)
    between = np.where(both_determined, runs.slopes @ runs.slopes.T, 0.0)
    spread = np.diag(noise.matrix) ** 2 / noise.degrees_of_freedom
    spread += np.diag(between) ** 2 / runs.degrees_of_freedom
    total = noise.matrix + between
    variance = np.diag(total)
    freedom = np.divide(variance**2, spread, out=np.full_like(variance, np.inf), where=spread > 0.0)
    return replace(noise, matrix=total, degrees_of_freedom=freedom)


# --- all together ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Uncertainty(Result):
    """Errors of a fit's estimates: those to quote, and what they rest on."""

    own: Covariance
    """That of the noise and of the runs' differences."""
    inflation: Array
    """(K,) samples that stand for one independent one, at least 1, unknown by unknown: the own
    variance over that of white residuals."""
    colours: tuple[NoiseColour, ...]
    noisy: bool
    """Whether there are any residuals at all."""
    systematic: Systematic
    runs: RunToRun | None = None
    """How runs differ, if that is known."""
    ends: tuple[CheckedEnd, ...] = ()
    """Sides on which the cost does not rise as the covariance says."""
    priors: tuple[str, ...] = ()
    """What each prior adds, in words."""

    @cached_property
    def quoted(self) -> Covariance:
        """The own one with systematic effects."""
        return with_effects(self.own, self.systematic)

    @cached_property
    def within_ends(self) -> Array:
        """(K, K) own covariance with the ends that were found nearer than it says.

        Notes
        -----
        That one unknown has the standard error s' instead of s leaves of a covariance C, with its
        column c, C − (1 - s'²/s²) c cᵀ/s²: what makes up for it has less to make up for.

        The nearer of two ends counts of a limit that goes with nothing else: one that is just not
        reached has it towards what the tests reached, and beyond it lies what no motion like theirs
        shows. Of all others the farther one counts.
        """
        widths, covariance = reach(self.own), self.own.matrix.copy()
        correlation = np.abs(self.own.correlation)
        np.fill_diagonal(correlation, 0.0)
        for number in {end.number for end in self.ends}:
            sides = {end.upper: end.distance for end in self.ends if end.number == number}
            alone = correlation[number].max(initial=0.0) < ALONE
            distances = [sides.get(upper, widths[number]) for upper in (False, True)]
            distance = min(distances) if alone else max(distances)
            if distance < widths[number]:
                column = covariance[number] / np.sqrt(covariance[number, number])
                within = (distance / widths[number]) ** 2
                covariance -= (1.0 - within) * np.outer(column, column)
        return covariance

    @cached_property
    def estimates(self) -> tuple[Estimate, ...]:
        """Values with the quoted intervals; ends that were checked stand in place of others."""
        added = np.maximum(reach(self.quoted) ** 2 - reach(self.own) ** 2, 0.0)
        ends = {
            (end.number, end.upper): float(np.sqrt(end.distance**2 + added[end.number]))
            for end in self.ends
        }
        return estimates(self.quoted, ends)

    def sentences(self) -> tuple[str, ...]:
        """What the errors rest on."""
        if not self.noisy:
            return ("The residuals are exactly zero: errors of zero do not apply to other tests.",)
        sentences = []
        for colour in self.colours:
            sentences.append(colour.sentence)
            if colour.drifting:
                sentences.append(
                    f"That is a large part of a run: residuals of {colour.channel} are model error "
                    "or a spectral line rather than noise, which intervals hardly cover."
                )
        sentences += self.priors
        sentences += _end_sentences(self.own.variables.names, self.ends)
        if self.runs is not None:
            sentences.append(
                f"From run to run the motion's scale differs by {100.0 * self.runs.deviation:.2g} "
                "% (standard deviation), which the intervals include."
            )
        sentences += self._widened()
        return tuple(sentences)

    def _widened(self) -> Iterator[str]:
        """What systematic effects add to the intervals."""
        has_variance = self.own.determined & (np.diag(self.own.matrix) > 0.0)
        if not has_variance.any() or not self.systematic:
            return
        wider = np.ones(has_variance.size)
        wider[has_variance] = (
            self.quoted.standard_errors[has_variance] / self.own.standard_errors[has_variance]
        )
        most = int(np.argmax(wider))
        name = self.own.variables.names[most]
        text = (
            "Intervals include possible errors of instruments, fixed parameters and the model, "
            f"which widens them by a factor of {float(np.median(wider[has_variance])):.2f} in the "
            f"median and of {wider[most]:.2f} for {name}"
        )
        shares = self.budget(most)
        if shares:
            effect, share = next(iter(shares.items()))
            text += f", {percent(share, 1.0)} of whose variance is the {effect}"
        yield f"{text}."

    def budget(self, number: int) -> dict[str, float]:
        """Share of each systematic effect in the variance of an unknown, the largest first.

        Effects of one kind in several runs, such as the command's zero, are added up.
        """
        variance = float(self.quoted.matrix[number, number])
        if not variance > 0.0:
            return {}
        shares = dict[str, float]()
        for effect, change in self.systematic.items():
            kind = effect.partition(IN_RUN)[0]
            shares[kind] = shares.get(kind, 0.0) + float(change[number]) ** 2 / variance
        return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _end_sentences(names: Sequence[str], ends: Sequence[CheckedEnd]) -> Iterator[str]:
    """What checked ends of intervals say."""
    for end in ends:
        if end.better is not None:
            yield (
                "The search had not found the best fit: the interval of "
                f"{names[end.number]} led to a better one, cost {end.better:.6g}. Fit again with "
                "--starts 20 (in Python search = Search(20))."
            )
    found = [end for end in ends if end.better is None]
    of_profiles = list(
        dict.fromkeys(names[end.number] for end in found if np.isfinite(end.distance))
    )
    if len(of_profiles) == 1:
        yield f"The interval of {of_profiles[0]} follows the cost, which is not symmetric there."
    elif of_profiles:
        yield f"Intervals of {listed(of_profiles)} follow the cost, which is not symmetric there."
    for end in found:
        if not np.isfinite(end.distance):
            side = "upper" if end.upper else "lower"
            yield (
                f"{names[end.number]} has no {side} end: the cost does not rise enough on that "
                "side."
            )


def uncertainty(
    fit: LinearisedFit,
    *,
    systematic: Systematic = MappingProxyType({}),
    runs: RunToRun | None = None,
) -> Uncertainty:
    """Errors of a fit's estimates for coloured residuals.

    Parameters
    ----------
    fit : LinearisedFit
        The fit at its optimum, see `linearised_fit`.
    systematic : mapping of str to (K,) array
        Changes of the solver's vector for a standard uncertainty of each systematic effect.
    runs : RunToRun, optional
        How runs differ.

    Returns
    -------
    Uncertainty
        With `estimates`, which have intervals of 95 %.

    Raises
    ------
    InputError
        If there are no more samples than unknowns.
    """
    bounded, fit = fit.variables, released(fit)
    own = replace(with_runs(coloured_noise_covariance(fit), runs), variables=bounded)
    white = fit.squares / fit.spare_samples * np.sum(fit.whitening**2, axis=1)
    ratio = np.ones_like(white)
    np.divide(
        np.diag(own.matrix),
        white,
        out=ratio,
        where=own.determined & (white > 0.0),
    )
    return Uncertainty(
        own=own,
        inflation=np.maximum(ratio, 1.0),
        colours=noise_colours(fit),
        noisy=fit.squares > 0.0,
        systematic=systematic,
        runs=runs,
    )


@once_per_fit
def uncertainty_of(fit: Optimum) -> Uncertainty:
    """Errors of a fit's estimates, effects and checked ends taken in.

    Raises
    ------
    InputError
        If there are no more samples than unknowns.
    """
    problem = fit.problem
    vector = fit.solution.vector
    effects = effects_of(fit)
    systematic = dict(effects.systematic)
    changes = slopes_by(fit, problem.uncertain).T
    for deviations, change in zip(problem.uncertain, changes, strict=True):
        systematic[effect_of_fixed(deviations)] = change
    result = uncertainty(fit.linearised, systematic=systematic, runs=effects.runs)
    result = replace(
        result, priors=prior_sentences(problem.unknowns, vector, result.quoted.standard_errors)
    )
    if not result.noisy:
        return result
    half_widths = reach(result.own)
    linearised = released(fit.linearised)
    limits = [
        number
        for number, unknown in enumerate(problem.unknowns)
        if unknown.kind == "parameter" and unknown.targets[0].startswith(tuple(LIMITS))
    ]
    ends = checked_ends(problem, vector, linearised, half_widths, limits)
    return replace(result, ends=tuple(ends))


@once_per_fit
def intervals_of(fit: Optimum) -> tuple[Interval, ...]:
    """What is known of the error of each unknown of a fit: stored, or as its uncertainty has it.

    With no more samples than unknowns, no unknown has an interval.
    """
    if fit.stored is not None:
        return fit.stored
    try:
        computed = uncertainty_of(fit).estimates
    except InputError:
        return (Interval("undetermined"),) * len(fit.problem.unknowns)
    return tuple(
        Interval(estimate.status, estimate.standard_error, estimate.lower, estimate.upper)
        for estimate in computed
    )


@once_per_fit
def estimates_of(fit: Optimum) -> tuple[Estimate, ...]:
    """Each unknown of a fit with its value, in their order.

    The intervals are computed when one of them is first asked for, unless they are stored.
    """
    point = fit.problem.unknowns.at(fit.solution.vector)
    values = point.estimates.tolist()
    return tuple(
        Estimate(
            name=unknown.label,
            value=values[number],
            unit=unknown.unit,
            run=unknown.run,
            source=partial(_interval_of, fit, number),
        )
        for number, unknown in enumerate(point)
    )


def _interval_of(fit: Optimum, number: int) -> Interval:
    return intervals_of(fit)[number]


def released(fit: LinearisedFit) -> LinearisedFit:
    """The fit with unknowns at a bound free to move.

    An interval of one unknown must allow for all that the others may be. One at its bound may lie
    anywhere inside: kept there, its partners would seem far better known than they are.
    """
    return fit if fit.variables.free.all() else replace(fit, variables=fit.variables.released)


MOST_PRIORS = 5
"""Priors that are told one by one."""
HALVED, UNTOLD = 0.25, 0.9
"""Shares of a prior below which the tests have halved its width, and above which they say nothing
of the number. [1]"""


def weighed(problem: Problem, vector: Array) -> Problem:
    """The problem with priors that count as much as the residuals are really worth.

    The cost takes every residual for an independent one of variance 1. If a hundred of them are
    worth one, data would outweigh a prior a hundred times too much. So a prior counts as often as
    that: by the ratio of its unknown's variance under the noise that the residuals show to its
    variance under the noise that the cost assumes, both from the data alone; by the median of the
    others if the data alone tell less of the unknown than its prior, as such a direction is one of
    next to no residuals. `vector` (K,) is at or near the optimum; an `InputError` says that there
    are no more samples than unknowns.
    """
    fit = linearised_fit(replace(problem, unknowns=problem.unknowns.with_worths(None)), vector)
    covariance = spectral_covariance(fit)
    assumed = np.sum(fit.whitening**2, axis=1)
    narrower_than_prior = np.diag(covariance.matrix) < problem.unknowns.prior_widths**2
    determined = covariance.determined & (assumed > 0.0) & narrower_than_prior
    ratio = np.diag(covariance.matrix)[determined] / assumed[determined]
    ratios = np.full(determined.size, float(np.median(ratio)) if determined.any() else 1.0)
    ratios[determined] = ratio
    has_prior = [unknown.prior is not None for unknown in problem.unknowns]
    worths = np.maximum(ratios[has_prior], LEAST).tolist()
    return replace(problem, unknowns=problem.unknowns.with_worths(worths))


class _PriorShare(NamedTuple):
    """What a prior says of an unknown, beside what the data say."""

    unknown: Unknown
    prior: Prior
    share: float
    """Part of the information on the unknown that is the prior's. [1]"""
    pull: float
    """Distance of the estimate from the prior's mean, in its standard deviations."""

    @property
    def words(self) -> str:
        """Its mean and standard deviation."""
        spread = f"{self.prior.deviation:.4g}"
        if self.unknown.log:
            spread = f"{100.0 * self.prior.deviation:.3g} %"
        return f"{self.prior.mean:.5g} ± {spread}"

    @property
    def sentence(self) -> str:
        """All of it."""
        return (
            f"The prior of {self.unknown.name}, {self.words}, contributes "
            f"{percent(self.share, 1.0)} of the information on it; the estimate lies "
            f"{abs(self.pull):.2g} deviations {'above' if self.pull >= 0.0 else 'below'} its mean."
        )


def prior_sentences(unknowns: Unknowns, vector: Array, errors: Array) -> tuple[str, ...]:
    """What priors of the machine add, and which estimates lie far from theirs.

    Of a few each has a sentence; of many those are named that the tests narrow, and those that they
    leave as they were. `errors` are standard errors (K,) of the vector.
    """
    priors = list[_PriorShare]()
    for unknown, number, error in zip(unknowns, vector, errors, strict=True):
        prior = unknown.prior
        if prior is None or unknown.run is not None:
            continue
        scale = 1.0 if unknown.log else unknown.scale
        share = min(float(error * scale / prior.deviation) ** 2, 1.0)
        priors.append(_PriorShare(unknown, prior, share, unknown.pull(float(number))))
    if len(priors) <= MOST_PRIORS:
        return tuple(each.sentence for each in priors)
    narrowed = [each.unknown.name for each in priors if each.share < HALVED]
    unchanged = [each.unknown.name for each in priors if each.share > UNTOLD]
    sentences = [
        f"Of {len(priors)} numbers with a prior the tests narrow {len(narrowed)} to less than half "
        f"of it{f': {listed(narrowed)}' if narrowed else ''}."
    ]
    if unchanged:
        sentences.append(f"They say nothing of {listed(unchanged)}: these stay as stated.")
    return tuple(sentences)


def unseen_limits(fit: Optimum) -> dict[str, float]:
    """Limits that may lie anywhere beyond a value, by column, and that value. [SI]

    Those that no fitted run reached, from where these ended, and those whose estimate has no upper
    end, from its lower one.
    """
    unseen = limits_unreached(fit.problem.experiments, fit.drive.parameters)
    for estimate in estimates_of(fit):
        one_sided = estimate.upper is None and estimate.lower is not None
        if estimate.name in LIMIT_COLUMNS and one_sided:
            unseen.setdefault(estimate.name, float(estimate.lower or 0.0))
    return {column: value for column, value in unseen.items() if value > 0.0}
