"""One state against five: one as the limit of the other, differences, and the table."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swashplate import Drive, maneuvers
from swashplate.full_order import (
    TABLE_MANEUVERS,
    FullOrderDrive,
    compare,
    validity,
    validity_table,
    validity_verdict,
)

DOCUMENT = Path(__file__).parents[2] / "docs" / "full-order.md"
AXES = ("hoist", "slew", "luff")
STEP = maneuvers.step(4.0, start=0.5, stop=2.0, length=3.0).sample(512.0)
INERTIAS = ("spool_mass", "feedback_arm_inertia", "swash_inertia", "piston_mass")
DAMPINGS = ("spool_damping", "piston_damping", "load_inertia")
"""Which act on a rate; the load's inertia on that of the plate."""


@pytest.mark.parametrize("name", AXES)
def test_difference_shrinks_like_the_root_of_epsilon(name: str) -> None:
    """With inertias times ε and dampings times √ε five states lead to one."""
    full, epsilons, sizes = FullOrderDrive.preset(name), (1 / 64, 1 / 256, 1 / 1024), []
    for e in epsilons:
        parts = dict.fromkeys(INERTIAS, e) | dict.fromkeys(DAMPINGS, e**0.5)
        small = full.replace(**{k: part * full.physical.numbers[k] for k, part in parts.items()})
        largest, rms = compare(small, small.drive.simulate(STEP)).relative
        assert largest < 1e-3
        sizes.append(rms)
    slope = np.polyfit(np.log(epsilons), np.log(sizes), 1)[0]
    # but for the next order, ε, and the reduced march's own error, 1/64 of that at 512 Hz
    assert slope == pytest.approx(0.5, abs=0.06)


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
        assert cells[4] == ("yes" if row["within_1_percent"] else "no")


def test_following_a_run_is_simulating_it() -> None:
    hoist = FullOrderDrive.preset("hoist")
    step = maneuvers.step(4.0, start=0.2, stop=1.0, length=1.5).sample(100.0)
    time = 3.0 + np.arange(step.size) / 100.0
    followed = hoist.follow(hoist.drive.simulate(step, 100.0, time=time, interpolation="linear"))
    assert followed.time[0] == 3.0
    assert followed.shaft_speed == pytest.approx(hoist.simulate(step, 100.0).shaft_speed, abs=1e-9)
    current = np.full(100, 0.5)
    by_current = hoist.follow(hoist.drive.simulate_current(current))
    assert np.array_equal(by_current.current, current)


def test_the_difference_is_that_of_the_speeds(tmp_path: Path) -> None:
    hoist = FullOrderDrive.preset("hoist")
    found = compare(hoist, hoist.drive.simulate(STEP))
    error = found.reduced_speed - found.full.shaft_speed
    top = np.abs(found.full.shaft_speed).max()
    rms = np.sqrt(np.mean(error**2))
    assert found.relative == pytest.approx((np.abs(error).max() / top, rms / top))
    found.write(tmp_path / "run.parquet")
    table = pl.read_parquet(tmp_path / "run.parquet")
    assert table.columns[:3] == ["time", "voltage", "current"]
    np.testing.assert_array_equal(table["reduced_shaft_speed"] - table["shaft_speed"], error)
    by_current = compare(hoist, hoist.drive.simulate_current(np.full(32, 0.5)))
    assert "voltage" not in by_current.to_polars().columns
    made = validity_table("hoist", [("step", found)])
    assert validity_verdict(made) == "One state is enough, to 1 % of the top speed."


def test_without_motion_there_is_nothing_to_tell() -> None:
    full = FullOrderDrive.from_drive(Drive.preset("slew").replace(Z17=5.0))  # never leaves it
    made = validity(full)
    table = made.to_polars()
    for column in ("largest_percent", "within_1_percent"):
        assert table[column].null_count() == table.height
    assert table["top_speed"].max() < 1e-6
    assert validity_verdict(made).startswith("The shaft does not move")
