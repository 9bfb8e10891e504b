"""The inverse steady-state map: exact at its points, monotone, the same after a file."""

import re
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swashplate import DomainError, Drive, FileError, InputError, maneuvers
from swashplate.analysis import improvement, inverse_map, proportional_command, speed_of_command
from swashplate.units import display_unit, shown_in

MAPS = {name: inverse_map(Drive.preset(name)) for name in ("hoist", "slew", "luff", "neutral")}


def test_limits_gap_and_standstill(hoist: Drive) -> None:
    map = MAPS["hoist"]
    assert np.degrees(map.limits) == pytest.approx([-185.0, 196.0], abs=0.05)
    assert map.voltage(map.limits) == pytest.approx([-7.41, 7.87], abs=0.005)
    assert np.degrees(map.creep) == pytest.approx(3.09, abs=0.005)
    assert np.degrees(map.acceleration) == pytest.approx([136.8, 177.8], abs=0.05)
    assert np.degrees(map.gap) == pytest.approx([-3.29, 3.09], abs=0.005)
    assert (np.diff(map.voltage(np.linspace(*map.limits, 20_001))) >= 0.0).all()
    assert map.voltage([[0.5, 1.0], [1.5, 2.0]]).shape == (2, 2)
    assert (map.voltage(1.0).shape, map.voltage([]).size) == ((), 0)
    assert all(float(each.voltage(each.creep)) == 0.0 for each in MAPS.values())
    assert float(map.voltage(0.0)) == 0.0  # the creep is nearer than the slowest return
    errors = [inverse_map(hoist, points).error for points in (11, 21, 41)]
    # half the distance is a quarter of the error, short of where the curvature is greatest
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2] > 0.0


@pytest.mark.parametrize("name", MAPS)
@given(share=st.floats(0.0, 1.0))
def test_the_drive_settles_where_it_should(name: str, share: float) -> None:
    drive, inverse = Drive.preset(name), MAPS[name]
    low, high = inverse.limits
    speed = low + share * (high - low)
    below, above = inverse.gap
    settled = drive.steady_speed(float(inverse.voltage(speed)))
    if below < speed <= above:
        # the nearest of what can be held
        reachable = np.array([below, inverse.creep, above])
        assert abs(settled - speed) == pytest.approx(np.abs(reachable - speed).min(), abs=1e-9)
    else:
        # the error is taken half way between points, where a parabola is worst
        assert settled == pytest.approx(speed, abs=1.2 * inverse.error + 1e-9)


def test_command_runs_ahead(hoist: Drive) -> None:
    inverse = MAPS["hoist"]
    ramp = np.linspace(0.5, 2.0, 513)  # 1.5 rad/s²
    ahead = inverse.voltage(ramp + 1.5 * inverse.lag)
    np.testing.assert_allclose(inverse.command(ramp, 512.0), ahead)
    # a drive that has settled on the ramp is late by its lag
    run = hoist.simulate(inverse.voltage(ramp), start="steady")
    late = (ramp - run.shaft_speed)[400:] / 1.5
    assert late == pytest.approx(np.full(113, inverse.lag), abs=0.01)


@pytest.mark.parametrize(
    ("speed", "rate", "said"),
    [
        ([1.0], 512.0, "two .* samples"),
        ([[1.0, 1.0]], 512.0, "two .* samples"),
        ([1.0, 1.0], 0.0, "rate .* 0 Hz"),
        ([1.0, 4.0], 512.0, "hoist .* 229.183 deg/s"),
        ([1.0, -4.0], 512.0, "hoist .* -229.183 deg/s"),
        ([1.0, np.nan], 512.0, "finite"),
        ("fast", 512.0, "a number"),
    ],
)
def test_commands_that_cannot_be(speed, rate, said) -> None:
    with pytest.raises(InputError, match=said):
        MAPS["hoist"].command(speed, rate)
    clipped = MAPS["hoist"].voltage([4.0, -4.0], clip=True)
    assert clipped == pytest.approx([7.8726, -7.4067], abs=1e-4)


@pytest.mark.parametrize("unit", ["deg/s", "rpm"])
def test_what_a_drive_cannot_hold_is_said_in_the_unit_of_choice(unit: str) -> None:
    inverse = MAPS["hoist"]
    with shown_in([unit]):
        low, high = (display_unit("rad/s").factor * each for each in inverse.limits)
        said = f"its speeds reach from {low:.6g} {unit} to {high:.6g} {unit}"
        with pytest.raises(InputError, match=re.escape(said)):
            inverse.voltage(4.0)
        table = inverse.tables([0.0, 1.0])[0]
        factor = display_unit("rad/s").factor
        assert [table.texts(row)[1:] for row in table.rows] == [
            ["0.0000", f"{factor * inverse.creep:.3f}"],
            [f"{float(inverse.voltage(1.0)):.4f}", f"{factor:.3f}"],
        ]
        assert f"and {factor * inverse.gap[1]:.3f} {unit} only the creep" in table.caption
        assert not inverse.tables([1.0])[0].caption


def test_files(tmp_path) -> None:
    hoist = MAPS["hoist"]
    table = hoist.to_polars()
    assert table.columns == ["speed", "voltage"]
    assert table["voltage"].is_sorted()
    assert table["speed"].is_sorted()
    hoist.write(tmp_path / "map.toml")
    stored = tomllib.loads((tmp_path / "map.toml").read_text("utf-8"))
    for way in ("plus", "minus"):
        assert stored[way]["speed"] == getattr(hoist, way).speed.tolist()
        assert stored[way]["voltage"] == getattr(hoist, way).voltage.tolist()
    assert (stored["drive"], stored["rest"]["speed"]) == ("hoist", hoist.creep)
    assert stored["acceleration"] == list(hoist.acceleration)
    with pytest.raises(FileError, match="txt.* .toml, .csv or .parquet"):
        hoist.write(tmp_path / "map.txt")


def test_drives_without_an_inverse(hoist: Drive) -> None:
    with pytest.raises(DomainError, match="positive .* 10 V .* hoist"):
        inverse_map(hoist.replace(Z17=5.0))
    bent = hoist.replace(G1=0.1, G2=-0.006, G3=0.0, Z13=1.0)
    with pytest.raises(DomainError, match="hoist .* from .* to .* V.* G1, G2 and G3"):
        inverse_map(bent)
    with pytest.raises(InputError, match="2 to 10001 points"):
        inverse_map(hoist, 10_002)
    with pytest.raises(InputError, match="reference speed .* standstill"):
        improvement(hoist, np.zeros(10))


def test_what_the_map_buys(axis: Drive) -> None:
    inverse = MAPS[axis.name]
    reference = speed_of_command(inverse, maneuvers.sine(2.0, 0.1).sample())
    found = improvement(axis, reference)
    assert list(found.runs) == ["straight line", "inverse map", "inverse map and lead"]
    plain, mapped, led = found.rms.values()
    assert plain > mapped > led
    if axis.name != "luff":  # whose slowest speed of 31 deg/s leaves nothing to gain there
        assert led < 0.25 * mapped
    np.testing.assert_allclose(found.runs["inverse map"].voltage, inverse.voltage(reference))
    off = axis.simulate(inverse.voltage(reference)).shaft_speed - reference
    assert mapped == pytest.approx(np.sqrt(np.mean(off**2)))
    assert "100.0%" in str(found.table()).replace(" ", "")
    # full stick is full speed, which the straight line commands with the saturation voltage
    reference = speed_of_command(inverse, [-10.0, -5.0, 0.0, 5.0, 10.0])
    (low, high), volts = inverse.limits, proportional_command(inverse, reference)
    assert reference == pytest.approx([low, 0.5 * low, 0.0, 0.5 * high, high])
    minus, plus = inverse.minus.voltage[0], inverse.plus.voltage[-1]
    assert volts == pytest.approx([minus, 0.5 * minus, 0.0, 0.5 * plus, plus])
