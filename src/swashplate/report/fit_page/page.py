"""The report of a fit as one HTML file that works offline."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from bokeh.resources import Resources
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from swashplate.campaign.campaign import Campaign
from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment, RunQuality, assess
from swashplate.identification.fit import Fit, StageFit
from swashplate.identification.profiles import Profile
from swashplate.identification.residual_tests import ResidualTest
from swashplate.identification.starts import StartResult
from swashplate.report.fit_page.error_sections import error_sections
from swashplate.report.fit_page.numbers import count, fixed, plain
from swashplate.report.fit_page.parameter_tables import held_rows, parameter_table
from swashplate.report.fit_page.run_data import run_data
from swashplate.report.fit_page.run_plots import stack_item, stack_of, stacks_of
from swashplate.report.fit_page.run_tables import data_rows, quality_row, quality_rows
from swashplate.report.fit_page.runs import ShownRun, shown_runs
from swashplate.report.fit_page.setup_tables import stage_rows
from swashplate.report.fit_page.small_charts import (
    SmallChart,
    autocorrelation_chart,
    cross_correlation_chart,
)
from swashplate.report.fit_page.statistics_plots import (
    correlation_item,
    profile_item,
    sensitivity_item,
    singular_value_item,
    waterfall_item,
)
from swashplate.report.fit_page.verdict import uncertainty_sentences, verdict
from swashplate.tables import write_text


class StageProfile(NamedTuple):
    """A profile, and the stage whose unknown it is of."""

    stage: str
    profile: Profile


class ResidualRow(NamedTuple):
    """The test of one channel's residuals in one run."""

    run: str
    role: str
    channel: str
    autocorrelation: SmallChart
    cross_correlation: SmallChart
    verdict: str


def write_fit_report(
    fit: Fit,
    campaign: Campaign,
    path: str | Path,
    *,
    assessments: Sequence[Assessment] | None = None,
    validation: Sequence[RunQuality] = (),
    starts: Sequence[StartResult] = (),
    profiles: Sequence[StageProfile] = (),
    notes: Mapping[str, str] | None = None,
) -> None:
    """Write the report of a fit: one HTML file, whole or not at all, that needs no network.

    Parameters
    ----------
    fit : Fit
        What was fitted.
    campaign : Campaign
        The tests that it was fitted to.
    path : path
        The file, which replaces an older one.
    assessments : sequence of Assessment, optional
        One for each stage; made here by default.
    validation : sequence of RunQuality
        Of runs that were held out.
    starts : sequence of StartResult
        Where several starts were tried.
    profiles : sequence of StageProfile
        Profiles that were computed.
    notes : mapping of str to str, optional
        What belongs to the report besides: versions, seed, command.

    Raises
    ------
    InputError
        If there is an assessment too many or too few, or a profile of no stage.
    FileError
        If the file cannot be written.

    Notes
    -----
    Every sample is in the file, in single precision. A figure shows the lowest and the highest
    sample of each of 1,000 stretches of what is in view, and all of them up to 4,000.
    """
    write_text(
        fit_page(
            fit,
            campaign,
            assessments=assessments,
            validation=validation,
            starts=starts,
            profiles=profiles,
            notes=notes,
        ),
        path,
    )


def fit_page(
    fit: Fit,
    campaign: Campaign,
    *,
    assessments: Sequence[Assessment] | None = None,
    validation: Sequence[RunQuality] = (),
    starts: Sequence[StartResult] = (),
    profiles: Sequence[StageProfile] = (),
    notes: Mapping[str, str] | None = None,
) -> str:
    """The report's HTML; see `write_fit_report`."""
    assessed = assess(fit.stages) if assessments is None else tuple(assessments)
    if [each.stage.stage.name for each in assessed] != [each.stage.name for each in fit.stages]:
        raise InputError("The report needs one assessment for each stage of the fit, in order.")
    runs = shown_runs(assessed, validation)
    axes = {run.experiment.axis for run in runs}
    data = data_rows([each for each in campaign if each.axis in axes])
    findings = sum(len(row.findings) for row in data)
    stacks = stacks_of(runs)
    items: dict[str, Any] = {name: stack_item(stack) for stack, name in stacks.items()}
    items |= _stage_items(assessed)
    if len(starts) > 1:
        items["waterfall"] = waterfall_item(starts)
    items |= {f"profile-{k}": _profile(fit, each) for k, each in enumerate(profiles)}
    page: str = _template().render(
        title=campaign.title,
        virtual=campaign.virtual,
        fit=fit,
        campaign=campaign,
        verdict=verdict(fit, assessed, runs, starts, findings),
        tables=[parameter_table(each) for each in assessed],
        held=held_rows(fit),
        quality=quality_rows(runs),
        runs=[
            (run, stacks[stack_of(run)], [quality_row(run, each) for each in run.channels])
            for run in runs
        ],
        errors=error_sections(runs),
        residuals=_residual_rows(runs),
        stages=[
            (each.stage.stage.name, each.identifiability, uncertainty_sentences(each))
            for each in assessed
        ],
        starts=starts,
        profiles=[_profile_words(fit, each) for each in profiles],
        data=data,
        findings=findings,
        setup=[stage_rows(each) for each in fit.stages],
        notes=dict(notes or {}),
        samples=sum(each.problem.samples for each in fit.stages),
        items={name: _script_json(item) for name, item in items.items()},
        run_data=[_script_json(run_data(run)) for run in runs],
        bokeh=Markup(Resources(mode="inline", components=["bokeh"], log_level="warn").render()),
        css=Markup(_text("page.css")),
        js=Markup(_text("page.js")),
    )
    return page


def _stage_items(assessments: Sequence[Assessment]) -> dict[str, Any]:
    """The figures of what the data tell, stage by stage."""
    items: dict[str, Any] = {}
    for number, each in enumerate(assessments):
        general = [unknown.run is None for unknown in each.stage.problem.unknowns]
        items[f"sensitivity-{number}"] = sensitivity_item(each.identifiability, general)
        items[f"singular-{number}"] = singular_value_item(each.identifiability)
        try:
            covariance = each.uncertainty.quoted
        except InputError:
            continue
        drawn = correlation_item(covariance, general)
        if drawn is not None:
            items[f"correlation-{number}"] = drawn
    return items


def _profile(fit: Fit, given: StageProfile) -> Any:
    stage = _stage(fit, given.stage)
    unknowns = stage.problem.unknowns
    index = given.profile.index
    return profile_item(given.profile, unknowns.items[index], unknowns.names[index])


def _profile_words(fit: Fit, given: StageProfile) -> tuple[str, str, tuple[str, ...]]:
    """Stage, unknown, and what stands in the way of an interval."""
    name = _stage(fit, given.stage).problem.unknowns.names[given.profile.index]
    return given.stage, name, given.profile.sentences(name)


def _stage(fit: Fit, name: str) -> StageFit:
    for each in fit.stages:
        if each.stage.name == name:
            return each
    known = ", ".join(each.stage.name for each in fit.stages)
    raise InputError(f"The profile of stage '{name}' belongs to no stage; there are {known}.")


def _residual_rows(runs: Sequence[ShownRun]) -> list[ResidualRow]:
    rows = []
    for run in runs:
        for each in run.channels:
            test: ResidualTest | None = each.quality.test
            if test is None:
                continue
            rows.append(
                ResidualRow(
                    run.experiment.name,
                    run.role,
                    each.quality.channel,
                    autocorrelation_chart(test),
                    cross_correlation_chart(test),
                    test.verdict,
                )
            )
    return rows


def _script_json(content: Any) -> Markup:
    """JSON that can stand in a script element: no text in it can end the element."""
    text = json.dumps(content, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


def _template() -> Any:
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"plain": plain, "fixed": fixed}
    environment.globals["count"] = count
    return environment.from_string(_text("page.html"))


def _text(name: str) -> str:
    return files("swashplate.report.fit_page").joinpath(name).read_text("utf-8")
