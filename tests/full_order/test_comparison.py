"""One state against five: one as the limit of the other, differences, lags, and tables."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swashplate import Drive, maneuvers
from swashplate.full_order import (
    TABLE_MANEUVERS,
    Comparison,
    FullOrderDrive,
    compare,
    convergence,
    fine_steps,
    validity,
)

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
    """Kruse's eq. 6.19 has no damping: tens of deg/s off on a hoist step of 4 V."""
    hoist = FullOrderDrive.preset("hoist").replace(spool_damping=0.0)
    step = maneuvers.step(4.0).sample(512.0)
    reduced = hoist.reduced.simulate(step, substeps=16).shaft_speed
    off = np.degrees(np.abs(hoist.simulate(step).shaft_speed - reduced)).max()
    assert 30.0 < off < 60.0


def test_documented_table_is_what_the_function_gives() -> None:
    table = pl.concat([validity(FullOrderDrive.preset(name)).to_polars() for name in AXES])
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


def test_following_a_run_is_simulating_it() -> None:
    hoist = FullOrderDrive.preset("hoist")
    step = maneuvers.step(4.0, start=0.2, stop=1.0, length=1.5).sample(100.0)
    time = 3.0 + np.arange(step.size) / 100.0
    run = hoist.drive.simulate(step, 100.0, time=time, interpolation="linear")
    followed = hoist.follow(run)
    assert followed.time[0] == 3.0
    simulated = hoist.simulate(step, 100.0)
    assert followed.shaft_speed == pytest.approx(simulated.shaft_speed, abs=1e-9)
    by_current = hoist.drive.simulate_current(np.full(100, 0.5))
    assert np.array_equal(
        hoist.follow(by_current).shaft_speed,
        hoist.simulate_current(np.full(100, 0.5)).shaft_speed,
    )


@pytest.fixture(scope="module")
def compared() -> Comparison:
    hoist = FullOrderDrive.preset("hoist")
    step = maneuvers.step(4.0, start=0.5, stop=2.0, length=3.0).sample(512.0)
    return compare(hoist, hoist.drive.simulate(step))


def test_the_difference_is_that_of_the_speeds(compared: Comparison) -> None:
    error = compared.reduced_speed - compared.full.shaft_speed
    difference = compared.difference
    assert difference.largest == np.abs(error).max()
    assert difference.rms == pytest.approx(np.sqrt(np.mean(error**2)))
    assert difference.within == 0.01  # docs/full-order.md: 0.56 %


def test_without_motion_there_is_nothing_to_tell() -> None:
    slew = Drive.preset("slew").replace(Z17=5.0)  # a dead zone that no current leaves
    full = FullOrderDrive.from_drive(slew)
    found = compare(full, slew.simulate(maneuvers.step(2.0).sample()))
    assert not found.difference.moves
    begun: list[str] = []
    table = validity(full, begin=begun.append).to_polars()
    assert begun == [title for title, _ in TABLE_MANEUVERS]
    assert table["largest_percent"].null_count() == table.height
    assert table["within_1_percent"].null_count() == table.height
    assert table["top_speed"].max() < 1e-6


def test_a_table_of_both(compared: Comparison, tmp_path: Path) -> None:
    compared.write(tmp_path / "run.parquet")
    table = pl.read_parquet(tmp_path / "run.parquet")
    assert table.columns[:3] == ["time", "voltage", "current"]
    error = (table["reduced_shaft_speed"] - table["shaft_speed"]).abs().max()
    assert error == compared.difference.largest
    hoist = FullOrderDrive.preset("hoist")
    by_current = compare(hoist, hoist.drive.simulate_current(np.full(32, 0.5)))
    assert "voltage" not in by_current.to_polars().columns


def test_steps_of_the_reduced_march() -> None:
    assert fine_steps(512.0, 5000) == 64
    assert fine_steps(1024.0, 5000) == 32
    assert fine_steps(512.0, 1_000_000) == 20
    assert fine_steps(100_000.0, 5000) == 4
