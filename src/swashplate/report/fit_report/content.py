"""Content of a report: the sections of a fit's page and of a validation's, from the results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from itertools import combinations
from math import inf
from pathlib import Path

from markupsafe import Markup

from swashplate.analysis import key_numbers as key_numbers_of
from swashplate.campaign import Campaign, Overview, WeightWindow, examine, quality_table
from swashplate.drive import Drive, KeyNumbers
from swashplate.errors import InputError
from swashplate.identification import (
    Fit,
    Identifiability,
    Identification,
    ModelSetup,
    Optimum,
    Profile,
    RunQuality,
    Solution,
    Verdict,
    assess_fit,
    at_instants,
    estimates_table,
    fixed_table,
    identifiability_of,
    motion_of,
    percent,
    runs_tables,
    scales_words,
    truth_count,
    uncertainty_of,
)
from swashplate.identification.estimation import Parameters
from swashplate.parameters import ParameterSet
from swashplate.report.fit_report import charts
from swashplate.report.fit_report.html_page import (
    PageBlock,
    Section,
    listed_block,
    page,
    text,
    titled,
)
from swashplate.report.fit_report.live import can_run, drive_on_page, live_page, run_of
from swashplate.report.fit_report.runs import ShownRun, measures_line, run_data, shown_runs
from swashplate.report.fit_report.summary import light, run_error, run_lights, summary_section
from swashplate.tables import NONE, Cell, Column, Table, count, ended, joined, listed, write_text
from swashplate.units import chosen_unit, show_rod, shown_in, unit_text

MOST_PAIRS = 12
"""Correlations that are listed."""
NO_FINDINGS = "The check of the logs has no findings."
_PARTS = {
    "card": "the control card alone, from the command to the currents",
    "pump": "pump and motor, driven by the current",
    "chain": "card, pump and motor, from the command to the speed",
    "model": "a user-defined model, from its inputs to its channels",
}


def write_fit_report(
    result: Identification, path: str | Path, *, truth: ParameterSet | None = None
) -> None:
    """Write the report of a fit: one HTML file, whole or not at all, that needs no network.

    Parameters
    ----------
    result : Identification
        The fit, its campaign, and what was found out about it.
    path : path
        The file, which replaces an older one.
    truth : ParameterSet, optional
        Parameters of which virtual tests were simulated, to show next to the estimates.

    Raises
    ------
    FileError
        If the file cannot be written.

    Notes
    -----
    The page holds what the eye can tell of every run, a few bytes a sample (`runs.run_data`): it
    grows with the number of runs, not with their length.
    """
    fit = result.fit
    runs = shown_runs(fit, result.predicted)
    held_out = sum(run.role == "validate" for run in runs)
    facts = (
        f"{count(len(runs) - held_out, 'run')} fitted, {held_out} held out · "
        f"{count(fit.problem.samples, 'sample')} that count"
    )
    with _units_of_people():
        if motion_of(run.experiment for run in runs) == "rod":
            show_rod()
        sections = [
            _live_section(fit, result.campaign, runs),
            _parameter_section(fit, truth),
            _identifiability_section(fit),
            _profile_section(fit, result.profiles),
            _starts_section(fit.starts),
        ]
        setup = _setup_section(result.campaign, fit.nominal, fit.setup.title, result.notes, fit)
        page = _page(
            "Fit",
            facts,
            result.campaign,
            fit,
            runs,
            result.verdict,
            setup,
            sections,
            key_numbers=result.key_numbers,
            folder=Path(path).parent,
        )
    write_text(page, path)


def write_validation_report(
    drive: Parameters,
    campaign: Campaign,
    path: str | Path,
    predicted: Sequence[RunQuality],
    *,
    verdict: Verdict | None = None,
    notes: Mapping[str, str] | None = None,
    key_numbers: KeyNumbers | None = None,
) -> None:
    """Write the report of a validation: one HTML file, whole or not at all, without network.

    Parameters
    ----------
    drive : ParameterSet or ModelSetup
        The drive, or the user-defined model, that was held against the runs.
    campaign : Campaign
        The tests.
    path : path
        The file, which replaces an older one.
    predicted : sequence of RunQuality
        At least one, as `validation.predict` gives them.
    verdict : Verdict, optional
        The verdict; made here by default.
    notes : mapping of str to str, optional
        What belongs to the report besides.
    key_numbers : KeyNumbers, optional
        The numbers that matter of the drive, with the intervals of its fit; by default without.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    runs = shown_runs(None, predicted)
    samples = sum(prediction.measures.samples for prediction in predicted)
    facts = (
        f"{count(len(runs), 'run')} predicted from the command alone · "
        f"{count(samples, 'sample')} that count"
    )
    assessed = verdict if verdict is not None else assess_fit(None, predicted)
    setup = _setup_section(campaign, drive, "", notes or {}, None)
    if key_numbers is None and isinstance(drive, ParameterSet):
        key_numbers = key_numbers_of(Drive(drive))
    content = _page(
        "Validation",
        facts,
        campaign,
        drive,
        runs,
        assessed,
        setup,
        key_numbers=key_numbers,
        folder=Path(path).parent,
    )
    write_text(content, path)


def _units_of_people() -> AbstractContextManager[None]:
    """Parameters in mm, bar and degrees rather than SI, if no units were chosen."""
    usual = {"m": "mm", "Pa": "bar", "rad": "deg"}
    return shown_in([unit for si, unit in usual.items() if chosen_unit(si).name == unit_text(si)])


def _page(
    what: str,
    facts: str,
    campaign: Campaign,
    fitted: Fit | Parameters,
    runs: Sequence[ShownRun],
    verdict: Verdict,
    setup: Section,
    other_sections: Sequence[Section] = (),
    *,
    key_numbers: KeyNumbers | None,
    folder: Path,
) -> str:
    """A page of a fit, which has sections of its own, or of a drive held against runs."""
    fit = fitted if isinstance(fitted, Fit) else None
    nominal = fitted.nominal if isinstance(fitted, Fit) else fitted
    named = f"{'Model' if isinstance(nominal, ModelSetup) else 'Drive'} {nominal.name}"
    if isinstance(nominal, ParameterSet) and nominal.title:
        named += f" ({nominal.title})"
    axes = {run.experiment.axis for run in runs}
    examined = {
        experiment: examine(experiment) for experiment in campaign if experiment.axis in axes
    }
    findings: dict[str, list[int]] = {}
    sentences = list[str]()
    for run, qualities in examined.items():
        for signal in qualities:
            for finding in signal.findings:
                sentences.append(ended(f"{run.name}, {signal.signal}: {finding}"))
                findings.setdefault(run.name, []).append(len(sentences))
    quality = joined(
        [quality_table(run_qualities, of_run) for run_qualities, of_run in examined.items()]
    )
    sections = [
        summary_section(verdict, campaign, key_numbers, fit, runs, len(sentences), folder=folder),
        _agreement_section(runs, findings, verdict),
        _curves_section(runs, campaign.virtual),
        *other_sections,
        _residual_section(runs),
        _verdict_section(verdict, len(sentences)),
        _data_section(sentences, quality, campaign.overviews),
        setup,
    ]
    return page(
        sections,
        what=what,
        title=campaign.title,
        facts=f"{named} · {facts}",
        virtual=campaign.virtual,
        run_data=map(run_data, runs),
    )


# --- runs -----------------------------------------------------------------------------------------


def _qualities(runs: Sequence[ShownRun], role: str = "") -> list[RunQuality]:
    """Qualities of all channels of the runs, or of the runs of a role."""
    qualities = list[RunQuality]()
    for run in runs:
        if role in ("", run.role):
            qualities += [channel.quality for channel in run.channels]
    return qualities


def _agreement_section(
    runs: Sequence[ShownRun], findings: dict[str, list[int]], verdict: Verdict
) -> Section:
    columns = (
        Column(""),
        Column("run"),
        Column("role"),
        Column("maneuver"),
        Column("judged by"),
        Column("error / range", "s", none=NONE),
        Column("why"),
        Column("findings"),
    )
    overview = Table("", columns)
    lights = run_lights(runs, findings, verdict)
    for number, (run, (look, why)) in enumerate(zip(runs, lights, strict=True)):
        error_share = run_error(run, runs)
        to_curves = Markup('<a href="#run-{}">{}</a>').format(number, run.name)
        links = Markup(" ").join(
            Markup('<a href="#finding-{0}">{0}</a>').format(finding_number)
            for finding_number in findings.get(run.experiment.name, [])
        )
        overview.add(
            light(look, why),
            to_curves,
            run.role,
            run.experiment.maneuver,
            run.judged.channel,
            None if error_share == inf else Cell(error_share, percent(error_share)),
            why,
            links,
            look=look != "good",
        )
    agreement = [
        *runs_tables(_qualities(runs, "fit")),
        *runs_tables(_qualities(runs, "validate")),
    ]
    explanation = (
        "RMSE is the root of the mean squared difference of the samples that count; NRMSE is RMSE "
        "over the standard deviation of what was measured; fit % is 100 (1 − NRMSE). Error / "
        "range is RMSE over the largest minus the smallest value measured in all runs of that "
        "role."
    )
    measures = PageBlock("table", joined(agreement), "agreement")
    blocks = [
        PageBlock("table", overview, "overview"),
        PageBlock("details", [text(explanation), measures], "Measures of every channel"),
    ]
    return Section("agreement", "Runs", blocks)


def _curves_section(runs: Sequence[ShownRun], virtual: bool) -> Section:
    measured = "virtual test" if virtual else "measured"
    explanation = (
        "Drag to zoom in time, Ctrl and wheel to zoom about the pointer, double-click for all of "
        f"it. Residuals are simulated minus {measured}. Grey stretches are ignored."
    )
    blocks = [text(explanation, "screen")]
    for number, run in enumerate(runs):
        measures = [
            (channel.quality.channel, measures_line(channel.quality)) for channel in run.channels
        ]
        content = {"number": number, "run": run, "measures": measures, "measured": measured}
        blocks.append(PageBlock("run", content))
    return Section("runs", "Curves", blocks)


def _live_section(fit: Fit, campaign: Campaign, runs: Sequence[ShownRun]) -> Section:
    """The fitted drive with sliders for its parameters, next to the run with the largest error.

    The run is one of those held out if there are any. The section is empty for a user-defined model
    and for a drive that cannot run in the page.
    """
    section = Section("live", "Try other values", [])
    if not (isinstance(fit.parameters, ParameterSet) and isinstance(fit.nominal, ParameterSet)):
        return section
    drive = _with_fit_statuses(fit.parameters, fit.nominal)
    held_out = [run for run in runs if run.role == "validate"]
    worst_run = max(held_out or runs, key=lambda run: run_error(run, runs)).experiment
    if not can_run(drive, worst_run):
        return section
    run = run_of(at_instants(drive, worst_run))
    machine = drive_on_page(drive, run["step"], "drive.toml")
    page = live_page(machine, [run], campaign.title, virtual=campaign.virtual)
    caption = f"Sliders for every parameter, next to {worst_run.name}"
    return replace(section, blocks=[PageBlock("live", page, caption)])


def _with_fit_statuses(fitted: ParameterSet, nominal: ParameterSet) -> ParameterSet:
    """The fitted set with the status "fitted" for parameters that differ from the nominal ones."""
    parameters = {}
    for symbol, parameter in fitted.parameters.items():
        initial = nominal.parameters.get(symbol)
        is_fixed = initial is not None and initial.values == parameter.values
        parameters[symbol] = replace(parameter, status="fixed" if is_fixed else "fitted")
    return replace(fitted, parameters=parameters)


def _residual_section(runs: Sequence[ShownRun]) -> Section:
    explanation = (
        "Correlation of the residuals with the input, positive lags where the residual comes "
        "after it, and the 95 % band of residuals, coloured as these are, that are unrelated to "
        "it."
    )
    heads = ("run", "role", "channel", "correlation with the input")
    table = Table("", tuple(map(Column, (*heads, "verdict"))))
    for quality in _qualities(runs):
        if (test := quality.test) is not None:
            lag, largest = test.peak
            correlation = f"correlation with the input, largest {largest:+.2f} at {lag:.2g} s"
            drawn = charts.lags_chart(test.lags, test.correlation, test.band, correlation)
            run = quality.experiment
            table.add(run.name, run.role, quality.channel, drawn, test.verdict)
    blocks = [text(explanation), PageBlock("table", table, "residuals")]
    return Section("residuals", "Residuals", blocks)


def _data_section(
    findings: Sequence[str], quality: Table, overviews: Sequence[Overview]
) -> Section:
    """Section on the used parts of long logs, the data checks, and the quality of signals."""
    heading = f"{count(len(findings), 'finding')}:" if findings else NO_FINDINGS
    numbered = [
        Markup('<span id="finding-{}">{}</span>').format(number, sentence)
        for number, sentence in enumerate(findings, start=1)
    ]
    details = PageBlock(
        "details", [PageBlock("table", quality, "data")], count(len(quality.rows), "signal")
    )
    used = listed_block([overview.sentence for overview in overviews])
    return Section("data", "Data quality", [*used, text(heading), *listed_block(numbered), details])


def _setup_section(
    campaign: Campaign,
    drive: Parameters,
    title: str,
    notes: Mapping[str, str],
    fit: Optimum | None,
) -> Section:
    table = Table("", (Column(""), Column("")))
    table.add("campaign", str(campaign.path))
    if isinstance(drive, ModelSetup):
        table.add("model", drive.name)
    else:
        table.add("drive", f"{drive.name}, card {drive.card}" if drive.card else drive.name)
    if title:
        table.add("fit setup", title)
    for key, note in notes.items():
        if key != "campaign":
            table.add(key, note)
    blocks = [PageBlock("table", table, "notes")]
    if fit is not None:
        blocks += listed_block(_task_sentences(fit))
    return Section("setup", "Fit setup", blocks)


def _task_sentences(fit: Optimum) -> list[str]:
    """Describe what is simulated and fitted."""
    setup = fit.setup
    problem = fit.problem
    sentences = [f"Simulates {_PARTS[setup.part]}."]
    if setup.part == "pump":
        sentences.append(f"The current is the {setup.current} one.")
    sentences.append(f"Fits {listed(list(problem.channels))}.")
    sentences.append(scales_words(fit))
    for kind, windows in setup.weights.items():
        sentences += [
            f"Weight on {kind.replace('_', ' ')}: {_weight_text(window)}." for window in windows
        ]
    of_runs = sum(unknown.run is not None for unknown in problem.unknowns)
    if of_runs:
        sentences.append(
            f"In addition, there are {of_runs} parameters of single runs, with wide bounds."
        )
    return sentences


def _weight_text(weight: WeightWindow) -> str:
    period = "all of the run"
    if weight.start is not None or weight.stop is not None:
        first = "the start" if weight.start is None else f"{weight.start:g} s"
        stop = "the end" if weight.stop is None else f"{weight.stop:g} s"
        period = f"{first} to {stop}"
    place = f" in '{weight.maneuver}'" if weight.maneuver else ""
    why = f" ({weight.why})" if weight.why else ""
    return f"{weight.factor:g} on {period}{place}{why}"


# --- verdict --------------------------------------------------------------------------------------


def _verdict_section(verdict: Verdict, findings: int) -> Section:
    """The three answers, what they rest on, and the stated errors."""
    remark = f"{count(findings, 'finding')} on the campaign's data: see the section on them."
    answers = [(name, "look", [text]) for name, text in verdict.answers().items()]
    answers_and_remarks = [
        *answers,
        ("Range of validity", "plain", [verdict.validity] if verdict.validity else []),
        ("Remarks", "look", verdict.remarks),
        ("Assumed, as these logs cannot show it", "plain", verdict.assumed),
        ("Logs", "look", [remark] if findings else []),
    ]
    errors = titled(verdict.table(), "errors") if verdict.predictions else []
    return Section(
        "verdict",
        "Verdict in detail",
        [PageBlock("terms", answers_and_remarks, "verdict"), *errors],
    )


# --- what the data tell ---------------------------------------------------------------------------


def _parameter_section(fit: Optimum, truth: ParameterSet | None) -> Section:
    estimates = estimates_table(fit, truth=truth)
    explanation = (
        "Change is from the nominal value. Intervals are for residuals that are correlated over "
        "time. A parameter at a bound has no symmetric interval. Parameter files have SI units."
    )
    blocks = [text(explanation)]
    if truth is not None:
        inside, total = truth_count(estimates)
        blocks.append(
            text(
                "Truth is the simulated value. Fixed parameters with other values shift the "
                f"estimates. {inside} of {total} intervals contain it."
            )
        )
    blocks += titled(estimates, "parameters")
    of_runs = estimates_table(fit, own=True)
    if of_runs.rows:
        summary = f"{count(len(of_runs.rows), 'parameter')} of single runs"
        blocks.append(PageBlock("details", [PageBlock("table", of_runs, "parameters")], summary))
    fixed = fixed_table(fit, truth)
    blocks += titled(fixed, "held") if fixed.rows else []
    return Section("parameters", "Parameters", blocks)


def _identifiability_section(fit: Optimum) -> Section:
    blocks = list[PageBlock]()
    identifiability = identifiability_of(fit)
    general = [unknown.run is None for unknown in fit.problem.unknowns]
    blocks += listed_block(identifiability.sentences())
    width = Column("half width", ".3g", "%", none="none")
    columns = (Column("direction"), width, Column("moves together"))
    directions = Table("", (*columns, Column("fix")))
    for direction in identifiability.null + identifiability.weak:
        kind = "weak" if direction.weak else "null"
        if direction.gauge:
            kind = direction.gauge.name
        moves = ", ".join(f"{name} {change:+.2g} %" for name, change in direction.changes.items())
        condition = f"{direction.fix} if known" if direction.weak else direction.fix
        directions.add(
            kind, 100.0 * direction.half_width if direction.weak else None, moves, condition
        )
    if directions.rows:
        blocks.append(PageBlock("table", directions, "directions"))
    blocks.append(PageBlock("heading", "Basis of the intervals", "h4"))
    try:
        blocks += listed_block(uncertainty_of(fit).sentences())
    except InputError as error:
        blocks.append(text(f"There are no intervals: {error}"))
    blocks += _effects(identifiability, general)
    blocks += _correlations(fit, general)
    return Section("identifiability", "Uncertainty", blocks)


def _effects(identifiability: Identifiability, shown_mask: Sequence[bool]) -> list[PageBlock]:
    """Tabulate the change of all weighted residuals for 1 % of each parameter, largest first."""
    table = Table("", (Column("parameter"), Column("change of the residuals for 1 %", ".3g")))
    pairs = zip(
        identifiability.sensitivity,
        identifiability.variables.names,
        shown_mask,
        strict=True,
    )
    for effect, name in sorted(
        ((float(e), name) for e, name, is_shown in pairs if is_shown), reverse=True
    ):
        table.add(name, effect)
    return [PageBlock("details", [PageBlock("table", table, "effects")], "Sensitivity")]


def _correlations(fit: Optimum, general: Sequence[bool]) -> list[PageBlock]:
    """The estimates that move together most, if there are any."""
    try:
        quoted = uncertainty_of(fit).quoted
    except InputError:  # the sentences above say why there are none
        return []
    determined = [k for k, is_general in enumerate(general) if is_general and quoted.determined[k]]
    names = quoted.variables.names
    pairs = [
        (float(quoted.correlation[i, j]), names[i], names[j])
        for i, j in combinations(determined, 2)
    ]
    table = Table("", (Column("parameter"), Column("with"), Column("r", "+.3f")))
    for correlation, first, second in sorted(pairs, key=lambda pair: -abs(pair[0]))[:MOST_PAIRS]:
        table.add(first, second, correlation)
    if not table.rows:
        return []
    block = PageBlock("table", table, "correlations")
    return [PageBlock("details", [block], "Strongest correlations of the estimates")]


def _starts_section(solutions: Sequence[Solution]) -> Section:
    if len(solutions) < 2:
        return Section("starts", "Starts", [])
    failed = sum(not solution.cost < 1e300 for solution in solutions)
    failures = f"; {failed} left the model's domain" if failed else ""
    table = Table("", (Column("start"), Column("cost, best = 1", ".7g"), Column("ended")))
    best = min(solution.cost for solution in solutions) or 1.0
    for solution in sorted(solutions, key=lambda solution: solution.cost):
        if solution.cost < 1e300:
            table.add(str(solution.number), solution.cost / best, solution.message)
    explanation = f"Where each of {len(solutions)} starts ended, the best first{failures}."
    return Section("starts", "Starts", [text(explanation), PageBlock("table", table, "starts")])


def _profile_section(fit: Fit, profiles: Sequence[Profile]) -> Section:
    tiles = []
    for profile in profiles:
        unknown = fit.problem.unknowns.items[profile.index]
        remarks = [text(sentence, "remark") for sentence in profile.sentences()]
        drawn = PageBlock("figure", charts.profile_chart(profile, unknown), profile.name)
        tiles.append(PageBlock("tile", [drawn, *remarks]))
    explanation = (
        "The lowest cost with one parameter fixed, above that of the optimum; the dashed line ends "
        "the interval."
    )
    blocks = [text(explanation), PageBlock("tiles", tiles)] if tiles else []
    return Section("profiles", "Profile likelihoods", blocks)
