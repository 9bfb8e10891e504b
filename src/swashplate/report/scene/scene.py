"""Scene of a crane's runs: ship, crane, load and trail over time, in one file."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from swashplate.crane import CraneRun
from swashplate.crane.loop import ROWS
from swashplate.crane.stick import AXES
from swashplate.errors import InputError
from swashplate.tables import write_text

PICTURES = 30.0
"""Pictures a second that the page keeps. [Hz]"""
MOST_RUNS = 4
COLUMNS = (
    *("tip_x", "tip_y", "tip_z", "load_x", "load_y", "load_z", "shaft_slew", "pull", "rope"),
    *(f"limits_{axis}" for axis in AXES),
)
"""What the page keeps of each picture, beside the ship's six motions."""


def write_scene(runs: CraneRun | Mapping[str, CraneRun], path: str | Path) -> None:
    """Write the scene of one run or of several of one crane and length.

    Parameters
    ----------
    runs : CraneRun or mapping of str to CraneRun
        Up to four, by their names; the page shows one at a time over the swing of all.
    path : path
        The file, which replaces an older one.

    Raises
    ------
    InputError
        For none, more than four, or runs that differ in length.
    FileError
        If the file cannot be written.
    """
    named = {runs.actuation: runs} if isinstance(runs, CraneRun) else dict(runs)
    if not 0 < len(named) <= MOST_RUNS:
        raise InputError(f"A scene shows 1 to {MOST_RUNS} runs of a crane, not {len(named)}.")
    if len({len(each.out) for each in named.values()}) > 1:
        raise InputError("The runs of a scene must be of one length.")
    first = next(iter(named.values()))
    environment = Environment(
        loader=PackageLoader("swashplate.report.scene", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    folder = files("swashplate.report.scene")
    made = environment.get_template("scene.html").render(
        title=first.crane.title,
        names=list(named),
        assumed=first.crane.assumed,
        data=_script(_content(named)),
        css=Markup(folder.joinpath("scene.css").read_text("utf-8")),
        js=Markup(folder.joinpath("scene.js").read_text("utf-8")),
    )
    write_text(made, path)


def _content(runs: Mapping[str, CraneRun]) -> dict[str, Any]:
    """Geometry and pictures as the page's script takes them; SI."""
    first = next(iter(runs.values()))
    g = first.crane.geometry
    step = max(round(first.rate / PICTURES), 1)
    return {
        "step": step / first.rate,
        "slew": first.pose.slew,
        "axis": list(g.axis),
        "foot": g.foot,
        "sheave": [g.sheave * g.sheave_cos, g.sheave * g.sheave_sin],
        "columns": len(COLUMNS) + 6,
        "runs": [
            {"name": name, "ideal": run.actuation == "ideal", "code": _pictures(run, step)}
            for name, run in runs.items()
        ],
    }


def _pictures(run: CraneRun, step: int) -> str:
    """Rows of `COLUMNS` and of the ship's motion, as 4-byte numbers in base64."""
    kept = run.out[::step, [ROWS.index(name) for name in COLUMNS]]
    ship = run.ship[::step] if run.ship.shape[1] == 6 else np.zeros((len(kept), 6))
    return b64encode(np.hstack([kept, ship]).astype("<f4").tobytes()).decode("ascii")


def _script(content: Mapping[str, Any]) -> Markup:
    """JSON that can stand in a script element: no text in it can end the element."""
    words = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return Markup(words.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))
