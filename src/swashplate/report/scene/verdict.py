"""Page of a judgment: does the controller work on this crane's drives, and what would do?"""

from __future__ import annotations

from datetime import date
from io import StringIO
from pathlib import Path

import numpy as np
from markupsafe import Markup
from matplotlib import rc_context
from matplotlib.figure import Figure

from swashplate.crane import Judgment
from swashplate.crane.study import IDEAL, NONE
from swashplate.errors import DomainError
from swashplate.report.figures.crane import plot_crane
from swashplate.report.figures.crane_studies import plot_follow, plot_judgment, seaway_words
from swashplate.report.fit_report.page import Block, Section, listed_block, page, text
from swashplate.report.fit_report.summary import Light, light
from swashplate.tables import Table, count, listed, write_text

IN_WORDS = (
    "No control: the crane as it is, under the operator's stick alone. Every variant goes through "
    "the same seaways, so that differences are within each seaway. Swing is the angle between rope "
    "and plumb line, RMS its root mean square over a seaway."
)
LIMITS_IN_WORDS = (
    "Orifice: the in-line orifice limits the flow to the stroking piston, so that the shaft cannot "
    "accelerate faster. Swash stop: the pump is at full stroke, so that it cannot turn faster. A "
    "controller that counts on more comes late, and late it feeds the swing."
)


def write_judgment(judgment: Judgment, path: str | Path) -> None:
    """Write a judgment's page: one HTML file, whole or not at all, that needs no network.

    Parameters
    ----------
    judgment : Judgment
    path : path
        The file, which replaces an older one.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    crane, study = judgment.study.crane, judgment.study
    swings, differences, limits, *remedies = judgment.tables()
    sections = [
        _summary(judgment, remedies),
        Section("swing", "Swing", [text(IN_WORDS), *_tables(swings, differences)]),
        _limits(judgment, limits),
        _example(judgment),
        _basis(judgment),
    ]
    content = {
        "what": "Crane",
        "title": crane.title or crane.name,
        "facts": f"{seaway_words(study.sea)} · {count(len(study.seeds), 'seaway')} · "
        f"{count(len(judgment.names) - 1, 'variant')} beside no control",
        "virtual": False,
        "date": f"{date.today():%d %B %Y}",
        "run_data": [],
    }
    write_text(page([each for each in sections if each.blocks], content), path)


def svg(figure: Figure) -> Markup:
    """A figure as SVG within a page, as wide as there is room."""
    written = StringIO()
    with rc_context({"svg.hashsalt": "swashplate"}):
        figure.savefig(written, format="svg", metadata={"Date": None})
    drawn = written.getvalue()
    return Markup(
        drawn[drawn.index("<svg") :].replace(
            "<svg", '<svg class="chart" style="min-width: 600px"', 1
        )
    )


def _tables(*tables: Table) -> list[Block]:
    made = []
    for each in tables:
        made += [Block("heading", each.title, "h3"), Block("table", each)]
        made += [text(each.caption, "remark")] if each.caption else []
    return made


def _summary(judgment: Judgment, remedies: list[Table]) -> Section:
    """The first screen: verdict, swing in every seaway, what would do."""
    look: Light = "good" if judgment.passed else "bad"
    verdict, *rests = judgment.sentences()
    words = "works" if judgment.passed else "fails"
    shown = [
        Block("verdict", (light(look, words), verdict), look),
        Block("figure", svg(plot_judgment(judgment)), "Swing of each variant in each seaway"),
        *_tables(*remedies),
    ]
    if judgment.tried and judgment.remedies:  # else the verdict says so
        shown.append(text(f"Tried, and not enough: {listed(judgment.tried)}.", "remark"))
    return Section("summary", "Summary", [*shown, *listed_block(rests)])


def _limits(judgment: Judgment, limits: Table) -> Section:
    """What limits the drives, and what they can follow."""
    if not limits.rows:
        return Section("limits", "Limits of the drives", [])
    how = judgment.cases[judgment.judged].where
    pose = {key: how[key] for key in ("slew_deg", "boom_deg", "rope_m")}
    study, periods = judgment.study, np.linspace(4.0, 14.0, 21)
    followable = study.crane.follow(periods, seaway=study.sea, **pose)
    caption = (
        "Largest sine of the tip that each axis can follow, and what seas ask of the luff: a point "
        "above the luff's line is more than it has"
    )
    figure = Block("figure", svg(plot_follow(followable)), caption)
    return Section(
        "limits", "Limits of the drives", [text(LIMITS_IN_WORDS), figure, *_tables(limits)]
    )


def _example(judgment: Judgment) -> Section:
    """One seaway over time."""
    seed, names = judgment.typical, [NONE, judgment.judged]
    try:
        runs = {name: judgment.run(name, seed) for name in names}
    except DomainError:  # a run that was stopped has no signals
        return Section("example", "One of the seaways", [])
    caption = f"Seaway {seed}, in which '{judgment.judged}' swings as in half of all seaways"
    drawn = svg(plot_crane(runs, title=""))
    return Section("example", "One of the seaways", [Block("figure", drawn, caption)])


def _basis(judgment: Judgment) -> Section:
    """Crane, pose, controllers."""
    crane, said = judgment.study.crane, []
    for name, case in judgment.cases.items():
        if name != NONE:
            drives = "ideal drives" if case.actuation == IDEAL else count(len(case.cranes), "crane")
            said.append(f"{name}: {case.control!r}, {drives}.")
    how = judgment.cases[NONE].where
    pose = (
        f"Boom at {how['slew_deg']:g}° from the bow to starboard and {how['boom_deg']:g}° up, rope "
        f"{how['rope_m']:g} m."
    )
    sets = [f"{axis}: {getattr(crane, axis).parameters.title}." for axis in ("slew", "luff")]
    geometry = Block("details", [Block("table", crane.table())], "Geometry, with its sources")
    assumed = "Shaded rows of the geometry are assumed: measure them before you rely on a number."
    return Section(
        "basis",
        "What it rests on",
        [*listed_block([pose, *said, *sets]), geometry, text(assumed)],
    )
