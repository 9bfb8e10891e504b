"""An equation of the drive replaced by one's own, without a change to the package."""

from math import exp
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from swashplate import Drive, InputError, maneuvers
from swashplate.equations import (
    Definition,
    Model,
    equation,
    join,
    replaced,
    sensitivities,
    simulate,
)
from swashplate.models.drive import drive
from swashplate.models.pump import Pump, spool_balance, stopped_spool
from swashplate.simulation.instance import instance_of

RATE = 512.0
COMMAND = maneuvers.sine(4.0, 0.8, start=0.05, length=1.5, settle=0.3).sample(RATE)
OUTPUT = "shaft_speed"


class Seal(NamedTuple):
    """A seal on the spool."""

    seal_drag: Annotated[
        float, Definition("what the seal takes from the spool's displacement", "m", lower=0.0)
    ] = 0.0


@equation
def sealed_balance(force: float, arm_sine: float, p: Pump, seal_drag: float) -> float:
    """The spool's balance less the drag, which grows softly over 10 µm."""
    free = spool_balance(force, arm_sine, p)
    return free - seal_drag * free / (abs(free) + 1e-5)


sealed = replaced(drive, spool_balance, sealed_balance, Seal)


def numbers(model: Model, **more: float) -> tuple[tuple, tuple]:
    """Parameters and options of the hoist's drive on a model of its kind."""
    card, pump = instance_of(Drive.preset("hoist").parameters, by_voltage=True).parts
    own = model.parts[1].parameters(**{**pump.p._asdict(), **more})
    return model.parameters(card.p, own), model.options(card.options, pump.options)


def speed(model: Model, **more: float) -> np.ndarray:
    p, options = numbers(model, **more)
    return simulate(model, p, {"voltage": COMMAND}, RATE, options=options)[OUTPUT]


def test_at_zero_it_is_the_drive_to_the_last_bit() -> None:
    plain = Drive.preset("hoist").simulate(COMMAND).shaft_speed
    assert np.array_equal(speed(sealed), plain)
    assert np.array_equal(speed(drive), plain)


def test_the_equation_acts_at_every_sample() -> None:
    """At rest but for the drag, the spool's balance itself is what the replaced equation says."""
    p, options = numbers(sealed, seal_drag=2e-5)
    run = simulate(sealed, p, {"voltage": COMMAND}, RATE, options=options)
    own = p.pump
    for n in (100, 300, 500):
        arm_sine = own.Z3 * own.Z1 * run["pressure"][n] - own.Z3 * own.Z2
        free = spool_balance(run["solenoid_force"][n], arm_sine, own)
        expected = free - 2e-5 * free / (abs(free) + 1e-5)
        assert run["spool_free"][n] == pytest.approx(expected, rel=1e-9, abs=1e-18)


def test_derivatives_are_those_of_differences() -> None:
    p, options = numbers(sealed, seal_drag=2e-5)
    by = sensitivities(
        sealed,
        p,
        {"voltage": COMMAND},
        RATE,
        output=OUTPUT,
        parameters=["pump.seal_drag", "pump.Z8", "card.plus.G1"],
        options=options,
    )
    h = 1e-9
    rise = speed(sealed, seal_drag=2e-5 + h) - speed(sealed, seal_drag=2e-5 - h)
    np.testing.assert_allclose(by[:, 0], rise / (2 * h), atol=1e-5 * np.abs(by[:, 0]).max())
    assert np.abs(by).max(axis=0).min() > 0.0


def test_the_model_itself_is_as_it_was() -> None:
    assert "seal_drag" not in drive.parts[1].parameters._fields
    assert sealed.parts[0] is drive.parts[0]
    assert sealed.external == drive.external


def test_a_single_model_and_no_further_parameter() -> None:
    class Lag(NamedTuple):
        time: float

    class State(NamedTuple):
        out: float

    @equation
    def kept(time: float, h: float) -> float:
        return exp(-h / time)

    @equation
    def step(state: State, command: float, p: Lag, h: float) -> State:
        a = kept(p.time, h)
        return State(a * state.out + (1.0 - a) * command)

    @equation
    def implicit(time: float, h: float) -> float:
        return 1.0 / (1.0 + h / time)

    lag = Model("lag", parameters=Lag, state=State, step=step)
    other = replaced(lag, kept, implicit)
    run = simulate(other, Lag(0.1), {"command": np.ones(5)}, 10.0)
    np.testing.assert_allclose(run["out"], 1.0 - 0.5 ** np.arange(5), rtol=1e-15)
    two = join("two", lag)
    assert replaced(two, kept, implicit).parts[0] is not lag


def test_refusals() -> None:
    @equation
    def wrong(force: float, p: Pump) -> float:
        return force * p.Z1

    @equation
    def lost(position: float, p: Pump, width: float) -> float:
        return position - width * p.Z14

    @equation
    def unused(x: float) -> float:
        return x

    with pytest.raises(InputError, match="wrong must begin with the arguments of spool_balance"):
        replaced(drive, spool_balance, wrong)
    with pytest.raises(InputError, match="lost asks for width, no parameter of pump"):
        replaced(drive, stopped_spool, lost)
    with pytest.raises(InputError, match="drive does not use unused"):
        replaced(drive, unused, unused)

    class Bare(NamedTuple):
        width: float

    class Twice(NamedTuple):
        Z1: float = 0.0

    with pytest.raises(InputError, match="Bare.width needs a default"):
        replaced(drive, stopped_spool, lost, Bare)
    with pytest.raises(InputError, match="has a parameter Z1 already"):
        replaced(drive, stopped_spool, lost, Twice)
