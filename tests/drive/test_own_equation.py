"""A drive with an equation of one's own has all that a drive has."""

import pickle
import sys
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pytest
import tomlkit

from swashplate import DomainError, Drive, InputError, ParameterError, maneuvers
from swashplate.analysis import envelope, speed_limits
from swashplate.drive import drive_records, simulate_drive
from swashplate.machine import Definition, equation
from swashplate.models.amplifier import steady_current
from swashplate.models.displacement_control import (
    PressureLimits,
    Pump,
    pressure_limits,
    spool_balance,
)
from swashplate.models.pump import shaft_speed

RATE = 512.0
COMMAND = maneuvers.sine(4.0, 0.8, start=0.05, length=1.5, settle=0.3).sample(RATE)


class Seal(NamedTuple):
    """A seal on the spool."""

    test_seal: Annotated[
        float, Definition("what the seal takes from the spool's displacement", "m", lower=0.0)
    ] = 0.0


@equation
def sealed_balance(force: float, arm_sine: float, p: Pump, test_seal: float) -> float:
    """The spool's balance less the drag, which grows softly over 0.1 mm."""
    free = spool_balance(force, arm_sine, p)
    return free - test_seal * free / (abs(free) + 1e-4)


@equation
def faster(swash_angle: float, leakage: float, Z10: float, Z11: float) -> float:
    """Twice the speed of the package's equation."""
    return 2.0 * (Z10 * swash_angle - Z11 - leakage)


@equation
def narrower(p: Pump) -> PressureLimits:
    """A relief valve that opens at half of what the package's equation allows."""
    wide = pressure_limits(p)
    return PressureLimits(wide.lower_stop, wide.upper_stop, 0.5 * wide.lower, 0.5 * wide.upper)


PLAIN = Drive.preset("hoist")
SEALED = PLAIN.with_equation(spool_balance, sealed_balance, Seal)
DRAGGED = SEALED.replace(test_seal=2e-5)


def test_its_parameter_is_one_of_the_drive() -> None:
    assert SEALED["test_seal"].value == 0.0
    assert DRAGGED["test_seal"].value == 2e-5
    assert DRAGGED["test_seal"].definition.unit == "m"
    assert "test_seal" not in PLAIN.parameters
    assert DRAGGED.plain.parameters == PLAIN.parameters.plain
    with pytest.raises(ParameterError, match="test_seal.* 0"):
        SEALED.replace(test_seal=-1.0)
    with pytest.raises(ParameterError, match="parameter 'test_seal'"):
        PLAIN.replace(test_seal=1e-5)


@pytest.mark.slow
def test_march_stepper_and_lanes_give_the_same_bits() -> None:
    assert np.array_equal(SEALED.simulate(COMMAND).shaft_speed, PLAIN.simulate(COMMAND).shaft_speed)
    run = DRAGGED.simulate(COMMAND)
    assert run.shaft_speed.max() < PLAIN.simulate(COMMAND).shaft_speed.max() - 1e-3
    stepper = DRAGGED.stepper(RATE)
    assert [stepper.step(volts).shaft_speed for volts in COMMAND] == run.shaft_speed.tolist()
    batch = SEALED.simulate_many({"test_seal": np.array([0.0, 2e-5])}, voltage=COMMAND)
    assert np.array_equal(batch.output[1], run.shaft_speed)


def test_derivatives_are_those_of_differences() -> None:
    by = DRAGGED.sensitivities(COMMAND, parameters=["test_seal"])["shaft_speed"][:, 0]
    step = 1e-9
    up, down = (
        SEALED.replace(test_seal=2e-5 + each).simulate(COMMAND).shaft_speed
        for each in (step, -step)
    )
    assert np.abs(by - (up - down) / (2.0 * step)).max() < 1e-6 * np.abs(by).max()


@pytest.mark.slow
def test_steady_states_are_those_that_a_march_comes_to() -> None:
    held = DRAGGED.simulate(np.full(8000, 5.0)).shaft_speed[-1]
    assert DRAGGED.steady_speed(5.0) == pytest.approx(held, rel=1e-9)
    settled = DRAGGED.simulate(np.full(300, 5.0), start="steady").shaft_speed
    assert settled == pytest.approx(held, rel=1e-9)
    twice = PLAIN.with_equation(shaft_speed, faster)
    assert twice.steady_speed(5.0) == pytest.approx(2.0 * PLAIN.steady_speed(5.0), rel=1e-9)
    assert envelope(twice).plus.top_speed == pytest.approx(
        2.0 * envelope(PLAIN).plus.top_speed, rel=1e-9
    )


def test_limits_of_one_s_own_are_those_of_march_and_analysis() -> None:
    relieved = PLAIN.with_equation(pressure_limits, narrower)
    run = relieved.simulate(np.full(1500, 10.0))
    assert run.shaft_speed.max() == pytest.approx(speed_limits(relieved)[1], rel=1e-12)
    assert run.shaft_speed.max() < 0.6 * speed_limits(PLAIN)[1]
    records, beyond = drive_records(PLAIN, COMMAND, RATE), 1.5 * run.stroker_pressure.max()
    simulate_drive(PLAIN.parameters, records, "rest", beyond)
    with pytest.raises(DomainError, match="pressure at the start"):
        simulate_drive(relieved.parameters, records, "rest", beyond)


def test_another_process_finds_the_equation() -> None:
    again = pickle.loads(pickle.dumps(DRAGGED))
    assert again == DRAGGED
    assert np.array_equal(
        again.simulate(COMMAND).shaft_speed, DRAGGED.simulate(COMMAND).shaft_speed
    )


class Unnamed(NamedTuple):
    another: float = 0.0


class Taken(NamedTuple):
    Z6: Annotated[float, Definition("something else", "m")] = 0.0


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(InputError, match="faster .* drive"):
        PLAIN.with_equation(faster, faster)
    with pytest.raises(InputError, match="steady_current .* card"):
        PLAIN.with_equation(steady_current, faster, Seal)
    with pytest.raises(InputError, match="arguments of spool_balance"):
        PLAIN.with_equation(spool_balance, faster)
    with pytest.raises(InputError, match="Z6 already"):
        PLAIN.with_equation(spool_balance, sealed_balance, Taken)
    with pytest.raises(ParameterError, match="Unnamed.another .* Definition"):
        PLAIN.with_equation(shaft_speed, faster, Unnamed)


def test_a_file_keeps_its_equations(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    for drive in (DRAGGED, PLAIN.with_equation(shaft_speed, faster)):
        drive.to_toml(path)
        again = Drive.from_toml(path)
        assert again.parameters.equations == drive.parameters.equations
        assert again == drive
    assert again.steady_speed(3.0) != PLAIN.steady_speed(3.0)
    text = path.read_text("utf-8")
    path.write_text(text.replace(f"{__name__}:faster", "nobodys_module:faster"))
    with pytest.raises(ParameterError, match="faster .* nobodys_module: import"):
        Drive.from_toml(path)


PLACE = f"{__name__}:faster"
USED = "swashplate.models.pump:shaft_speed"


@pytest.mark.parametrize(
    ("entry", "sentence"),
    [
        ({"old": "os:system", "new": "os:system"}, "os:system is not an equation"),
        ({"old": USED, "new": "json:dumps"}, "json:dumps is not an equation"),
        ({"old": USED, "new": "os:environ"}, "os:environ is not an equation"),
        ({"old": USED, "new": PLACE, "parameters": "os:environ"}, "os:environ is not a class of"),
        ({"old": USED, "new": PLACE, "parameters": "builtins:dict"}, "builtins:dict is not a"),
        ({"old": PLACE, "new": PLACE}, "does not use faster"),
        ({"old": USED, "new": f"{__name__}:sealed_balance"}, "arguments of shaft_speed"),
        ({"old": "swashplate.cli:x", "new": PLACE}, "x of the module swashplate.cli"),
        ({"old": "antigravity:geohash", "new": PLACE}, "geohash of the module antigravity"),
        ({"old": USED}, "needs an entry 'new'"),
        ({"old": USED, "new": PLACE, "code": "1"}, "has no entry 'code'"),
        ({"old": USED, "new": True}, "equations 1.new is True"),
        (
            {
                "old": "swashplate.models.amplifier:steady_current",
                "new": "swashplate.models.amplifier:steady_current",
                "parameters": f"{__name__}:Seal",
            },
            "steady_current",
        ),
    ],
)
def test_a_file_names_equations_and_nothing_else(
    entry: dict[str, object], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TOKEN_OF_THE_TEST", "secret")
    path = tmp_path / "drive.toml"
    PLAIN.with_equation(shaft_speed, faster).to_toml(path)
    content = tomlkit.parse(path.read_text("utf-8"))
    content["model"]["equations"] = [entry]  # type: ignore[index]
    path.write_text(tomlkit.dumps(content), "utf-8")
    with pytest.raises(ParameterError) as refused:
        Drive.from_toml(path)
    assert str(refused.value).startswith(str(path))
    assert sentence in str(refused.value)
    assert "secret" not in str(refused.value)
    assert "antigravity" not in sys.modules
