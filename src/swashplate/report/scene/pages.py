"""The scene of a crane: a page that moves, in one file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from swashplate.crane import RATE, CraneRun, named_runs
from swashplate.errors import InputError
from swashplate.report.fit_report.html_page import rendered, script_json
from swashplate.tables import write_text

STEP = round(RATE / 30.0)
"""Samples between two pictures of the page."""
MOST_RUNS = 4
COLUMNS = (
    "tip_x",
    "tip_y",
    "tip_z",
    "load_x",
    "load_y",
    "load_z",
    "shaft_slew",
    "pull",
    "rope",
    "limits_hoist",
    "limits_slew",
    "limits_luff",
)
"""Numbers of each picture that the page keeps, in addition to the ship's six motions."""


def write_scene(runs: CraneRun | Mapping[str, CraneRun], path: str | Path) -> None:
    """Write the scene of one run or of several of one crane and length, into a file.

    Up to four, by their names; the page shows one at a time over the swing of all.

    Raises
    ------
    InputError, FileError
        For none, more than four, or runs that differ in length; if the file cannot be written.
    """
    named = named_runs(runs, MOST_RUNS, "A scene")
    if len({len(run.out) for run in named.values()}) > 1:
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
    page = rendered(
        "scene/scene.html",
        ("scene.js",),
        ("scene.css",),
        title=first.crane.title,
        names=list(named),
        assumed=first.crane.assumed,
        provenance=first.crane.provenance(),
        data=script_json(content),
    )
    write_text(page, path)


def _pictures(run: CraneRun) -> str:
    """Rows of `COLUMNS` and of the ship's motion, as 4-byte numbers in base64."""
    signals = np.stack([run[name][::STEP] for name in COLUMNS], axis=1)
    ship = run.ship[::STEP] if run.ship.shape[1] == 6 else np.zeros((len(signals), 6))
    return b64encode(np.hstack([signals, ship]).astype("<f4").tobytes()).decode("ascii")
