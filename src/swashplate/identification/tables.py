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
from swashplate.identification.estimation.stages import Parameters
from swashplate.identification.estimation.unknowns import Kind, Unknown
from swashplate.identification.noise import CONFIDENCE_LEVEL
from swashplate.identification.stage_fit import Interval, StageFit, Status
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
    stage: StageFit,
    *,
    truth: ParameterSet | None = None,
    own: bool = False,
) -> Table:
    """Estimates of a stage with their intervals.

    `truth` is what virtual tests were simulated with; with `own` the unknowns of single runs are
    meant, instead of those of the machine.
    """
    unknowns = stage.problem.unknowns
    # in terminal, page and file, or nowhere
    truth_shown_in = "" if truth is None else "tpf"
    ends = f"{100.0 * CONFIDENCE_LEVEL:g} %"
    table = Table(
        f"Stage {stage.stage.name}",
        (
            Column("stage", of="f"),
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
    for unknown, estimate in zip(unknowns, estimates_of(stage), strict=True):
        if (unknown.run is None) == own:
            continue
        value = estimate.value
        low, high = estimate.interval
        factor = chosen_unit(unknown.unit).factor
        true = None
        holds = ""
        if truth is not None:
            assert isinstance(stage.problem.model, DriveModel)
            true = true_value(unknown, stage.problem.model, truth)
        texts: Sequence[str] = (f"{factor * value:.5g}", *estimate.ends(factor))
        if low is not None and high is not None:
            texts = spread(factor * value, factor * low, factor * high)
        if true is not None and (low, high) != (None, None):
            inside = (-inf if low is None else low) <= true <= (inf if high is None else high)
            holds = "yes" if inside else "no"
        table.add(
            stage.stage.name,
            estimate.name,
            meaning_of(unknown, stage),
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


def profiles_table(profiles: Sequence[Profile], stages: Sequence[StageFit]) -> Table:
    """Ends of the intervals of profile likelihoods; none if the cost does not rise enough."""
    stage_of = {stage.stage.name: stage for stage in stages}
    ends = f"{100.0 * CONFIDENCE_LEVEL:g} %"
    table = Table(
        "Profile likelihoods, of the noise alone",
        (
            Column("stage"),
            Column("parameter"),
            UNIT,
            Column("estimate", ".5g"),
            Column(f"lower {ends}", ".5g", none=NONE),
            Column(f"upper {ends}", ".5g", none=NONE),
        ),
        si=True,
    )
    for profile in profiles:
        stage = stage_of[profile.stage]
        unknown = stage.problem.unknowns.items[profile.index]
        lower = profile.lower
        upper = profile.upper
        if profile.better is not None:  # of a point that is not the optimum there is no interval
            lower = upper = None
        table.add(
            profile.stage,
            profile.name,
            unknown.to_value(float(stage.solution.vector[profile.index])),
            None if lower is None else unknown.to_value(lower),
            None if upper is None else unknown.to_value(upper),
            unit=unknown.unit,
        )
    return table


def estimates_by_name(stages: Sequence[StageFit]) -> dict[str, Estimate]:
    """Every number of a fit by its name: the estimates of each stage, then what stayed fixed.

    A parameter that is tied in both directions is there by its symbol and by both columns.
    """
    by_name: dict[str, Estimate] = {}
    for stage in stages:
        for unknown, estimate in zip(stage.problem.unknowns, estimates_of(stage), strict=True):
            by_name[estimate.name] = estimate
            if unknown.run is None:
                by_name.update(dict.fromkeys(unknown.targets, estimate))
    parameters, estimated = stages[-1].parameters, _estimated_columns(stages)
    for name, value in parameters.numbers.items():
        unit = "" if isinstance(parameters, ModelSetup) else parameters[name].unit
        status: Status = "from the forces" if name in estimated else "fixed"
        by_name.setdefault(name, Estimate(name, value, unit, source=Interval(status)))
    return by_name


def all_estimates(stages: Sequence[StageFit]) -> Table:
    """One table of what all stages estimated: of the machine, then of single runs."""
    return joined([estimates_table(stage, own=own) for stage in stages for own in (False, True)])


def truth_count(tables: Sequence[Table]) -> tuple[int, int]:
    """How many intervals of tables with a truth contain it, and of how many."""
    names = [column.name for column in tables[0].columns]
    answers = [row.cells[names.index("holds")] for table in tables for row in table.rows]
    holding = answers.count("yes")
    return holding, holding + answers.count("no")


MEANINGS: Mapping[Kind, str] = {
    "start": "number of the state at the first sample",
    "start pressure": "stroking pressure at the first sample",
    "start current": "current of the card at the first sample",
    "instant": "instant of the command's jump, after the middle of both samples",
}
"""Meanings of unknowns of single runs."""


def meaning_of(unknown: Unknown, stage: StageFit) -> str:
    """Meaning of an unknown, in words; empty if it has none."""
    if unknown.kind == "parameter":
        # names of a user-defined model are its own
        return "" if stage.stage.part == "model" else meaning_of_parameter(unknown.name)
    if unknown.kind == "zero":
        return f"free zero of {unknown.channel}"
    if unknown.kind == "force":
        assert stage.stage.forces is not None
        current = stage.stage.forces.currents[unknown.name]
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


def _estimated_columns(stages: Sequence[StageFit]) -> set[str]:
    """Columns of the drive's parameters that some stage estimates, its forces included."""
    problems = [stage.problem for stage in stages]
    estimated = {
        target for problem in problems for unknown in problem.unknowns for target in unknown.targets
    }
    forces = [problem.model.forces for problem in problems if isinstance(problem.model, DriveModel)]
    return estimated.union(*(force.columns for force in forces if force is not None))


def _is_estimated(symbol: str, estimated: Collection[str]) -> bool:
    return any(column in estimated for column in (symbol, f"{symbol}_plus", f"{symbol}_minus"))


def fixed_table(stages: Sequence[StageFit], truth: ParameterSet | None = None) -> Table:
    """The parameters that no stage estimates; `truth` as it is, in no other scales."""
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
    estimated = _estimated_columns(stages)
    parameters = stages[-1].parameters
    if isinstance(parameters, ModelSetup):
        for name, value in parameters.numbers.items():
            if name not in estimated:
                table.add(name, "", value, None, "given with the model", "")
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


def fixed_line(stages: Sequence[StageFit], nominal: Parameters) -> str:
    """The symbols that kept their nominal values, in a sentence."""
    estimated = _estimated_columns(stages)
    plain_names = (n.removesuffix("_plus").removesuffix("_minus") for n in nominal.numbers)
    fixed = [name for name in dict.fromkeys(plain_names) if not _is_estimated(name, estimated)]
    return f"Fixed at their nominal values: {', '.join(fixed) or 'none'}."


def unvalued_lines(stages: Sequence[StageFit]) -> list[str]:
    """A sentence on the parameters without a value of their own, if there are any."""
    lost = [name for stage in stages for name in without_value(stage)]
    if not lost:
        return []
    return [
        f"Not estimated (at a bound or not determined): {listed(lost)}. Fix them in the fit setup, "
        "widen their bounds, or add tests that determine them; for a drive 'swashplate advise' "
        "names some."
    ]


def scales_words(fit: StageFit) -> str:
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


def stage_part(stage: StageFit) -> FitPart:
    """Estimates of a stage, how it ended, and what its estimates lack."""
    name, solution = stage.stage.name, stage.solution
    # what priors and tests say together determines every number: the former are told instead
    determined: Sequence[str] = identifiability_of(stage).sentences()
    if stage.stage.has_spreads:
        determined = together_lines(stage)
    return FitPart(
        f"Convergence of stage {name}, and validity of its intervals",
        [estimates_table(stage)],
        [f"{name}: {solution.message} after {solution.evaluations} evaluations."],
        [
            *determined,
            *uncertainty_of(stage).sentences(),
            *bounds_reached(stage),
        ],
        opened=True,
    )


def together_lines(stage: StageFit) -> list[str]:
    """That numbers which are near those of a named drive were estimated together, and why."""
    lines = [
        "Each number is taken to be near that of the drive that the fit began with, and all are "
        "estimated together: a prediction uses what the tests show of them in common."
    ]
    if not any(run.of_kind(*CURRENTS) for run in stage.problem.experiments):
        lines.append(
            "No current was measured, so that the tests cannot tell the amplifier's numbers from "
            "the solenoids': only what they do together is known."
        )
    return lines


def fixed_part(stages: Sequence[StageFit], nominal: Parameters) -> FitPart:
    """What stayed as it was, and what has no value of its own."""
    return FitPart("Fixed parameters", (), [fixed_line(stages, nominal)], unvalued_lines(stages))


def single_runs_line(stages: Sequence[StageFit]) -> list[str]:
    """A sentence on the numbers of single runs, which no table for people shows, if any."""
    unknowns = [unknown for stage in stages for unknown in stage.problem.unknowns]
    names = [unknown.label for unknown in unknowns if unknown.run is not None]
    if not names:
        return []
    numbers = count(len(names), "number of a single run", "numbers of single runs")
    return [f"Estimated, too: {numbers}, such as {names[0]}; all are in to_pandas()."]
