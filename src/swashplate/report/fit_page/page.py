"""The report of a fit as one HTML file that works offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from swashplate.campaign import Campaign
from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment, RunQuality, assess
from swashplate.identification.cross_validation import CrossValidation
from swashplate.identification.fitting import Fit, StageFit
from swashplate.identification.starts import StartResult
from swashplate.identification.storing import StageProfile as StageProfile
from swashplate.identification.verdict import Verdict, starts_of, verdict
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.report.fit_page.excitation_tables import excitation_table
from swashplate.report.fit_page.fold_tables import fold_tables
from swashplate.report.fit_page.numbers import count
from swashplate.report.fit_page.parameter_tables import (
    ParameterTable,
    held_rows,
    parameter_table,
)
from swashplate.report.fit_page.rendering import Section, rendered, shared_content
from swashplate.report.fit_page.runs import shown_runs
from swashplate.report.fit_page.setup_tables import stage_rows
from swashplate.report.fit_page.statistics_plots import (
    correlation_item,
    profile_item,
    sensitivity_item,
    waterfall_item,
)
from swashplate.report.fit_page.truth import in_the_fits_scales
from swashplate.report.fit_page.verdict import lines_of, statements, uncertainty_sentences
from swashplate.tables import write_text


class TruthCount(NamedTuple):
    """How many intervals hold the truth."""

    held: int
    counted: int


def write_fit_report(
    fit: Fit,
    campaign: Campaign,
    path: str | Path,
    *,
    assessments: Sequence[Assessment] | None = None,
    validation: Sequence[RunQuality] = (),
    starts: Sequence[StartResult] = (),
    profiles: Sequence[StageProfile] = (),
    folds: CrossValidation | None = None,
    truth: ParameterSet | None = None,
    judged: Verdict | None = None,
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
        Of a search that is not kept in the fit's stages.
    profiles : sequence of StageProfile
        Profiles that were computed.
    folds : CrossValidation, optional
        Of the same runs and set-up.
    truth : ParameterSet, optional
        What virtual tests were simulated with; it stands beside the estimates.
    judged : Verdict, optional
        The verdict; made here by default.
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
    assessed = assess(fit.stages) if assessments is None else tuple(assessments)
    if [each.stage.stage.name for each in assessed] != [each.stage.name for each in fit.stages]:
        raise InputError("The report needs one assessment for each stage of the fit, in order.")
    if judged is None:
        planned = [each.name for each in fit.setup.stages]
        judged = verdict(assessed, validation, starts=starts, planned=planned)
    several = starts_of(assessed, starts)
    runs = shown_runs(assessed, validation)
    content = shared_content(campaign, runs, fit.nominal)
    content["items"] |= _stage_items(assessed)
    content["items"] |= {
        f"waterfall-{k}": waterfall_item(each) for k, each in enumerate(several.values())
    }
    content["items"] |= {f"profile-{k}": _profile(fit, each) for k, each in enumerate(profiles)}
    scaled = None if truth is None else in_the_fits_scales(truth, fit)
    tables = [parameter_table(each, scaled) for each in assessed]
    held_out = sum(run.validates for run in runs)
    stages = ", ".join(each.stage.name for each in fit.stages)
    samples = sum(each.problem.samples for each in fit.stages)
    content |= {
        "what": "Fit",
        "facts": f"{count(len(fit.stages), 'stage')}: {stages} · "
        f"{count(len(runs) - held_out, 'run')} fitted, {held_out} held out · "
        f"{count(samples, 'sample')} that count",
        "judged": judged,
        "verdict": statements(judged, assessed, runs, content["findings"]),
        "tables": tables,
        "truth": None if truth is None else _truth_count(tables),
        "held": held_rows(fit, truth),
        "excitation": [excitation_table(each) for each in assessed],
        "stages": [
            (
                each.stage.stage.name,
                each.identifiability,
                uncertainty_sentences(each),
                lines_of(each),
            )
            for each in assessed
        ],
        "starts": several,
        "profiles": [_profile_words(fit, each) for each in profiles],
        "cross_validation": folds,
        "folds": None if folds is None else fold_tables(folds, assessed),
        "setup": [stage_rows(each) for each in fit.stages],
        "setup_title": fit.setup.title,
        "notes": dict(notes or {}),
    }
    write_text(rendered(_sections(content), content), path)


def _sections(content: Mapping[str, Any]) -> list[Section]:
    """Those that there is something for."""
    return [
        Section("verdict", "Verdict"),
        Section("parameters", "Parameters"),
        Section("agreement", "Agreement by run"),
        Section("runs", "Overlays"),
        Section("errors", "Errors by kind of test"),
        Section("residuals", "Residuals"),
        Section("excitation", "What exercises what"),
        Section("identifiability", "Identifiability"),
        *([Section("starts", "Starts")] if content["starts"] else []),
        *([Section("profiles", "Profiles")] if content["profiles"] else []),
        *([Section("folds", "Cross-validation")] if content["folds"] is not None else []),
        Section("data", "Data quality"),
        Section("setup", "Set-up and versions"),
    ]


def _truth_count(tables: Sequence[ParameterTable]) -> TruthCount:
    rows = [row.holds for table in tables for row in table.rows if row.holds in ("yes", "no")]
    return TruthCount(rows.count("yes"), len(rows))


def _stage_items(assessments: Sequence[Assessment]) -> dict[str, Any]:
    """The figures of what the data tell, stage by stage."""
    items: dict[str, Any] = {}
    for number, each in enumerate(assessments):
        general = [unknown.run is None for unknown in each.stage.problem.unknowns]
        items[f"sensitivity-{number}"] = sensitivity_item(each.identifiability, general)
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
