"""Campaigns on disk: a small one whose numbers are easy to follow by hand."""

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.drafting.conftest import drafted as drafted

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
