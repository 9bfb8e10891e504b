"""What if: a drive before and after design variables are scaled, together and one at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.design_variables import FactorRange, check_ranges, with_factors
from swashplate.analysis.outcomes import (
    OUTCOMES,
    Outcome,
    Trial,
    find_outcomes,
    outcome_matrix,
    trial_of,
)
from swashplate.drive import Drive, Simulation
from swashplate.errors import DomainError, InputError, ParameterError
from swashplate.maneuvers import Maneuver
from swashplate.parameters import FULL_VOLTAGE
from swashplate.results import Drawn, Result, figures
from swashplate.tables import UNIT, Column, Table, listed, quantity
from swashplate.units import of_shaft

if TYPE_CHECKING:
    from swashplate.analysis.monte_carlo import Bands
    from swashplate.results import Figure

Array = NDArray[np.float64]
# --- before and after -----------------------------------------------------------------------------

AS_IS, CHANGED = "as it is", "changed"


@dataclass(frozen=True, eq=False)
class Variant(Result):
    """A drive over the trial's command."""

    drive: Drive
    run: Simulation
    values: Array
    """(K,) outcomes, NaN if there is none."""

    @property
    def speed_limits(self) -> tuple[float, float]:
        """Speeds that the largest commands settle at, positive and negative. [rad/s]"""
        return tuple(self.drive.steady_speed([FULL_VOLTAGE, -FULL_VOLTAGE]).tolist())


def _variant(
    drive: Drive, factors: Mapping[str, float], trial: Trial, outcomes: Sequence[Outcome]
) -> Variant:
    scaled = with_factors(drive, factors)
    run = scaled.simulate(trial.voltage, trial.rate)
    return Variant(scaled, run, outcome_matrix(run.shaft_speed[None, :], trial, outcomes)[0])


def _undefined(outcomes: Sequence[Outcome], values: Mapping[str, Array]) -> tuple[str, ...]:
    """Outcomes that some variants lack, and why."""
    sentences = []
    for k, outcome in enumerate(outcomes):
        without = [name for name, numbers in values.items() if np.isnan(numbers[k])]
        if without:
            variants = "all variants" if len(without) == len(values) else listed(without)
            sentences.append(f"{variants}: no {outcome.name}, {outcome.undefined}.")
    return tuple(sentences)


@dataclass(frozen=True, eq=False)
class WhatIf(Result):
    """A drive before and after."""

    factors: Mapping[str, float]
    """By design variable. [1]"""
    trial: Trial
    """The command."""
    outcomes: tuple[Outcome, ...]
    variants: Mapping[str, Variant]
    """``"as it is"`` first, then ``"changed"``; with several design variables each alone in
    between, by words such as ``"orifice x 1.5"``."""

    @property
    def before(self) -> Variant:
        """The drive as it is."""
        return self.variants[AS_IS]

    @property
    def after(self) -> Variant:
        """The drive with all design variables scaled."""
        return self.variants[CHANGED]

    def plot(self, *, bands: Mapping[str, Bands] | None = None, title: str | None = None) -> Figure:
        """Figure of the command, the speeds and the accelerations of the drive before and after.

        With `bands` as of `swashplate.report.figures.plot_whatif`.
        """
        return cast("Figure", figures().plot_whatif(self, bands=bands or {}, title=title))

    def sentences(self) -> tuple[str, ...]:
        """Outcomes that some variants lack, and why."""
        values = {name: variant.values for name, variant in self.variants.items()}
        return _undefined(self.outcomes, values)

    def table(self, bands: Mapping[str, Bands] | None = None) -> Table:
        """Speed limits and outcomes of the drive as it is and changed.

        With the `bands` of both, of the same outcomes, each number has half of its interval.
        """
        columns = list[Column]()
        cells = list[Array]()
        for name, variant in ((AS_IS, self.before), (CHANGED, self.after)):
            columns.append(Column(name, "z.2f", none="none"))
            cells.append(np.array([*variant.speed_limits, *variant.values]))
            if bands:
                columns.append(Column("±", "z.2f", none="none"))
                cells.append(bands[name].half_widths)
        as_it_is, changed = cells[0], cells[2 if bands else 1]
        change = changed / np.where(as_it_is == 0.0, np.nan, as_it_is) - 1.0
        table = Table("", (Column(""), *columns, Column("change", "+z.1%"), UNIT))
        plus, minus, *outcome_rows = np.array([*cells, change]).T.tolist()
        table.add("top speed, positive", *plus, unit="rad/s")
        table.add("top speed, negative", *minus, unit="rad/s")
        for outcome, row in zip(self.outcomes, outcome_rows, strict=True):
            outcome.add_to(table, row)
        return table


def what_if(
    drive: Drive,
    factors: Mapping[str, float],
    trial: Trial | Maneuver,
    *,
    outcomes: Sequence[str] = tuple(OUTCOMES),
) -> WhatIf:
    """Simulate a command before and after design variables are scaled.

    Parameters
    ----------
    drive : Drive
        As it is.
    factors : mapping of str to float
        By design variable, see `DESIGN_VARIABLES`, e.g. ``{"orifice": 1.5, "pump": 1.5}``. [1]
    trial : Trial or Maneuver
        The command, see `trial_of`; both drives begin at rest.
    outcomes : sequence of str
        Names in `outcomes.OUTCOMES`.

    Returns
    -------
    WhatIf
        Outcomes and runs of the drive as it is, with each factor by itself, and with all of them.

    Raises
    ------
    InputError
        If there is no design variable, an unknown one, or an impossible factor.
    ParameterError
        If the changed drive breaks a rule of the model.

    Examples
    --------
    >>> from swashplate import Drive, analysis, maneuvers
    >>> hoist = Drive.preset("hoist")
    >>> changed = analysis.what_if(hoist, {"orifice": 1.5}, maneuvers.step(9.0))
    >>> list(changed.variants)
    ['as it is', 'changed']
    """
    if not factors:
        raise InputError("Scale at least one design variable, such as orifice=1.5.")
    with_factors(drive, factors)  # refuses what no drive can have
    if not isinstance(trial, Trial):
        trial = trial_of(drive, trial)
    computed = find_outcomes(outcomes)
    variants = {AS_IS: _variant(drive, {}, trial, computed)}
    if len(factors) > 1:
        for name, factor in factors.items():
            variants[f"{name} x {factor:g}"] = _variant(drive, {name: factor}, trial, computed)
    variants[CHANGED] = _variant(drive, factors, trial, computed)
    return WhatIf(dict(factors), trial, computed, variants)


# --- each design variable by itself ---------------------------------------------------------------

LEAST_SWING = 5e-4
"""A design variable that changes an outcome by less than this share has no row of its own. [1]"""


@dataclass(frozen=True, eq=False)
class OneAtATime(Drawn):
    """Outcomes with each design variable scaled down and up by itself."""

    drawn_by: ClassVar[str] = "plot_tornado"

    ranges: Mapping[str, FactorRange]
    """Factors down and up by design variable. [1]"""
    outcomes: tuple[Outcome, ...]
    base: Array
    """(K,) outcomes of the drive as it is; NaN if there is none."""
    low: Array
    """(L, K) with each design variable at its lower factor."""
    high: Array
    """(L, K) with each design variable at its upper factor."""
    sentences: tuple[str, ...]
    """Sentences on changes that could not be simulated, or that lack an outcome."""

    @property
    def swings(self) -> Array:
        """(L, K) how far apart the two are, NaN if one of them is missing."""
        return np.abs(self.high - self.low)

    def tables(self, *, every: bool = False) -> list[Table]:
        """A table for each outcome, the strongest design variable first.

        Those that do not change it stand in the caption; with `every` they have rows, too.
        """
        return [self._table(k, every) for k in range(len(self.outcomes))]

    def _table(self, k: int, every: bool) -> Table:
        outcome = self.outcomes[k]
        base = float(self.base[k])
        swings = self.swings[:, k]
        unit = of_shaft(outcome.unit)
        shown_base = "none" if np.isnan(base) else quantity(base, unit, spec=outcome.spec)
        columns = (
            Column("outcome", of="f"),
            Column("unit", of="f"),
            Column("design variable"),
            Column("from", "g", key="lower factor"),
            Column("to", "g", key="upper factor"),
            Column("as it is", of="f"),
            Column("down", outcome.spec, unit, "none", key="at lower factor"),
            Column("up", outcome.spec, unit, "none", key="at upper factor"),
            Column("swing", ".1%"),
        )
        table = Table("", columns)
        table.title = f"{outcome.label}, {shown_base} as it is"
        names = list(self.ranges)
        without_effect = list[str]()
        for j in np.argsort(-np.nan_to_num(swings), kind="stable"):
            if swings[j] <= LEAST_SWING * abs(base) and not every:
                without_effect.append(names[j])
                continue
            lower, upper = self.ranges[names[j]]
            table.add(
                outcome.name,
                outcome.unit,
                names[j],
                lower,
                upper,
                base,
                float(self.low[j, k]),
                float(self.high[j, k]),
                float(swings[j] / abs(base)) if base else None,
            )
        if len(without_effect) == len(names):
            table.caption = "no design variable changes it"
        elif without_effect:
            table.caption = f"not changed by {', '.join(without_effect)}"
        return table


def one_at_a_time(
    drive: Drive,
    ranges: Mapping[str, FactorRange],
    trial: Trial,
    *,
    outcomes: Sequence[str],
) -> OneAtATime:
    """Scale each design variable by itself, down and up.

    Parameters
    ----------
    drive : Drive
        As it is.
    ranges : mapping of str to (float, float)
        Lower and upper factor by design variable, such as ``{"orifice": (0.9, 1.1)}``. [1]
    trial : Trial
        The command.
    outcomes : sequence of str
        Names in `outcomes.OUTCOMES`.

    Raises
    ------
    InputError
        For an unknown design variable or outcome, or a range that does not rise.
    DomainError
        If the drive as it is leaves the model's domain under the command.
    """
    check_ranges(ranges)
    computed = find_outcomes(outcomes)
    values = {AS_IS: _variant(drive, {}, trial, computed).values}
    ends = np.full((2, len(ranges), len(computed)), np.nan)
    sentences = list[str]()
    for j, (name, factors) in enumerate(ranges.items()):
        for end, factor in enumerate(factors):
            variant = f"{name} x {factor:g}"
            try:
                ends[end, j] = _variant(drive, {name: factor}, trial, computed).values
            except (ParameterError, DomainError) as refusal:
                sentences.append(f"{variant} cannot be simulated: {refusal}")
            else:
                values[variant] = ends[end, j]
    return OneAtATime(
        ranges=dict(ranges),
        outcomes=computed,
        base=values[AS_IS],
        low=ends[0],
        high=ends[1],
        sentences=(*sentences, *_undefined(computed, values)),
    )
