"""The report of a validation: a drive held against runs, as one HTML file that works offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from swashplate.campaign import Campaign
from swashplate.identification.assessment import RunQuality
from swashplate.identification.staging import Parameters
from swashplate.identification.verdict import Verdict, verdict
from swashplate.report.fit_page.numbers import count
from swashplate.report.fit_page.rendering import Section, rendered, shared_content
from swashplate.report.fit_page.runs import predicted_runs
from swashplate.report.fit_page.verdict import statements
from swashplate.tables import write_text

SECTIONS = (
    Section("verdict", "Verdict"),
    Section("agreement", "Agreement by run"),
    Section("runs", "Overlays"),
    Section("errors", "Errors by kind of test"),
    Section("residuals", "Residuals"),
    Section("data", "Data quality"),
    Section("setup", "Set-up and versions"),
)


def write_validation_report(
    drive: Parameters,
    campaign: Campaign,
    path: str | Path,
    predicted: Sequence[RunQuality],
    *,
    judged: Verdict | None = None,
    notes: Mapping[str, str] | None = None,
) -> None:
    """Write the report of a validation: one HTML file, whole or not at all, without network.

    Parameters
    ----------
    drive : ParameterSet or ModelParameters
        The drive, or the model of one's own, that was held against the runs.
    campaign : Campaign
        The tests.
    path : path
        The file, which replaces an older one.
    predicted : sequence of RunQuality
        At least one, as `validation.predict` gives them.
    judged : Verdict, optional
        The verdict; made here by default.
    notes : mapping of str to str, optional
        What belongs to the report besides.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    runs = predicted_runs(predicted)
    content = shared_content(campaign, runs, drive)
    found = judged if judged is not None else verdict((), predicted)
    samples = sum(each.measures.samples for each in predicted)
    content |= {
        "what": "Validation",
        "facts": f"{count(len(runs), 'run')} predicted from the command alone · "
        f"{count(samples, 'sample')} that count",
        "judged": found,
        "verdict": statements(found, (), runs, content["findings"]),
        "setup": (),
        "setup_title": "",
        "notes": dict(notes or {}),
    }
    write_text(rendered(SECTIONS, content), path)
