"""Linear drives as files that any other program can read."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swashplate.linear.units import UNITS
from swashplate.tables import Form, ending, write_text

if TYPE_CHECKING:
    from swashplate.linear.model import LinearDrive

LINEAR_MODEL = Form("a linear model", (".toml", ".json"))


def content(model: LinearDrive) -> dict[str, Any]:
    """What is written of a model, as plain numbers, strings and lists; SI."""
    time: dict[str, Any] = {"delay": model.delay}
    if model.sample_time is not None:
        time["sample_time"] = model.sample_time
    point = asdict(model.operating_point)
    one_sided = point.pop("one_sided")
    return {
        "format": 1,
        "drive": model.name,
        "kind": "continuous" if model.sample_time is None else "sampled",
        "coulomb": model.coulomb,
        **time,
        "input": model.input,
        "outputs": list(model.outputs),
        "states": list(model.states),
        "input_unit": UNITS[model.input],
        "output_units": [UNITS[name] for name in model.outputs],
        "one_sided": list(one_sided),
        "A": model.A.tolist(),
        "B": model.B.tolist(),
        "C": model.C.tolist(),
        "D": model.D.tolist(),
        "operating_point": {name: value for name, value in point.items() if value is not None},
    }


def write_model(model: LinearDrive, path: str | Path) -> None:
    """Write a model as .toml or .json; see `LinearDrive.write`."""
    if ending(path, LINEAR_MODEL) == ".json":
        from json import dumps as dump_json

        write_text(dump_json(content(model), indent=1) + "\n", path)
    else:
        from tomlkit import dumps as dump_toml

        write_text(dump_toml(content(model)), path)
