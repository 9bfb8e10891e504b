"""Results: signals, limits, tables, files."""

import numpy as np
import polars as pl
import pytest

from swashplate import Drive, FileError, Limit, maneuvers


def test_signals_fit_together(axis: Drive) -> None:
    run = axis.simulate(maneuvers.step(6.5).sample(512.0))
    Z = axis.parameters.numbers
    np.testing.assert_allclose(run.shaft_speed, Z["Z10"] * run.swash_angle, rtol=1e-14)
    np.testing.assert_array_equal(run.current, run.current_positive - run.current_negative)
    assert np.abs(run.orifice_opening).max() <= max(Z["Z16_plus"], Z["Z16_minus"])
    tangent = np.clip(
        Z["Z1"] * run.stroker_pressure, -np.tan(Z["Z13_minus"]), np.tan(Z["Z13_plus"])
    )
    np.testing.assert_allclose(np.tan(run.swash_angle), tangent, atol=1e-15)
    steps = np.diff(run.shaft_position)
    means = 0.5 * (run.shaft_speed[1:] + run.shaft_speed[:-1]) / 512.0
    np.testing.assert_allclose(steps, means, rtol=1e-9, atol=1e-12)


def test_limits_of_a_hard_step(hoist: Drive) -> None:
    run = hoist.simulate(maneuvers.step(9.0).sample(512.0))
    t = run.time
    assert run.active(Limit.DEAD_ZONE)[t < 1.0].all()
    assert not run.active(Limit.DEAD_ZONE)[(t > 1.1) & (t < 6.0)].any()
    assert run.active(Limit.CURRENT_RATE)[(t > 1.04) & (t < 1.2)].all()
    assert run.active(Limit.ORIFICE)[(t > 1.3) & (t < 2.0)].all()
    assert run.active(Limit.SWASH_STOP)[(t > 3.0) & (t < 6.0)].all()
    assert not run.active(Limit.SWASH_STOP)[t > 6.2].any()
    assert not run.active(Limit.SPOOL | Limit.RELIEF).any()
    # while the plate rests on its stop the orifice limits nothing
    assert not (run.active(Limit.ORIFICE) & run.active(Limit.SWASH_STOP) & (t < 6.0)).any()
    np.testing.assert_array_equal(
        run.active(Limit.SWASH_STOP), np.isclose(run.swash_angle, 0.27596, rtol=1e-14)
    )


def test_a_current_driven_run_has_no_voltage(hoist: Drive) -> None:
    run = hoist.simulate_current([0.3, -0.4, 0.5])
    assert run.voltage is None
    assert "voltage" not in run.to_polars().columns
    assert list(run.current_positive) == [0.3, 0.0, 0.5]
    assert list(run.current_negative) == [0.0, 0.4, 0.0]


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_files_give_back_what_was_written(hoist: Drive, tmp_path, ending: str) -> None:
    run = hoist.simulate(maneuvers.step(4.0).sample(512.0))
    path = tmp_path / f"run.{ending}"
    run.write(path)
    table = pl.read_csv(path) if ending == "csv" else pl.read_parquet(path)
    assert table.equals(run.to_polars())
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_unknown_ending_is_refused(hoist: Drive, tmp_path) -> None:
    run = hoist.simulate([0.0, 1.0])
    with pytest.raises(FileError, match=r"\.csv or \.parquet"):
        run.write(tmp_path / "run.xlsx")
    with pytest.raises(FileError, match="cannot be written"):
        run.write(tmp_path / "nowhere" / "run.csv")
    assert not list(tmp_path.iterdir())


def test_a_failing_writer_leaves_the_old_file(tmp_path) -> None:
    from swashplate.tables import write_whole

    path = tmp_path / "run.csv"
    path.write_text("old")

    def write(beside) -> None:
        beside.write_text("half of the ne")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(path, write)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["run.csv"]
