"""An equation of the drive replaced by one's own, without a change to the package."""

from math import exp
from typing import NamedTuple

import numpy as np
import pytest

from swashplate import InputError
from swashplate.equations import (
    Model,
    equation,
    join,
    replaced,
    simulate,
)
from swashplate.models.displacement_control import Pump, spool_balance, stopped_spool
from swashplate.models.drive import drive


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
