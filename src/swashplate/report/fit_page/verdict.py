"""The verdict as the report shows it: the judgement, with measures in the units of people."""

from __future__ import annotations

from collections.abc import Sequence

from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment, Measures, RunQuality
from swashplate.identification.spectral_lines import SpectralLine
from swashplate.identification.validation import pooled
from swashplate.identification.verdict import Statement, Verdict, Weight
from swashplate.report.display_units import display_unit
from swashplate.report.fit_page.numbers import count, plain
from swashplate.report.fit_page.runs import ShownRun, conditions


def statements(
    judged: Verdict, assessments: Sequence[Assessment], runs: Sequence[ShownRun], findings: int
) -> tuple[Statement, ...]:
    """The statements in the order in which the report gives them.

    Parameters
    ----------
    judged : Verdict
        The judgement.
    assessments : sequence of Assessment
        One for each stage; none for a drive that was only held against runs.
    runs : sequence of ShownRun
        Fitted and held out.
    findings : int
        Findings about the campaign's data.
    """
    fitted, held = (
        [each.quality for run in runs if run.validates == out for each in run.channels]
        for out in (False, True)
    )
    measured = {
        "Agreement": quality_sentences(fitted if assessments else [*fitted, *held]),
        "Validation": quality_sentences(held),
    }
    made = [
        each._replace(sentences=(*measured.get(each.subject, ()), *each.sentences))
        for each in judged.statements
    ]
    if assessments:
        said = [
            f"{each.stage.stage.name}: {words}"
            for each in assessments
            for words in uncertainty_sentences(each)
        ]
        made.append(Statement("Errors", "plain", tuple(said)))
    if judged.criteria:
        lines = (
            f"{'Met' if each.passed else 'NOT MET'}: {each.name}: {each.value} "
            f"(limit {each.limit}; {each.reason})."
            for each in sorted(judged.criteria, key=lambda each: each.passed)
        )
        failed = {each.rules for each in judged.criteria if not each.passed}
        weight: Weight = "bad" if "use" in failed else "look" if failed else "good"
        made.append(Statement("Acceptance criteria", weight, tuple(lines)))
    if judged.validity:
        made.append(Statement("Range of validity", "plain", (judged.validity,)))
    if judged.assumed:
        made.append(Statement("Assumed, cannot be checked", "plain", judged.assumed))
    if findings:
        text = f"{count(findings, 'finding')} on the campaign's data: see the section on them."
        made.append(Statement("Data", "look", (text,)))
    return tuple(made)


def measures_words(name: str, unit: str, found: Measures) -> str:
    """``current: fit 96.1 % (RMSE 7.6 mA, R² 0.9985)``."""
    rmse = f"RMSE {rmse_words(unit, found)}"
    if found.fit_percent is None or found.r_squared is None:
        return f"{name}: {rmse}; what was measured is constant, so there is no fit %"
    return f"{name}: fit {found.fit_percent:.2f} % ({rmse}, R² {found.r_squared:.4f})"


def rmse_words(unit: str, found: Measures) -> str:
    """``7.6 mA``."""
    shown = display_unit(unit, found.rmse)
    return f"{plain(shown.factor * found.rmse, 3)} {shown.name}".rstrip()


def quality_sentences(qualities: Sequence[RunQuality]) -> tuple[str, ...]:
    """One sentence for each channel: fit %, and what must stand beside it."""
    said = []
    for name, found in pooled(qualities).items():
        runs = [each.experiment for each in qualities if each.channel == name]
        words = measures_words(name, runs[0][name].unit, found)
        said.append(
            f"{words} over {count(len(runs), 'run')}, {count(found.samples, 'sample')}; "
            f"{conditions(runs, name)}."
        )
    return tuple(said)


def uncertainty_sentences(assessment: Assessment) -> tuple[str, ...]:
    """What the intervals rest on, or why there are none."""
    try:
        return assessment.uncertainty.sentences()
    except InputError as error:
        return (f"There are no intervals: {error}",)


def lines_of(assessment: Assessment) -> tuple[SpectralLine, ...]:
    """Spectral lines in a stage's residuals; none where there are no intervals."""
    try:
        return assessment.uncertainty.lines
    except InputError:
        return ()
