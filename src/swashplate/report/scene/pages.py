"""Pages of cranes: a scene that moves, and the verdict of a judgment; each is one file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from swashplate.crane import Crane, CraneRun, Judgment, follow
from swashplate.crane.axes import AXES, RATE
from swashplate.crane.drives import UNUSABLE
from swashplate.crane.study import NONE
from swashplate.errors import DomainError, InputError
from swashplate.report.fit_report.html_page import (
    Block,
    Section,
    listed_block,
    page,
    rendered,
    script_json,
    text,
    titled,
)
from swashplate.tables import count, listed, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swashplate.report.fit_report.summary import Light

# --- scene ----------------------------------------------------------------------------------------

STEP = round(RATE / 30.0)
"""Samples between two pictures of the page."""
MOST_RUNS = 4
COLUMNS = (
    *("tip_x", "tip_y", "tip_z", "load_x", "load_y", "load_z", "shaft_slew", "pull", "rope"),
    *("limits_hoist", "limits_slew", "limits_luff"),
)
"""What the page keeps of each picture, beside the ship's six motions."""


def write_scene(runs: CraneRun | Mapping[str, CraneRun], path: str | Path) -> None:
    """Write the scene of one run or of several of one crane and length, into a file.

    Up to four, by their names; the page shows one at a time over the swing of all.

    Raises
    ------
    InputError, FileError
        For none, more than four, or runs that differ in length; if the file cannot be written.
    """
    named = {runs.actuation: runs} if isinstance(runs, CraneRun) else dict(runs)
    if not 0 < len(named) <= MOST_RUNS:
        raise InputError(f"A scene shows 1 to {MOST_RUNS} runs of a crane, not {len(named)}.")
    if len({len(each.out) for each in named.values()}) > 1:
        raise InputError("The runs of a scene must be of one length.")
    first = next(iter(named.values()))
    g = first.crane.geometry
    content = {
        "step": STEP / RATE,
        "slew": first.fixed.home.slew,
        "axis": list(g.axis),
        "foot": g.foot,
        "sheave": [g.sheave * g.sheave_cos, g.sheave * g.sheave_sin],
        "columns": len(COLUMNS) + 6,
        "runs": [
            {"name": name, "ideal": run.actuation == "ideal", "code": _pictures(run)}
            for name, run in named.items()
        ],
    }
    made = rendered(
        "scene/scene.html",
        ("scene.js",),
        ("scene.css",),
        title=first.crane.title,
        names=list(named),
        assumed=first.crane.assumed,
        provenance=first.crane.provenance(),
        data=script_json(content),
    )
    write_text(made, path)


def _pictures(run: CraneRun) -> str:
    """Rows of `COLUMNS` and of the ship's motion, as 4-byte numbers in base64."""
    kept = np.stack([run[name][::STEP] for name in COLUMNS], axis=1)
    ship = run.ship[::STEP] if run.ship.shape[1] == 6 else np.zeros((len(kept), 6))
    return b64encode(np.hstack([kept, ship]).astype("<f4").tobytes()).decode("ascii")


# --- verdict --------------------------------------------------------------------------------------

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
FOLLOWED = (
    "Largest sine of the tip that each axis can follow, and what seas ask of the luff: a point "
    "above the luff's line is more than it has"
)
ASSUMED = "Shaded rows of the geometry are assumed: measure them before you rely on a number."


def write_judgment(judgment: Judgment, path: str | Path) -> None:
    """Write a judgment's page: one HTML file, whole or not at all, that needs no network.

    It replaces an older file; a `FileError` if it cannot be written.
    """
    study, judged = judgment.study, judgment.judged
    crane, setup = study.crane, study.cases[NONE].setup
    pose = {name: setup[name] for name in ("slew_deg", "boom_deg", "rope_m")}
    swings, worse, differences, limits, *remedies = judgment.tables()
    provenance = study.provenance()
    _, *rests = (words for words in judgment.sentences() if words not in provenance)
    # a scene alone needs no figures
    from swashplate.report.figures.crane import (
        plot_crane,
        plot_follow,
        plot_judgment,
        seaway_words,
    )
    from swashplate.report.fit_report.summary import light

    outcome = judgment.outcome
    looks: dict[str, Light] = {"works": "good", "not decided": "look", "fails": "bad"}
    look = looks[outcome]
    summary = [
        Block("verdict", (light(look, outcome), judgment.headline), look),
        *_fit_verdicts(crane),
        _drawn(plot_judgment(judgment), "Swing of each variant in each seaway"),
        *(block for each in remedies for block in titled(each)),
    ]
    if judgment.tried and judgment.remedies:  # else the verdict says so
        summary.append(text(f"Tried, and not enough: {listed(judgment.tried)}.", "remark"))
    limiting, example, basis = [], [], []
    if limits.rows:
        periods = np.linspace(4.0, 14.0, 21)
        seas = [study.sea.sea] if study.sea and isinstance(study.sea.sea, str) else []
        followable = plot_follow(follow(crane, periods, seas=seas, seaway=study.sea, **pose))
        limiting = [text(LIMITS_IN_WORDS), _drawn(followable, FOLLOWED), *titled(limits)]
    try:
        runs = {name: judgment.run(name, judgment.typical) for name in (NONE, judged)}
        caption = f"Seaway {judgment.typical}, in which '{judged}' swings as in half of all seaways"
        example = [_drawn(plot_crane(runs, title=f"Swing in seaway {judgment.typical}"), caption)]
    except DomainError:  # a run that was stopped has no signals
        pass
    basis.append(
        f"Boom at {pose['slew_deg']:g}° from the bow to starboard and {pose['boom_deg']:g}° up, "
        f"rope {pose['rope_m']:g} m."
    )
    for name, case in study.cases.items():
        if name != NONE:
            drives = count(len(case.cranes), "crane") if case.driven else "ideal drives"
            basis.append(f"{name}: {case.setup['control']!r}, {drives}.")
    for axis in AXES:
        title = getattr(crane, axis).parameters.title.partition(f". {UNUSABLE}")[0]
        basis.append(f"{axis}: {title.rstrip('.')}.")
    basis += provenance
    blocks = [block for each in (swings, worse, differences) for block in titled(each)]
    geometry = Block("details", [Block("table", crane.table())], "Geometry, with its sources")
    sections = [
        Section("summary", "Summary", [*summary, *listed_block(rests)]),
        Section("swing", "Swing", [text(IN_WORDS), *blocks]),
        Section("limits", "Limits of the drives", limiting),
        Section("example", "One of the seaways", example),
        Section("basis", "What it rests on", [*listed_block(basis), geometry, text(ASSUMED)]),
    ]
    made = page(
        sections,
        what="Crane",
        title=crane.title or crane.name,
        facts=f"{seaway_words(study.sea)} · {count(len(study.seeds), 'seaway')} · "
        f"{count(len(judgment.names) - 1, 'variant')} beside no control",
    )
    write_text(made, path)


def _fit_verdicts(crane: Crane) -> list[Block]:
    """The verdict on the fit of each drive that comes from one, and what its tests left open."""
    looks: dict[bool | None, Light] = {True: "good", False: "bad"}
    terms: list[tuple[str, Light, list[str]]] = []
    for axis in AXES:
        source, unreached = crane.sources.get(axis), crane.unreached_sentence(axis)
        look: Light = "look" if source is None else looks.get(source.judged_usable, "look")
        words = [source.words()] if source is not None else []
        if unreached:
            words.append(unreached)
        if words:
            terms.append((f"{axis.capitalize()}'s drive", look, words))
    return [Block("terms", terms, "verdict")] if terms else []


def _drawn(figure: Figure, caption: str) -> Block:
    """A figure as SVG within the page, whole on a narrow screen as well."""
    from matplotlib import rc_context

    written = StringIO()
    with rc_context({"svg.hashsalt": "swashplate"}):
        figure.savefig(written, format="svg", metadata={"Date": None})
    drawn = written.getvalue()
    drawn = drawn[drawn.index("<svg") :]
    return Block("figure", Markup(drawn.replace("<svg", '<svg class="chart"', 1)), caption)
