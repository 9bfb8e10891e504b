"""Tables of a fit: its estimates, what stayed fixed, errors of runs.

Each is made once; the terminal, the report's page and the files render it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import inf
from typing import NamedTuple

from swashplate.campaign import CURRENTS, Channel, Experiment
from swashplate.identification.estimation.drive_model import DriveModel, true_value
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.unknowns import Kind, Unknown
from swashplate.identification.noise import CONFIDENCE_LEVEL
from swashplate.identification.optimum import Interval, Optimum, Status
from swashplate.identification.statistics.determination import (
    GAUGES,
    bounds_reached,
    identifiability_of,
    without_value,
)
from swashplate.identification.statistics.intervals import Estimate, estimates_of, uncertainty_of
from swashplate.identification.statistics.profiles import Profile
from swashplate.identification.validation import (
    Measures,
    RunQuality,
    ignored_windows,
    pooled_measures,
)
from swashplate.parameters import CATALOGUE, COLUMNS, ParameterSet
from swashplate.tables import (
    NONE,
    UNIT,
    Cell,
    Column,
    Table,
    count,
    joined,
    listed,
    percent,
    plain,
    spread,
)
from swashplate.units import chosen_unit, display_unit

# --- parameters -----------------------------------------------------------------------------------


def estimates_table(
    fit: Optimum,
    *,
    truth: ParameterSet | None = None,
    own: bool = False,
) -> Table:
    """Estimates of a fit with their intervals.

    `truth` is what virtual tests were simulated with; with `own` the unknowns of single runs are
    meant, instead of those of the machine.
    """
    unknowns = fit.problem.unknowns
    # in terminal, page and file, or nowhere
    truth_shown_in = "" if truth is None else "tpf"
    ends = f"{100.0 * CONFIDENCE_LEVEL:g} %"
    table = Table(
        "Estimates",
        (
            Column("parameter"),
            Column("meaning", of="p"),
            UNIT if truth is None else Column("unit", of="pf"),
            Column("nominal", ".5g"),
            Column("estimate", ".5g", key="value"),
            Column("change", "s", of="p"),
            Column("truth", ".5g", of=truth_shown_in),
            Column("holds", of=truth_shown_in),
            Column(f"lower {ends}", ".5g", none=NONE, key="lower"),
            Column(f"upper {ends}", ".5g", none=NONE, key="upper"),
            Column("half width", "s", of="p"),
            Column("standard error", ".5g", of="f", key="standard_error"),
            Column("status", of="pf"),
        ),
        si=True,
    )
    for unknown, estimate in zip(unknowns, estimates_of(fit), strict=True):
        if (unknown.run is None) == own:
            continue
        value = estimate.value
        low, high = estimate.interval
        factor = chosen_unit(unknown.unit).factor
        true = None
        holds = ""
        if truth is not None:
            assert isinstance(fit.problem.model, DriveModel)
            true = true_value(unknown, fit.problem.model, truth)
        texts: Sequence[str] = (f"{factor * value:.5g}", *estimate.ends(factor))
        if low is not None and high is not None:
            texts = spread(factor * value, factor * low, factor * high)
        if true is not None and (low, high) != (None, None):
            inside = (-inf if low is None else low) <= true <= (inf if high is None else high)
            holds = "yes" if inside else "no"
        table.add(
            estimate.name,
            meaning_of(unknown, fit),
            *(() if truth is None else (Cell(unknown.unit, chosen_unit(unknown.unit).name),)),
            unknown.start,
            Cell(value, texts[0]),
            "" if own else percent(value - unknown.start, unknown.start, sign=True),
            true,
            holds,
            Cell(low, texts[1]),
            Cell(high, texts[2]),
            _half_width(value, low, high),
            estimate.standard_error,
            estimate.status,
            unit=unknown.unit,
            look=estimate.status != "estimated",
        )
    return table


def _half_width(value: float, low: float | None, high: float | None) -> str:
    """Half of an interval in per cent of the value, which means nothing about 0."""
    if low is None or high is None:
        return NONE
    return "includes 0" if low < 0.0 < high else f"±{percent(0.5 * (high - low), value)}"


def profiles_table(profiles: Sequence[Profile], fit: Optimum) -> Table:
    """Ends of the intervals of profile likelihoods; none if the cost does not rise enough."""
    ends = f"{100.0 * CONFIDENCE_LEVEL:g} %"
    table = Table(
        "Profile likelihoods, of the noise alone",
        (
            Column("parameter"),
            UNIT,
            Column("estimate", ".5g"),
            Column(f"lower {ends}", ".5g", none=NONE),
            Column(f"upper {ends}", ".5g", none=NONE),
        ),
        si=True,
    )
    for profile in profiles:
        unknown = fit.problem.unknowns.items[profile.index]
        lower = profile.lower
        upper = profile.upper
        if profile.better is not None:  # of a point that is not the optimum there is no interval
            lower = upper = None
        table.add(
            profile.name,
            unknown.to_value(float(fit.solution.vector[profile.index])),
            None if lower is None else unknown.to_value(lower),
            None if upper is None else unknown.to_value(upper),
            unit=unknown.unit,
        )
    return table


def estimates_by_name(fit: Optimum) -> dict[str, Estimate]:
    """Every number of a fit by its name: what was estimated, then what stayed fixed.

    A parameter that is tied in both directions is there by its symbol and by both columns.
    """
    by_name: dict[str, Estimate] = {}
    for unknown, estimate in zip(fit.problem.unknowns, estimates_of(fit), strict=True):
        by_name[estimate.name] = estimate
        if unknown.run is None:
            by_name.update(dict.fromkeys(unknown.targets, estimate))
    parameters, estimated = fit.parameters, _estimated_columns(fit)
    for name, value in parameters.numbers.items():
        if isinstance(parameters, ModelSetup):
            unit = parameters.definition(name).unit
        else:
            unit = parameters[name].unit
        status: Status = "from the forces" if name in estimated else "fixed"
        by_name.setdefault(name, Estimate(name, value, unit, source=Interval(status)))
    return by_name


def all_estimates(fit: Optimum) -> Table:
    """One table of what was estimated: of the machine, then of single runs."""
    return joined([estimates_table(fit, own=own) for own in (False, True)])


def truth_count(table: Table) -> tuple[int, int]:
    """How many intervals of a table with a truth contain it, and of how many."""
    names = [column.name for column in table.columns]
    answers = [row.cells[names.index("holds")] for row in table.rows]
    holding = answers.count("yes")
    return holding, holding + answers.count("no")


MEANINGS: Mapping[Kind, str] = {
    "start": "number of the state at the first sample",
    "start pressure": "stroking pressure at the first sample",
    "start current": "current of the card at the first sample",
    "instant": "instant of the command's jump, after the middle of both samples",
}
"""Meanings of unknowns of single runs."""


def meaning_of(unknown: Unknown, fit: Optimum) -> str:
    """Meaning of an unknown, in words; empty if it has none."""
    if unknown.kind == "parameter":
        # names of a user-defined model are its own
        return "" if fit.setup.part == "model" else meaning_of_parameter(unknown.name)
    if unknown.kind == "zero":
        return f"free zero of {unknown.channel}"
    if unknown.kind == "force":
        assert fit.setup.forces is not None
        current = fit.setup.forces.currents[unknown.name]
        direction = "positive" if current > 0.0 else "negative"
        return f"solenoid force {abs(current):g} A beyond the dead zone, {direction}"
    return MEANINGS[unknown.kind]


def meaning_of_parameter(name: str) -> str:
    """Meaning of a parameter, by its symbol or column; empty if there is no such parameter."""
    definition = CATALOGUE.get(COLUMNS.get(name, name))
    if definition is None:
        return ""
    side = name.rpartition("_")[2]
    direction = {"plus": ", positive", "minus": ", negative"}.get(side, "")
    return definition.name + (direction if definition.directional else "")


def _estimated_columns(fit: Optimum) -> set[str]:
    """Columns of the drive's parameters that are estimated, those of its forces included."""
    estimated = {target for unknown in fit.problem.unknowns for target in unknown.targets}
    return estimated.union(fit.setup.forces.columns if fit.setup.forces else ())


def _is_estimated(symbol: str, estimated: Collection[str]) -> bool:
    return any(column in estimated for column in (symbol, f"{symbol}_plus", f"{symbol}_minus"))


def fixed_table(fit: Optimum, truth: ParameterSet | None = None) -> Table:
    """The parameters that are not estimated; `truth` as it is, in no other scales."""
    table = Table(
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
    estimated = _estimated_columns(fit)
    parameters = fit.parameters
    if isinstance(parameters, ModelSetup):
        for name, value in parameters.numbers.items():
            if name not in estimated:
                definition = parameters.definition(name)
                reason = "given with the machine"
                table.add(name, definition.name, value, None, reason, "", unit=definition.unit)
        return table
    for column, symbol in COLUMNS.items():
        if column in estimated:
            continue
        parameter, value = parameters[symbol], parameters.numbers[column]
        reason = ""
        if value == 0.0:
            reason = "0: this effect is left out"
        if parameter.status == "inactive":
            reason = "inactive: no test reaches it"
        for gauge in GAUGES[::-1]:
            fixed = next((name for name in gauge.fix if not _is_estimated(name, estimated)), None)
            others = [
                name
                for name in gauge.derivatives
                if name != symbol and _is_estimated(name, estimated)
            ]
            if fixed == symbol and others:
                reason = f"fixes the {gauge.name}: {gauge.determined}"
        table.add(
            column,
            meaning_of_parameter(column),
            value,
            None if truth is None else truth.numbers[column],
            reason,
            parameter.source,
            unit=parameter.unit,
        )
    return table


def fixed_line(fit: Optimum) -> str:
    """The symbols that kept their nominal values, in a sentence."""
    estimated = _estimated_columns(fit)
    plain_names = (n.removesuffix("_plus").removesuffix("_minus") for n in fit.nominal.numbers)
    fixed = [name for name in dict.fromkeys(plain_names) if not _is_estimated(name, estimated)]
    return f"Fixed at their nominal values: {', '.join(fixed) or 'none'}."


def unvalued_lines(fit: Optimum) -> list[str]:
    """A sentence on the parameters without a value of their own, if there are any."""
    lost = without_value(fit)
    if not lost:
        return []
    return [
        f"Not estimated (at a bound or not determined): {listed(lost)}. Fix them in the fit setup, "
        "widen their bounds, or add tests that determine them; for a drive 'swashplate advise' "
        "names some."
    ]


def scales_words(fit: Optimum) -> str:
    """Sentence on the unit of the residuals of each channel."""
    parts = []
    for name, size in fit.problem.scales.items():
        having = next(run for run in fit.problem.experiments if name in run.channels)
        unit = display_unit(having[name].shown_unit, size)
        parts.append(f"{plain(unit.factor * size, 3)} {unit.name} of {name}")
    return f"One unit of residual is {listed(parts)}."


# --- runs -----------------------------------------------------------------------------------------


def runs_tables(qualities: Sequence[RunQuality]) -> list[Table]:
    """Errors of each run that was fitted, or predicted: a table for each channel.

    All of its runs together are in the last row.
    """
    tables = []
    for name, together in pooled_measures(qualities).items():
        of_channel = [quality for quality in qualities if quality.channel == name]
        table = Table(
            name,
            (
                Column("run", wrap=True),
                Column("maneuver", of="pf"),
                Column("role", of="pf"),
                Column("channel", of="pf"),
                Column("start", key="initial_state"),
                Column("ignored", wrap=True),
                Column("samples", ",d", "1", of="pf"),
                Column("RMSE", ".3g", key="rmse"),
                UNIT,
                Column("NRMSE", ".3g", "1", none="-", key="nrmse"),
                Column("fit %", ".2f", "1", none="-", key="fit_percent"),
                Column("residuals_correlated_s", ".2g", "1", of="f"),
                Column("correlation_with_input", "+.2f", "1", of="f"),
                Column("correlation_band", ".2f", "1", of="f"),
                Column("correlation_lag_s", "+.2f", "1", of="f"),
            ),
        )
        unit = of_channel[0].experiment[name].shown_unit
        for quality in of_channel:
            run, test = quality.experiment, quality.test
            tested: tuple[float | None, ...] = (None,) * 4
            if test is not None:
                tested = (test.duration, test.peak[1], test.band, test.peak[0])
            windows = [f"{a:.6g} to {b:.6g} s" for a, b in ignored_windows(run[name])]
            table.add(
                run.name,
                run.maneuver,
                run.role,
                name,
                start_words(run),
                Cell("; ".join(windows), ignored_words(run, run[name])),
                *_measures(quality.measures),
                *tested,
                unit=unit,
            )
        if len(of_channel) > 1:
            cells = ("all", "", "", name, "", "", *_measures(together), *(None,) * 4)
            table.add(*cells, unit=unit, total=True)
        tables.append(table)
    return tables


def _measures(measures: Measures) -> tuple[float | None, ...]:
    return measures.samples, measures.rmse, measures.nrmse, measures.fit_percent


def start_words(experiment: Experiment) -> str:
    """Source of a run's initial state, in words."""
    if experiment.start == "given" and experiment.start_pressure is not None:
        return f"given, {1e-5 * experiment.start_pressure:.4g} bar"
    return "pressure estimated" if experiment.start == "estimated" else experiment.start


def ignored_words(experiment: Experiment, channel: Channel) -> str:
    """What of a channel does not count, and why as far as the campaign says."""
    windows = []
    for first, last in ignored_windows(channel):
        reasons = [
            reason
            for begin, end, reason in experiment.ignored
            if reason and begin <= last and first <= end
        ]
        reason = f" ({listed(list(dict.fromkeys(reasons)))})" if reasons else ""
        # to the millisecond: jitter of the stamps is not information
        windows.append(f"{round(first, 3) + 0.0:g} to {round(last, 3):g} s{reason}")
    return "; ".join(windows) or "nothing"


# --- a fit as it is read --------------------------------------------------------------------------


class FitPart(NamedTuple):
    """A part of what a fit says, as the command, a summary and a notebook show it."""

    title: str
    """Of the part in a notebook."""
    tables: Sequence[Table] = ()
    remarks: Sequence[str] = ()
    """Lines below the tables,"""
    sentences: Sequence[str] = ()
    """and a list below these."""
    heading: str = ""
    """Line above the tables if they do not say what they are of."""
    opened: bool = False
    """Whether a notebook shows its tables without being asked."""

    def __str__(self) -> str:
        listing = (f"- {sentence}" for sentence in self.sentences)
        lines = "\n".join([*self.remarks, *listing])
        blocks = [self.heading, *(str(table) for table in self.tables), lines]
        return "\n\n".join(block for block in blocks if block)


def estimates_part(fit: Optimum) -> FitPart:
    """Estimates, how the search ended, and what the estimates lack."""
    solution = fit.solution
    # what priors and tests say together determines every number: the former are told instead
    determined: Sequence[str] = identifiability_of(fit).sentences()
    if fit.setup.has_spreads:
        determined = together_lines(fit)
    return FitPart(
        "Convergence, and validity of the intervals",
        [estimates_table(fit)],
        [f"Search: {solution.message} after {solution.evaluations} evaluations."],
        [
            *determined,
            *uncertainty_of(fit).sentences(),
            *bounds_reached(fit),
        ],
        opened=True,
    )


def together_lines(fit: Optimum) -> list[str]:
    """That numbers which are near those of a named drive were estimated together, and why."""
    lines = [
        "Each number is taken to be near that of the drive that the fit began with, and all are "
        "estimated together: a prediction uses what the tests show of them in common."
    ]
    if not any(run.of_kind(*CURRENTS) for run in fit.problem.experiments):
        lines.append(
            "No current was measured, so that the tests cannot tell the amplifier's numbers from "
            "the solenoids': only what they do together is known."
        )
    return lines


def fixed_part(fit: Optimum) -> FitPart:
    """What stayed as it was, and what has no value of its own."""
    return FitPart("Fixed parameters", (), [fixed_line(fit)], unvalued_lines(fit))


def single_runs_line(fit: Optimum) -> list[str]:
    """A sentence on the numbers of single runs, which no table for people shows, if any."""
    names = [unknown.label for unknown in fit.problem.unknowns if unknown.run is not None]
    if not names:
        return []
    numbers = count(len(names), "number of a single run", "numbers of single runs")
    return [f"Estimated, too: {numbers}, such as {names[0]}; all are in to_pandas()."]
