"""Pages of what is decided on a crane: assessment of its control, operability; each is one file."""

from __future__ import annotations

from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from swashplate.crane import AXES, UNUSABLE, Assessment, Crane, Hull, Operability, Seaway, follow
from swashplate.crane.studies import NO_CONTROL, UNDECIDED, WORKABLE, Decision, label_of
from swashplate.errors import DomainError, InputError
from swashplate.report.fit_report.html_page import (
    PageBlock,
    Section,
    listed_block,
    page,
    text,
    titled,
)
from swashplate.tables import Table, count, listed, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swashplate.report.fit_report.summary import Light

# --- assessment -----------------------------------------------------------------------------------

LIGHTS: dict[Decision, Light] = {"yes": "good", "not decided": "look", "no": "bad"}
OUTCOMES: dict[str, Light] = {"passes": "good", "not decided": "look", "fails": "bad"}
HARM: dict[Decision, str] = {"yes": "does no harm", "not decided": "may harm", "no": "harms"}
SUFFICES: dict[Decision, str] = {
    "yes": "suffices",
    "not decided": "may not suffice",
    "no": "does not suffice",
}
ABOUT_SWING = (
    "No control: the crane as it is, moved only by the operator's stick. Every variant goes "
    "through the same seaways, so differences are within each seaway. Swing is the angle between "
    "rope and plumb line, RMS its root mean square over a seaway."
)
ABOUT_LIMITS = (
    "Orifice: the in-line orifice limits the flow to the stroking piston, so the shaft cannot "
    "accelerate faster. Swash stop: the pump is at full stroke, so the motor cannot turn faster. "
    "A controller that demands more acts late, and late action increases the swing."
)
FOLLOWED = (
    "Largest sine of the tip that each axis can follow, and the demand of the sea: a filled "
    "diamond above the line of its colour exceeds what the axis can do"
)
ASSUMED = "Shaded rows are assumed: measure or agree them before you rely on a number."
PERIODS = np.linspace(4.0, 16.0, 25)
"""Of the sines that axes are asked to follow. [s]"""


def write_assessment(assessment: Assessment, path: str | Path) -> None:
    """Write a report of an assessment as one HTML file, which needs no network.

    It replaces an older file, and is written whole or not at all; a `FileError` if it cannot be
    written.
    """
    # imported here: the pages of scenes do without Matplotlib
    from swashplate.report.figures import plot_assessment
    from swashplate.report.figures.crane import seaway_label
    from swashplate.report.fit_report.summary import light

    study = assessment.study
    crane = study.crane
    tables = assessment.tables()
    swings, worse = tables[:2]
    limited = tables[2:3] if crane.limits else []
    differences, acting, *remedies = tables[2 + len(limited) :]
    look = OUTCOMES[assessment.outcome]
    summary = [
        PageBlock("verdict", (light(look, assessment.outcome), _headline(assessment)), look),
        *_answers(assessment),
        *_fit_verdicts(crane),
        *(block for table in limited for block in titled(table, "limits")),
        _figure_block(
            plot_assessment(assessment), "Swing of each variant in each seaway, and its limits"
        ),
        *_remedies(assessment, remedies),
    ]
    provenance = study.provenance()
    assumptions = [
        sentence for sentence in assessment.sentences()[1:] if sentence not in provenance
    ]
    swing_tables = [block for table in (swings, worse, differences) for block in titled(table)]
    sections = [
        Section("summary", "Summary", summary),
        Section("hangs", "Sensitivity of the answer to assumptions", listed_block(assumptions)),
        Section("swing", "Swing", [text(ABOUT_SWING), *swing_tables]),
        Section("limits", "Limits of the drives", _drives_limits(assessment, acting)),
        Section("example", "One of the seaways", _example(assessment)),
        Section("basis", "What it rests on", _basis(assessment)),
    ]
    facts = [
        seaway_label(study.seaway),
        f"{count(len(study.seeds), 'seaway')} of {study.length / 60.0:g} min",
        f"{count(len(assessment.names) - 1, 'variant')} besides no control",
    ]
    title = crane.title or crane.name
    write_text(page(sections, what="Crane", title=title, facts=" · ".join(facts)), path)


def _headline(assessment: Assessment) -> str:
    """The outcome and the answers to the questions, in one short sentence."""
    answers = [HARM[assessment.harmless]] if "harm" in assessment.questions else []
    joint = "and"
    if "sufficiency" in assessment.questions and assessment.sufficient is not None:
        if answers and (assessment.harmless == "yes") != (assessment.sufficient == "yes"):
            joint = "but"
        answers.append(SUFFICES[assessment.sufficient])
    predicate = "changes nothing" if assessment.idle else f" {joint} ".join(answers)
    sentence = (
        f"{assessment.outcome.capitalize()}: control ('{assessment.assessed_variant}') {predicate}."
    )
    return f"{sentence} {assessment.unusable_sentence()}".rstrip()


def _answers(assessment: Assessment) -> list[PageBlock]:
    """Both answers, each with its light, whether it was requested or not."""
    harmless: Decision = "no" if assessment.idle else assessment.harmless
    terms = [("Harm", LIGHTS[harmless], [assessment.harm_sentence()])]
    if assessment.sufficient is not None:
        sentence = assessment.sufficiency_sentence()
        terms.append(("Sufficiency", LIGHTS[assessment.sufficient], [sentence]))
    for subject, _, sentences in terms:
        if subject.lower() not in assessment.questions:
            sentences.append("This was not requested: it does not affect the outcome.")
    return [PageBlock("terms", terms, "verdict")]


def _remedies(assessment: Assessment, tables: Sequence[Table]) -> list[PageBlock]:
    """List sufficient remedies, and those that were tried in vain."""
    blocks = [text(sentence) for sentence in assessment.remedy_sentences()]
    blocks += [block for table in tables for block in titled(table)]
    if assessment.tried and assessment.remedies:  # else the sentence says so
        blocks.append(text(f"Tried as well, and not better: {listed(assessment.tried)}.", "remark"))
    return blocks


def _fit_verdicts(crane: Crane) -> list[PageBlock]:
    """The verdict on the fit of each drive that comes from one, and what its tests left open."""
    lights: dict[bool | None, Light] = {True: "good", False: "bad"}
    terms: list[tuple[str, Light, list[str]]] = []
    for axis in AXES:
        source = crane.sources.get(axis)
        unreached = crane.unreached_sentence(axis)
        axis_light: Light = "look"
        sentences = []
        if source is not None:
            axis_light = lights.get(source.fit_usable, "look")
            sentences.append(source.description())
        if unreached:
            sentences.append(unreached)
        if sentences:
            terms.append((f"{axis.capitalize()}'s drive", axis_light, sentences))
    return [PageBlock("terms", terms, "verdict")] if terms else []


def _drives_limits(assessment: Assessment, acting: Table) -> list[PageBlock]:
    """Amplitudes that the axes can follow, and how long limits act; empty for ideal drives."""
    if not acting.rows:
        return []
    study = assessment.study
    pose = study.cases[NO_CONTROL].pose
    seas = [study.seaway.sea]
    followable = follow(study.crane, PERIODS, seas=seas, seaway=study.seaway, **pose)
    return [text(ABOUT_LIMITS), _figure_block(followable.plot(), FOLLOWED), *titled(acting)]


def _example(assessment: Assessment) -> list[PageBlock]:
    """The runs of a typical seaway; nothing if one of them was stopped."""
    from swashplate.report.figures import plot_crane

    seed = assessment.typical
    assessed = assessment.assessed_variant
    try:
        runs = {name: assessment.run(name, seed) for name in (NO_CONTROL, assessed)}
    except (DomainError, InputError):  # a run that was stopped has no signals
        return []
    caption = (
        f"Seaway {seed}, in which '{assessed}' swings as in half of all seaways; evaluated from "
        f"{assessment.study.run_in:g} s on"
    )
    return [_figure_block(plot_crane(runs, title=f"Swing in seaway {seed}"), caption)]


def _basis(assessment: Assessment) -> list[PageBlock]:
    """Pose, controllers, drives, ship, limits and geometry."""
    study = assessment.study
    crane = study.crane
    pose = study.cases[NO_CONTROL].pose
    basis = [
        f"Boom at {pose['slew_deg']:g}° from the bow to starboard and {pose['boom_deg']:g}° up, "
        f"rope {pose['rope_m']:g} m.",
        _ship_sentence(study.seaway),
    ]
    for name, case in study.cases.items():
        control = case.options["control"]
        if name != NO_CONTROL:
            drives = count(len(case.cranes), "crane") if case.driven else "ideal drives"
            description = control.description() if control is not None else "no control"
            basis.append(f"{name}: {description}, {drives}.")
    for axis in AXES:
        title = getattr(crane, axis).parameters.title.partition(f". {UNUSABLE}")[0]
        basis.append(f"{axis}: {title.rstrip('.')}.")
    basis += study.provenance()
    return [*listed_block(basis), *_assumptions(crane)]


def _ship_sentence(seaway: Seaway) -> str:
    ship = seaway.ship
    if not isinstance(ship, Hull):
        return f"Ship: {ship.name}."
    return (
        f"Ship: a hull of {ship.length:g} m by {ship.beam:g} m with a draught of "
        f"{ship.draught:g} m, roll period {ship.roll_period:g} s with a damping of "
        f"{100.0 * ship.roll_damping:g} %."
    )


def _assumptions(crane: Crane) -> list[PageBlock]:
    """Limits and geometry with their sources; assumed ones are marked."""
    blocks = []
    if crane.limits:
        blocks += titled(crane.limit_table())
    geometry = [PageBlock("table", crane.table())]
    return [*blocks, PageBlock("details", geometry, "Geometry, with its sources"), text(ASSUMED)]


# --- operability ----------------------------------------------------------------------------------

CELLS = (
    "What limits each sea of the year: the colour by what limits it first at most of the headings, "
    "the stronger the more headings cannot be worked"
)


def write_operability(operability: Operability, path: str | Path) -> None:
    """Write a report of an operability study as one HTML file, which needs no network.

    It replaces an older file, and is written whole or not at all; a `FileError` if it cannot be
    written.
    """
    crane = operability.crane
    seaway = operability.seaway
    (table,) = operability.tables()
    summary = [
        text(_summary_sentence(operability), "lead"),
        _figure_block(operability.plot(), CELLS),
        *titled(table),
        *listed_block(operability.sentences()),
    ]
    basis = [_ship_sentence(seaway), *crane.provenance()]
    sections = [
        Section("summary", "Summary", summary),
        Section("basis", "What it rests on", [*listed_block(basis), *_assumptions(crane)]),
    ]
    facts = [
        f"{count(operability.scatter.height.size, 'sea')} of the scatter diagram",
        f"{count(len(operability.headings), 'heading')}, equally likely",
    ]
    title = crane.title or crane.name
    write_text(page(sections, what="Operability", title=title, facts=" · ".join(facts)), path)


def _summary_sentence(operability: Operability) -> str:
    """Share of the year that the last variant and the crane without control can work.

    A second sentence names the limit that most often prevents work.
    """
    name = operability.names[-1]
    with_control = 100.0 * operability.workable(name)
    without = 100.0 * operability.workable(NO_CONTROL)
    sentence = (
        f"'{name}' can work {with_control:.0f} % of the year, the crane without control "
        f"{without:.0f} %."
    )
    shares = operability.shares(name)
    if operability.undecided(name):
        sentence += f" {100.0 * operability.undecided(name):.0f} % is undecided."
    limits = [limit for limit in shares if limit not in (WORKABLE, UNDECIDED)]
    if not limits:
        return sentence
    share = 100.0 * shares[limits[0]]
    limit = label_of(limits[0])
    return f"{sentence} Most often the rest is limited by {limit} first: {share:.0f} % of the year."


def _figure_block(figure: Figure, caption: str) -> PageBlock:
    """A figure as SVG within the page, with a class that lets it shrink on a narrow screen."""
    from matplotlib import rc_context

    file = StringIO()
    with rc_context({"svg.hashsalt": "swashplate"}):
        figure.savefig(file, format="svg", metadata={"Date": None})
    document = file.getvalue()
    svg = document[document.index("<svg") :]
    return PageBlock("figure", Markup(svg.replace("<svg", '<svg class="chart sheet"', 1)), caption)
