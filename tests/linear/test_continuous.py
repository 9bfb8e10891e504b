"""The continuous model against closed forms and steady states, as SciPy's object and as a file."""

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.signal

from swashplate import DomainError, Drive, InputError

VARIANTS = {
    "published": {},
    "leaky": {"Z7": 0.8},
    "loaded": {"Z12": 0.2, "Z11": 0.05},
    "offset": {"Z2": 0.01},
    "steep": {"Z13": 0.6, "Z10": 6.0},
}


@pytest.mark.parametrize("at", [-3.0, 1.0, 4.0])
@pytest.mark.parametrize("changes", VARIANTS.values(), ids=VARIANTS.keys())
def test_gain_is_the_slope_of_the_steady_speed(
    hoist: Drive, derivative, changes: dict, at: float
) -> None:
    drive = hoist.replace(**changes)
    model = drive.linearize(at)
    slope = derivative(lambda volts: drive.steady_speed(volts), [at], 0, 1e-3)
    assert model.gain == pytest.approx(slope, rel=1e-7)
    assert model.operating_point.shaft_speed == drive.steady_speed(at)
    assert model.operating_point.current == drive.steady_current(at)
    assert model.response(0.0) == pytest.approx(model.gain)


def test_poles_of_the_card(axis: Drive) -> None:
    numbers = axis.parameters.numbers
    zeta, omega, C = (numbers[f"{name}_minus"] for name in ("zeta", "omega", "C"))
    for coulomb, damping in (
        ("ignored", 2.0 * zeta * omega),
        ("tangent", 2.0 * zeta * omega + C / 0.01),
    ):
        model = axis.linearize(-2.0, coulomb=coulomb)
        expected = [*np.roots([1.0, damping, omega**2]), -1.0 / model.time_constant]
        np.testing.assert_allclose(np.sort_complex(model.poles), np.sort_complex(expected))
        assert (np.diff(model.poles.real) <= 1e-9).all()
        assert model.delay == 0.014
        assert model.is_stable


def test_the_pump_alone_from_its_current(hoist: Drive) -> None:
    whole, pump = hoist.linearize(4.0), hoist.linearize(current=hoist.steady_current(4.0))
    assert pump.input == "current"
    assert pump.delay == 0.0
    assert pump.time_constant == whole.time_constant
    by_volt = hoist.linearize(4.0, outputs=["current"]).gain
    assert pump.gain * by_volt == pytest.approx(whole.gain)


def test_switches_are_declared(hoist: Drive) -> None:
    neutral = Drive.preset("neutral").linearize(0.0)
    assert neutral.gain == pytest.approx(1.0)
    assert neutral.time_constant == pytest.approx(0.1)
    assert len(neutral.operating_point.one_sided) == 2
    physical = Drive(replace(hoist.parameters, pressure_root="symmetric"))
    published, one_sided = hoist.linearize(-4.0), physical.linearize(-4.0)
    assert published.operating_point.one_sided == ()
    (said,) = one_sided.operating_point.one_sided
    assert "positive opening" in said
    assert one_sided.time_constant == pytest.approx(published.time_constant, rel=1e-12)


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ({"at": 0.1}, "card's dead zone, .* .0.2065 V"),
        (
            {"at": 0.14},
            "0.275.* A, .* dead zone of Z17 = ±0.27867 A",
        ),
        ({"at": 9.0}, "at its stop"),
        ({"current": 5.0}, "feedback spring"),
        ({"at": 4.0, "changes": {"Z15": 2e5}}, "at its limit Z15"),
        ({"at": 4.0, "changes": {"Z7": 3000.0}}, "leakage"),
    ],
)
def test_where_nothing_moves(hoist: Drive, where: dict, said: str) -> None:
    drive = hoist.replace(**where.pop("changes", {}))
    with pytest.raises(DomainError, match=said):
        drive.linearize(**where)


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ({}, "voltage or a current; .* one"),
        ({"at": 11.0}, "11 V.* ±10 V"),
        ({"at": 4.0, "input": "pressure"}, "'pressure', .* voltage, current"),
        ({"at": 4.0, "outputs": ["torque"]}, "'torque' .* output"),
        ({"at": 4.0, "coulomb": "half"}, "coulomb .*'half'"),
    ],
)
def test_refusals(hoist: Drive, where: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        hoist.linearize(**where)


def test_a_literal_sign_has_no_tangent() -> None:
    slew = Drive.preset("slew")
    literal = Drive(replace(slew.parameters, coulomb_sign="literal"))
    with pytest.raises(InputError, match="coulomb='ignored'"):
        literal.linearize(2.0, coulomb="tangent")
    assert literal.linearize(2.0).gain == slew.linearize(2.0).gain


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_is_proposed_is_the_first_that_has_a_model(axis: Drive, way: float) -> None:
    with pytest.raises(DomainError) as refused:
        axis.linearize(way * 0.05)
    (said,) = re.findall(r"linearise at ([+-][0-9.]+) V or beyond", str(refused.value))
    volts = float(said)
    assert np.sign(volts) == way
    assert axis.linearize(volts).gain > 0.0
    with pytest.raises(DomainError):
        axis.linearize(volts - way * 2e-4)
    with pytest.raises(DomainError, match=r"10 V"):
        axis.replace(Z17=5.0).linearize(way)


F = np.geomspace(0.01, 20.0, 30)
OUTPUTS = ("shaft_speed", "stroker_pressure", "current")


def of_scipy(system: scipy.signal.StateSpace, f: np.ndarray, row: int) -> np.ndarray:
    """A response that uses nothing but the object's matrices."""
    point = 2j * np.pi * f if system.dt is None else np.exp(2j * np.pi * f * system.dt)
    eye = np.eye(system.A.shape[0])
    return np.array(
        [
            (system.C @ np.linalg.solve(p * eye - system.A, system.B) + system.D)[row, 0]
            for p in point
        ]
    )


def test_without_delay(hoist: Drive) -> None:
    model = hoist.linearize(current=0.45, outputs=OUTPUTS[:2])
    expected, system = model.response(F), model.to_scipy()
    assert system.dt is None
    for row in range(2):
        np.testing.assert_allclose(of_scipy(system, F, row), expected[row], rtol=1e-9)
    late = hoist.linearize(4.0)
    without = late.response(F)[0] * np.exp(2j * np.pi * F * 0.014)
    np.testing.assert_allclose(of_scipy(late.to_scipy(without_delay=True), F, 0), without)
    with pytest.raises(InputError, match="delay of 0.014 s, .*without_delay=True"):
        late.to_scipy()


@pytest.mark.parametrize("rate", [100.0, 512.0])
def test_a_sampled_model_is_exact(axis: Drive, rate: float) -> None:
    model = axis.linearize(2.0, outputs=OUTPUTS).discrete(rate)
    expected, system = model.response(F), model.to_scipy()
    assert system.dt == 1.0 / rate
    for row in range(3):
        np.testing.assert_allclose(of_scipy(system, F, row), expected[row], rtol=1e-8)


@pytest.mark.parametrize("ending", ["toml", "json"])
def test_files_hold_everything(hoist: Drive, tmp_path: Path, ending: str) -> None:
    model = hoist.linearize(4.0, outputs=OUTPUTS).discrete(512.0)
    path = tmp_path / f"model.{ending}"
    model.write(path)
    text = path.read_text("utf-8")
    read = tomllib.loads(text) if ending == "toml" else json.loads(text)
    for name in "ABCD":
        np.testing.assert_array_equal(read[name], getattr(model, name))
    assert read["drive"] == "hoist"
    assert read["kind"] == "sampled"
    assert read["rate"] == 512.0
    assert read["delay"] == 7.0 / 512.0
    assert read["input_unit"] == "V"
    assert read["output_units"] == ["rad/s", "Pa", "A"]
    assert read["operating_point"]["voltage"] == 4.0
    assert read["operating_point"]["shaft_speed"] == hoist.steady_speed(4.0)
