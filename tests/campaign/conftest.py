"""Campaigns on disk: a small one whose numbers are easy to follow by hand, and drafts of logs."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from swashplate import Campaign
from swashplate.campaign import draft_campaign

CAMPAIGN = """\
title = "Bench"

[axes.winch]
drive = "hoist"
time = { column = "time", unit = "ms" }
input = { kind = "voltage", column = "joystick", unit = "mV" }

[axes.winch.channels.current]
kind = "rectified_current"
column = "ammeter"
unit = "mA"

[axes.winch.channels.counts]
kind = "encoder_counts"
column = "counts"
counts_per_turn = 1000
gear_ratio = 2.0
sign = -1

[[runs]]
file = "up.csv"

[[runs]]
file = "down.csv"
role = "validate"
"""


def log_text(volts: float, samples: int = 101) -> str:
    """Time in ms at 100 Hz; a step of mV at 0.5 s; 100 mA a volt; 10 counts a sample and volt."""
    rows = ["time,joystick,ammeter,counts"]
    counts = 0
    for k in range(samples):
        command = volts if k >= 50 else 0.0
        rows.append(f"{10 * k},{1000 * command:g},{100 * abs(command):g},{counts}")
        counts -= round(10 * command)
    return "\n".join(rows) + "\n"


@pytest.fixture
def campaign_folder(tmp_path: Path) -> Path:
    """A folder with campaign.toml, up.csv (+4 V) and down.csv (-4 V)."""
    (tmp_path / "campaign.toml").write_text(CAMPAIGN, "utf-8")
    (tmp_path / "up.csv").write_text(log_text(4.0), "utf-8")
    (tmp_path / "down.csv").write_text(log_text(-4.0), "utf-8")
    return tmp_path


@pytest.fixture
def edited(campaign_folder: Path) -> Callable[..., Path]:
    """The campaign file with some text replaced by other text."""

    def edit(old: str, new: str, file: str = "campaign.toml") -> Path:
        path = campaign_folder / file
        text = path.read_text("utf-8")
        assert old in text
        path.write_text(text.replace(old, new), "utf-8")
        return campaign_folder / "campaign.toml"

    return edit


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
