"""Tables of a fit and of a validation: estimates, runs, errors, residuals, folds, criteria, advice.

Each is made once; the terminal, the report's page and the files render it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from swashplate.errors import InputError
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.experiment_design import Advice, Gain, Outlook
from swashplate.identification.identifiability import GAUGES, SCALES, moved_columns, true_values
from swashplate.identification.intervals import Estimate
from swashplate.identification.setup import ModelSetup
from swashplate.identification.validation import ignored_windows, pooled, with_speeds
from swashplate.parameters.definitions import CATALOGUE, COLUMNS
from swashplate.simulation.instance import START_PRESSURE
from swashplate.tables import (
    NONE,
    UNIT,
    Cell,
    Column,
    Table,
    listed,
    percent,
    plain,
    spread,
)
from swashplate.units import chosen_unit, display_unit

if TYPE_CHECKING:
    from swashplate.campaign.experiment import Channel, Experiment
    from swashplate.identification.assessment import Assessment
    from swashplate.identification.fitting import Fit, StageFit
    from swashplate.identification.resampling import Bootstrap, CrossValidation
    from swashplate.identification.validation import Measures, RunQuality
    from swashplate.identification.verdict import Verdict
    from swashplate.parameters.parameter_set import ParameterSet

# --- estimates ------------------------------------------------------------------------------------


def estimates_table(
    assessment: Assessment,
    *,
    truth: ParameterSet | None = None,
    bootstrap: Bootstrap | None = None,
    own: bool = False,
) -> Table:
    """Estimates of a stage with their intervals.

    Parameters
    ----------
    assessment : Assessment
        Of the stage.
    truth : ParameterSet, optional
        Of virtual tests: what was simulated.
    bootstrap : Bootstrap, optional
        Whose intervals stand beside.
    own : bool
        Whether the unknowns of single runs are meant, instead of those of the machine.
    """
    stage = assessment.stage
    unknowns = stage.problem.unknowns
    true = {} if truth is None else true_values(stage, truth)
    refitted = None if bootstrap is None else bootstrap.intervals()
    level, quoted = _intervals(assessment)
    ends = f"{100.0 * level:g} %"
    number = ".5g"
    made = Table(
        f"Stage {stage.stage.name}",
        (
            Column("stage", of="f"),
            Column("parameter"),
            Column("meaning", of="p"),
            UNIT if truth is None else Column("unit", of="pf"),
            Column("nominal", number),
            Column("estimate", number),
            Column("change", "s", of="p"),
            Column("truth", number, of="tpf" if true else ""),
            Column("holds", of="tpf" if true else ""),
            Column(f"lower {ends}", number, none=NONE),
            Column(f"upper {ends}", number, none=NONE),
            Column("half width", "s", of="p"),
            Column(f"bootstrap lower {ends}", number, none="-", of="tpf" if refitted else ""),
            Column(f"bootstrap upper {ends}", number, none="-", of="tpf" if refitted else ""),
            Column("standard error", number, of="f"),
            Column("status", of="pf"),
        ),
        si=True,
    )
    at_bounds = _at_bounds(stage)
    for k, (name, unknown) in enumerate(zip(unknowns.names, unknowns, strict=True)):
        if (unknown.run is None) == own:
            continue
        estimate = quoted[k]
        value, factor = stage.values[name], chosen_unit(unknown.unit).factor
        status = at_bounds.get(name, "estimated") if estimate is None else estimate.status
        low, high = (None, None) if estimate is None else (estimate.lower, estimate.upper)
        shown = (f"{factor * value:.5g}", "", "")
        if low is not None and high is not None:
            shown = spread(factor * value, factor * low, factor * high)
        lower, upper = _end(low, shown[1], factor, "below"), _end(high, shown[2], factor, "above")
        if low is None and high is None:
            lower, upper = Cell(None, status), Cell(None, "")
        known = true.get(name)
        redrawn = (None if refitted is None else refitted[k]) or (None, None)
        made.add(
            stage.stage.name,
            name,
            meaning_of(unknown.name, stage),
            *(() if truth is None else (Cell(unknown.unit, chosen_unit(unknown.unit).name),)),
            unknown.start,
            Cell(value, shown[0]),
            "" if own else percent(value - unknown.start, unknown.start, sign=True),
            known,
            "" if known is None else _holds(estimate, known),
            lower,
            upper,
            NONE if low is None or high is None else f"±{percent(0.5 * (high - low), value)}",
            *redrawn,
            None if estimate is None else estimate.standard_error,
            status,
            unit=unknown.unit,
            look=status != "estimated",
        )
    return made


def _end(value: float | None, shown: str, factor: float, side: str) -> Cell:
    if value is None:
        return Cell(None, f"none {side}")
    return Cell(value, shown or f"{factor * value:.5g}")


def _intervals(assessment: Assessment) -> tuple[float, Sequence[Estimate | None]]:
    """Level and intervals; none where the verdict says why."""
    try:
        found = assessment.uncertainty
        return found.level, found.estimates
    except InputError:
        return 0.95, [None] * len(assessment.stage.problem.unknowns)


def _at_bounds(stage: StageFit) -> dict[str, str]:
    point = stage.problem.unknowns.at(stage.solution.vector)
    sides = {-1: "at its lower bound", 1: "at its upper bound"}
    ends = zip(point.names, point.at_bound, strict=True)
    return {name: sides[int(k)] for name, k in ends if int(k) in sides}


def _holds(estimate: Estimate | None, truth: float) -> str:
    if estimate is None or (estimate.lower is None and estimate.upper is None):
        return ""
    low = -np.inf if estimate.lower is None else estimate.lower
    high = np.inf if estimate.upper is None else estimate.upper
    return "yes" if low <= truth <= high else "no"


def truth_count(tables: Sequence[Table]) -> tuple[int, int]:
    """How many intervals of tables with a truth hold it, and of how many."""
    names = [each.name for each in tables[0].columns if each is not UNIT]
    place = names.index("holds")
    said = [row.cells[place] for table in tables for row in table.rows]
    return said.count("yes"), said.count("yes") + said.count("no")


def meaning_of(name: str, stage: StageFit | None = None) -> str:
    """What an unknown is, in words; empty if nothing is known of the name."""
    kind, _, channel = name.partition(" ")
    if kind == "offset":
        return f"free zero of {channel}"
    if stage is not None and stage.stage.part == "model":
        return "number of the state at the first sample" if name.startswith("start.") else ""
    if name == START_PRESSURE:
        return "stroking pressure at the first sample"
    if name.startswith("start_current_"):
        return "current of the card at the first sample"
    if name.startswith("force_"):
        return _force_words(name, stage)
    definition = CATALOGUE.get(COLUMNS.get(name, name))
    if definition is None:
        return ""
    way = {"plus": ", positive", "minus": ", negative"}.get(name.rpartition("_")[2], "")
    return definition.name + (way if definition.directional else "")


def _force_words(name: str, stage: StageFit | None) -> str:
    _, side, number = name.split("_")
    way = "positive" if side == "plus" else "negative"
    model = stage.problem.model if stage is not None else None
    if isinstance(model, DriveModel) and model.forces is not None:
        current = (model.forces.plus if side == "plus" else model.forces.minus)[int(number) - 1]
        return f"solenoid force {current:g} A beyond the dead zone, {way}"
    return f"solenoid force, {way}"


def fixed_table(fit: Fit, truth: ParameterSet | None = None) -> Table:
    """The parameters that no stage moved; `truth` as it is, in no other scales."""
    made = Table(
        "Fixed at their nominal values",
        (
            Column("parameter"),
            Column("meaning"),
            Column("value", ".5g"),
            UNIT,
            Column("truth", ".5g", of="" if truth is None else "tpf"),
            Column("reason, where known"),
            Column("source"),
        ),
        si=True,
    )
    moved, parameters = moved_columns(fit), fit.parameters
    if isinstance(parameters, ModelSetup):
        for name, value in parameters.numbers.items():
            if name not in moved:
                made.add(name, "", value, None, "given with the model", "")
        return made
    for column, symbol in COLUMNS.items():
        if column in moved:
            continue
        one, value = parameters[symbol], parameters.numbers[column]
        why = _why_fixed(parameters, column, symbol, moved)
        true = None if truth is None else truth.numbers[column]
        made.add(column, meaning_of(column), value, true, why, one.source, unit=one.unit)
    return made


def _why_fixed(parameters: ParameterSet, column: str, symbol: str, moved: set[str]) -> str:
    """Why nothing was to be found out about a parameter, as far as that can be told."""
    for gauge in GAUGES:
        fixed = next((each for each in gauge.fix if not _is_moved(each, moved)), None)
        others = [each for each in gauge.moves if each != symbol and _is_moved(each, moved)]
        if gauge.name in SCALES and fixed == symbol and others:
            return f"fixes the {gauge.name}: {gauge.determined}"
    if parameters[symbol].status == "inactive":
        return "inactive: no test reaches it"
    return "0: this effect is left out" if parameters.numbers[column] == 0.0 else ""


def _is_moved(symbol: str, moved: Collection[str]) -> bool:
    return any(column in moved for column in (symbol, f"{symbol}_plus", f"{symbol}_minus"))


def fixed_line(fit: Fit) -> str:
    """The symbols that kept their nominal values, in a sentence."""
    moved = moved_columns(fit)
    plain_names = (n.removesuffix("_plus").removesuffix("_minus") for n in fit.nominal.numbers)
    kept = [name for name in dict.fromkeys(plain_names) if not _is_moved(name, moved)]
    return f"Fixed at their nominal values: {', '.join(kept) or 'none'}."


# --- runs -----------------------------------------------------------------------------------------


def runs_tables(
    qualities: Sequence[RunQuality], *, stages: Mapping[int, str] | None = None
) -> list[Table]:
    """Errors of each run, a table for each channel with all of its runs in the last row.

    Parameters
    ----------
    qualities : sequence of RunQuality
        Of runs that were fitted, or of runs that were predicted.
    stages : mapping of int to str, optional
        Names of the stages that fitted each, by `id` of the quality.
    """
    whole, made = pooled(qualities), []
    for name, together in whole.items():
        alike = [each for each in qualities if each.channel == name]
        table = Table(
            name,
            (
                Column("run", wrap=True),
                Column("maneuver", of="pf"),
                Column("role", of="pf"),
                Column("channel", of="pf"),
                Column("start", key="initial_state"),
                Column("ignored"),
                Column("samples", ",d", "1", of="pf"),
                Column("RMSE", ".3g", key="rmse"),
                UNIT,
                Column("NRMSE", ".3g", "1", none="-", key="nrmse"),
                Column("fit %", ".2f", "1", none="-", key="fit_percent"),
                Column("R²", ".4f", "1", none="-", key="r_squared"),
                Column("residuals_correlated_s", ".2g", "1", of="f"),
                Column("correlation_with_input", "+.2f", "1", of="f"),
                Column("correlation_band", ".2f", "1", of="f"),
                Column("correlation_lag_s", "+.2f", "1", of="f"),
            ),
        )
        unit = alike[0].experiment[name].unit
        for each in alike:
            run, test = each.experiment, each.test
            tested: tuple[float | None, ...] = (None,) * 4
            if test is not None:
                tested = (test.duration, test.peak[1], test.band, test.peak[0])
            table.add(
                *(run.name, run.maneuver, run.role, name, start_words(run)),
                Cell(
                    "; ".join(f"{a:.6g} to {b:.6g} s" for a, b in ignored_windows(run[name])),
                    ignored_words(run, run[name]),
                ),
                *_measures(each.measures),
                *tested,
                unit=unit,
            )
        if len(alike) > 1:
            cells = ("all", "", "", name, "", "", *_measures(together), *(None,) * 4)
            table.add(*cells, unit=unit, total=True)
        made.append(table)
    return made


def _measures(found: Measures) -> tuple[float | None, ...]:
    return found.samples, found.rmse, found.nrmse, found.fit_percent, found.r_squared


def start_words(experiment: Experiment) -> str:
    """How a run's initial state comes about."""
    if experiment.start == "given" and experiment.start_pressure is not None:
        return f"given, {1e-5 * experiment.start_pressure:.4g} bar"
    return {"steady": "steady", "estimated": "pressure estimated"}.get(
        experiment.start, experiment.start
    )


def ignored_words(experiment: Experiment, channel: Channel) -> str:
    """What of a channel does not count, and why as far as the campaign says."""
    said = []
    for first, last in ignored_windows(channel):
        reasons = [why for a, b, why in experiment.ignored if why and a <= last and first <= b]
        why = f" ({listed(list(dict.fromkeys(reasons)))})" if reasons else ""
        # to the millisecond: jitter of the stamps is no information
        said.append(f"{round(first, 3) + 0.0:g} to {round(last, 3):g} s{why}")
    return "; ".join(said) or "nothing"


def residual_table(qualities: Sequence[RunQuality]) -> Table:
    """How long residuals stay correlated, and how far they follow the input."""
    made = Table(
        "Residuals: correlation with themselves and with the input",
        (
            Column("run", wrap=True),
            Column("role", of="p"),
            Column("channel"),
            Column("own", ".2g", "s"),
            Column("input", "+.2f"),
            Column(""),
            Column("95 % band", ".2f"),
            Column("lag", "+.2f", "s"),
            Column("verdict", of="p"),
        ),
    )
    for each in qualities:
        if (test := each.test) is None:
            continue
        lag, value = test.peak
        star = "*" if test.follows else ""
        run = each.experiment
        start = (run.name, run.role, each.channel, test.duration, value, star)
        made.add(*start, test.band, lag, test.verdict)
    return made


def criteria_table(verdict: Verdict) -> Table:
    """The acceptance criteria, those that are not met first, then those that were not judged."""
    columns = (Column("criterion", wrap=True), Column("value", "s"), Column("limit", "s"))
    made = Table("Acceptance criteria", (*columns, Column(""), Column("reason", of="p")))
    order = ("not met", "not judged", "met")
    for each in sorted(verdict.criteria, key=lambda each: order.index(each.state)):
        state = "NOT MET" if each.failure else each.state
        made.add(each.name, each.value, each.limit, state, each.reason, look=state != "met")
    return made


# --- cross-validation -----------------------------------------------------------------------------


def folds_tables(found: CrossValidation, assessments: Sequence[Assessment]) -> list[Table]:
    """Errors held out beside those of the fit to all runs, and the folds."""
    whole = pooled(with_speeds(each for stage in assessments for each in stage.runs))
    held_out = Table(
        "Cross-validation: each part predicted by a fit to the others",
        (
            Column("channel"),
            Column("fit %", ".2f", "1", none="-"),
            Column("RMSE held out", ".3g"),
            Column("RMSE fitted", ".3g", none=NONE),
            UNIT,
            Column("ratio", ".2f", "1", none=NONE),
            Column("R²", ".5f", "1", none=NONE, of="pf"),
            Column("samples", ",d", "1", of="pf"),
        ),
    )
    for name, measures in found.measures.items():
        fitted = whole[name].rmse if name in whole else None
        ratio = measures.rmse / fitted if fitted else None
        cells = (name, measures.fit_percent, measures.rmse, fitted, ratio, measures.r_squared)
        held_out.add(*cells, measures.samples, unit=found.units[name])
    columns = (Column("fold", "d"), Column("held out", wrap=True), Column("fit to the others"))
    folds = Table("Folds", (*columns, Column("fit % of those held out")))
    for fold in found.folds:
        state = "not fitted" if fold.failure else "converged" if fold.converged else "not converged"
        state = f"{state}; loses {', '.join(fold.lost)}" if fold.lost else state
        fits = (
            f"{name} {'-' if each.fit_percent is None else f'{each.fit_percent:.2f}'} %"
            for name, each in fold.measures.items()
        )
        folds.add(fold.number + 1, ", ".join(fold.held), state, ", ".join(fits) or NONE)
    return [held_out, folds]


# --- information of runs and of tests to come -----------------------------------------------------

_LETTERS = {"most": "#", "some": "+", "none": "."}


def outlook_table(look: Outlook, runs: Sequence[str]) -> Table:
    """What runs can tell of each unknown of a stage, one letter a run; in a file their shares."""
    made = Table(
        f"Stage {look.stage.name}",
        (
            Column("stage", of="f"),
            Column("parameter"),
            Column("needs", wrap=True),
            Column("effect", ".3g"),
            Column("runs"),
            *(Column(run, ".6g", of="f") for run in runs),
        ),
    )
    for name in look.names:
        letters = {run: _LETTERS[m] for run, m in zip(look.runs, look.marks(name), strict=True)}
        marks = "".join(letters.get(run, "-") for run in runs)
        shares = look.shares[:, look.linearised.variables.index(name)]
        parts = {run: float(share) for run, share in zip(look.runs, shares, strict=True)}
        cells = (look.need(name), look.effect(name), marks)
        made.add(look.stage.name, name, *cells, *(parts.get(run) for run in runs))
    return made


NAMED = 4
"""Unknowns that a row of advice names."""
WORTH = 1e-3
"""Relative gain below which none is shown."""


def advice_table(title: str, judged: Sequence[Advice]) -> Table:
    """Tests in the order given, what each would tell, and in a file all errors with it."""
    new = any(each.newly_determined for each in judged)
    made = Table(
        title,
        (
            Column("test", wrap=not new),
            Column("s", "g"),
            Column("first to determine", wrap=True, of="tpf" if new else ""),
            Column("gains most"),
            Column("better", "s"),
            *(Column(f"error of {gain.name}", ".6g", of="f") for gain in judged[0].gains),
        ),
    )
    for each in judged:
        first = ", ".join(each.newly_determined[:NAMED])
        more = len(each.newly_determined) - NAMED
        first = f"{first} + {more}" if more > 0 else first
        best, times = each.best, f"{each.d_gain:.2f}x" if each.d_gain > 1.0 + WORTH else ""
        gained = (
            "" if best is None else f"{best.name} {_error(best.before)} to {_error(best.after)}"
        )
        errors = (gain.after if isfinite(gain.after) else None for gain in each.gains)
        made.add(each.candidate, each.duration, first, gained, times, *errors)
    return made


def best_tests_table(gains: Sequence[Gain], best: Mapping[str, tuple[str, Gain]]) -> Table:
    """What is known of each unknown, and which test would tell most of it."""
    errors = (Column("error now", "s"), Column("then", "s"))
    made = Table(
        "For each parameter", (Column("parameter"), *errors, Column("best test", wrap=True))
    )
    for gain in gains:
        test, after = best.get(gain.name, ("no further information", gain))
        made.add(gain.name, _error(gain.before), _error(after.after), test)
    return made


def _error(error: float) -> str:
    return f"{100.0 * error:.2g} %" if error <= 1.0 else "-"


# --- sentences ------------------------------------------------------------------------------------


def scales_words(fit: StageFit) -> str:
    """What one unit of residual is, channel by channel."""
    parts = []
    for name, size in fit.problem.scales.items():
        having = next(each for each in fit.problem.experiments if name in each.channels)
        unit = display_unit(having[name].unit, size)
        parts.append(f"{plain(unit.factor * size, 3)} {unit.name} of {name}")
    return f"One unit of residual is {listed(parts)}."
