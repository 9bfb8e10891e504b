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
    assert "16 of 16 physical values are assumed, as of the packaged hoist" in text
    assert cells(text, "oil_volume") == ["200", "cm³", "assumed"]
    assert cells(text, "spool_frequency") == ["40", "Hz", "assumed"]
    assert cells(text, "load_inertia") == ["150", "kg", "m²", "assumed"]
    # Z10 Z13
    assert number(text, "top speed") == round(float(np.degrees(12.396 * 0.27596)), 2)
    # docs/full-order.md: 0.26 %, 0.12 % and 0.08 %
    assert number(text, "largest difference", 1) == pytest.approx(0.26, abs=0.006)
    assert number(text, "rms difference", 1) == pytest.approx(0.12, abs=0.006)
    step_error = "step error of the march at 512 Hz"
    assert number(text, step_error, 1) == pytest.approx(0.08, abs=0.006)
    assert number(text, "largest difference") == pytest.approx(1.96 * 0.261, abs=2e-3)
    assert cells(text, "within 1 %") == ["yes"]
    assert cells(text, "within 0.1 %") == ["no"]
    assert "One state is enough here: within 1 % of the top speed, at most 0.26 %" in text


def test_nothing_moves(done):
    text = done("full-order", "hoist", "rest:2", "--set", "Z18=0")
    assert "The shaft does not move under this command" in text
    assert "within 1 %" not in text
    text = done("full-order", "slew", "--set", "Z17=5")
    assert text.count("does not move") == 12
    assert "The shaft does not move under any of these" in " ".join(text.split())


def test_the_table_is_the_documented_one(done):
    text = done("full-order", "luff")
    assert text.startswith("luff, five states against one: 11 maneuvers\n")
    documented = re.findall(r"^\| luff \| (.*?) \|$", PAGE.read_text("utf-8"), re.MULTILINE)
    rows = [[cell.strip() for cell in row.split("|")] for row in documented]
    rows = [row for row in rows if re.match("step|ramp|sine", row[0])]
    assert len(rows) == 11
    for maneuver, *numbers, within in rows:
        found = cells(text, maneuver)
        shown = [float(each) for each in found[1:4]]
        assert shown == pytest.approx([float(each) for each in numbers], abs=0.011)
        assert " ".join(found[4:]) == within
    said = "One state is enough for 10 of 11, to 1 % of the top speed; not for sine 6.5 V 3 Hz."
    assert said in " ".join(text.split())


def test_files(done, tmp_path):
    text = done("full-order", "hoist", "step:4", "--out", "run.parquet", "--plot", "run.png")
    assert "All signals, in SI: run.parquet" in text
    assert "Figure: run.png" in text
    table = pl.read_parquet(tmp_path / "run.parquet")
    difference = table["reduced_shaft_speed"] - table["shaft_speed"]
    (largest,) = re.findall(r"^largest difference +([\d.]+)", text, re.MULTILINE)
    assert np.degrees(difference.abs().max()) == pytest.approx(float(largest), abs=1e-4)
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
    assert lines[3] == "Left out of both models, which do not know refinements: spool_friction."
    assert cells(text, "spool_mass") == ["10", "g", "assumed"]
