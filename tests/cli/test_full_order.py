import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swashplate import Drive

PAGE = Path(__file__).parents[2] / "docs" / "full-order.md"


def cells(text: str, row: str) -> list[str]:
    """The words of a table's row, by the words that it begins with."""
    (line,) = [line for line in text.splitlines() if line.startswith(row + "  ")]
    return line.removeprefix(row).split()


def test_a_run(done, number):
    text = done("full-order", "hoist", "step:9")
    assert text.startswith("hoist, step 9 V, five states against one: 5121 samples at 512 Hz\n")
    assert "16 of 16 physical values are assumed, as of the packaged hoist" in " ".join(
        text.split()
    )
    assert cells(text, "oil_volume") == ["200", "cm³", "assumed"]
    assert cells(text, "spool_frequency") == ["40", "Hz", "assumed"]
    assert cells(text, "load_inertia") == ["150", "kg", "m²", "assumed"]
    # Z10 Z13
    assert number(text, "step 9 V") == round(float(np.degrees(12.396 * 0.27596)), 2)
    # docs/full-order.md: 0.26 % and 0.12 %
    assert cells(text, "step 9 V")[1:] == ["0.26", "0.12", "yes"]
    assert "One state is enough, to 1 % of the top speed." in text


def test_nothing_moves(done):
    text = done("full-order", "hoist", "rest:2", "--set", "Z18=0")
    assert "The shaft does not move, so nothing can be said" in text
    text = done("full-order", "slew", "--set", "Z17=5")
    assert text.count("does not move") == 12


def test_the_table_is_the_documented_one(done):
    text = done("full-order", "luff")
    assert text.startswith("luff, five states against one: 11 maneuvers\n")
    documented = re.findall(r"^\| luff \| (.*?) \|$", PAGE.read_text("utf-8"), re.MULTILINE)
    rows = [[cell.strip() for cell in row.split("|")] for row in documented]
    rows = [row for row in rows if re.match("step|ramp|sine", row[0])]
    assert len(rows) == 11
    for maneuver, *numbers, within in rows:
        found = cells(text, maneuver)
        shown = [float(each) for each in found[1:3]]
        assert shown == pytest.approx([float(each) for each in numbers], abs=0.011)
        assert " ".join(found[3:]) == within
    said = "One state is enough for 10 of 11, to 1 %; not for sine 6.5 V 3 Hz."
    assert said in " ".join(text.split())


def test_files(done, tmp_path):
    text = done("full-order", "hoist", "step:4", "--out", "run.parquet", "--plot", "run.png")
    assert "All signals, in SI: run.parquet" in text
    assert "Figure: run.png" in text
    table = pl.read_parquet(tmp_path / "run.parquet")
    difference = table["reduced_shaft_speed"] - table["shaft_speed"]
    top, largest = map(float, cells(text, "step 4 V")[:2])
    assert np.degrees(difference.abs().max()) == pytest.approx(top * largest / 100.0, rel=0.01)
    assert table["voltage"].max() == 4.0
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    assert "Table: table.csv" in done("full-order", "slew", "--out", "table.csv")
    assert pl.read_csv(tmp_path / "table.csv").height == 11


def test_a_drive_of_one_s_own(done, tmp_path):
    drive = Drive.preset("slew").scale(Z8=1.2, Z10=0.9).replace(spool_friction=1.0)
    drive.renamed("mine").to_toml(tmp_path / "mine.toml")
    text = done("full-order", "mine.toml", "step:4", "--like", "slew", "--set", "Z15=5e6")
    lines = text.splitlines()
    assert lines[0].startswith("mine, step 4 V, five states")
    assert lines[1].startswith("Z15 (")
    assert lines[2] == "Left out of both models, which do not know refinements: spool_friction."
    assert cells(text, "spool_mass") == ["10", "g", "assumed"]
