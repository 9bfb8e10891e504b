"""The one-state model as the limit of the full-order one."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swashplate import maneuvers
from swashplate.full_order import FullOrderDrive, convergence, validity
from swashplate.full_order.comparison import TABLE_MANEUVERS

DOCUMENT = Path(__file__).parents[2] / "docs" / "full-order.md"


AXES = ("hoist", "slew", "luff")


@pytest.mark.parametrize("name", AXES)
def test_difference_shrinks_like_the_root_of_epsilon(name: str) -> None:
    full = FullOrderDrive.preset(name)
    step = maneuvers.step(4.0, start=0.5, stop=2.0, length=3.0).sample(512.0)
    found = convergence(full, step, (1.0 / 64.0, 1.0 / 256.0, 1.0 / 1024.0))
    sizes = [each.rms for _, each in found]
    epsilons = [epsilon for epsilon, _ in found]
    slope = np.polyfit(np.log(epsilons), np.log(sizes), 1)[0]
    # but for the next order, ε, and the reduced march's own error, 1/64 of that at 512 Hz
    assert slope == pytest.approx(0.5, abs=0.06)
    assert [each.within for _, each in found] == [0.001] * 3


def test_without_damping_the_spool_rings() -> None:
    """The source's eq. 6.19 has no damping: tens of deg/s off on a hoist step of 4 V."""
    hoist = FullOrderDrive.preset("hoist").replace(spool_damping=0.0)
    step = maneuvers.step(4.0).sample(512.0)
    reduced = hoist.reduced.simulate(step, substeps=16).shaft_speed
    off = np.degrees(np.abs(hoist.simulate(step).shaft_speed - reduced)).max()
    assert 30.0 < off < 60.0


def test_documented_table_is_what_the_function_gives() -> None:
    table = pl.concat([validity(FullOrderDrive.preset(name)) for name in AXES])
    assert table.height == 3 * len(TABLE_MANEUVERS)
    lines = DOCUMENT.read_text("utf-8").split("<!-- validity: begin -->")[1]
    lines = lines.split("<!-- validity: end -->")[0].strip().splitlines()[2:]
    documented = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert len(documented) == table.height
    for row, cells in zip(table.iter_rows(named=True), documented, strict=True):
        assert cells[:2] == [row["axis"], row["maneuver"]]
        assert float(cells[2]) == pytest.approx(row["largest_percent"], abs=0.006)
        assert float(cells[3]) == pytest.approx(row["rms_percent"], abs=0.006)
        assert float(cells[4]) == pytest.approx(row["step_error_percent"], abs=0.006)
        within = "0.1 %" if row["within_0_1_percent"] else "1 %" * row["within_1_percent"]
        assert cells[5] == (within or "no")
