"""Drafts of logs, read as campaigns."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from swashplate import Campaign
from swashplate.drafting import draft_campaign

RATE = 200.0
TIME = np.arange(int(8.0 * RATE)) / RATE
BOTH = 4.0 * (TIME > 1.0) - 8.0 * (TIME > 3.0) + 4.0 * (TIME > 5.0)
"""A command of both signs: 4 V from 1 s to 3 s, -4 V to 5 s. [V]"""

Columns = Mapping[str, np.ndarray | list[str]] | str
Drafted = Callable[..., Campaign]


def write(folder: Path, name: str, columns: Columns) -> Path:
    """A CSV of columns by their names, or of a text."""
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    if not isinstance(columns, str):
        rows = zip(*columns.values(), strict=True)
        lines = [",".join(columns)] + [
            ",".join(cell if isinstance(cell, str) else f"{cell:.9g}" for cell in row)
            for row in rows
        ]
        columns = "\n".join(lines) + "\n"
    path.write_text(columns, "utf-8")
    return path


def read_draft(folder: Path, logs: list[Path], **draft: object) -> Campaign:
    """What the draft of logs is read as."""
    path = folder / "campaign.toml"
    path.write_text(draft_campaign(logs, folder, **draft), "utf-8")
    return Campaign.from_toml(path)


@pytest.fixture
def drafted(tmp_path: Path) -> Drafted:
    """What the draft of logs, columns by file, is read as.

    Columns given by keyword are those of one log, beside its time and a command of both signs.
    """

    def made(
        logs: Mapping[str, Columns] | None = None,
        keep: np.ndarray | slice = slice(None),
        draft: Mapping[str, object] = MappingProxyType({}),
        **columns: np.ndarray | list[str],
    ) -> Campaign:
        one = {"time": TIME, "voltage": BOTH} | columns
        logs = logs or {"log.csv": {name: each[keep] for name, each in one.items()}}
        return read_draft(tmp_path, [write(tmp_path, *each) for each in logs.items()], **draft)

    return made
