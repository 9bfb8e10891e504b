"""A differential equation as the step of a model, held against an adaptive solver."""

from math import sin
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swashplate import InputError
from swashplate.machine import Machine, Model, discretised, equation, sensitivities, simulate

RATE, SIZE = 50.0, 60
TORQUE = np.where(np.arange(SIZE) > 15, 3.0, 0.0)
ORDER = {"euler": 1, "heun": 2, "midpoint": 2, "rk4": 4}


class Rope(NamedTuple):
    length: float
    drag: float


class Arm(NamedTuple):
    angle: float
    speed: float


class Swing(NamedTuple):
    arm: Arm
    work: float


class Wall(NamedTuple):
    angle: float


@equation
def rates(state: Swing, torque: float, p: Rope) -> Swing:
    arm = state.arm
    force = torque - 9.81 / p.length * sin(arm.angle) - p.drag * arm.speed
    return Swing(Arm(arm.speed, force), torque * arm.speed)


@equation
def stopped(state: Swing, given: Wall) -> Swing:
    angle = min(max(state.arm.angle, -given.angle), given.angle)
    speed = state.arm.speed if abs(state.arm.angle) < given.angle else 0.0
    return Swing(Arm(angle, speed), state.work)


P = Rope(1.0, 0.3)
BEGIN = {"arm.angle": 0.3}


@pytest.fixture(scope="module")
def exact() -> np.ndarray:
    """Angle and work by an adaptive solver, sample by sample."""
    state, found = np.array([0.3, 0.0, 0.0]), [np.array([0.3, 0.0, 0.0])]
    for u in TORQUE[:-1]:

        def slope(_: float, x: np.ndarray, u: float = u) -> list[float]:
            return [x[1], u - 9.81 * np.sin(x[0]) - 0.3 * x[1], u * x[1]]

        state = solve_ivp(slope, (0.0, 1.0 / RATE), state, rtol=1e-11, atol=1e-13).y[:, -1]
        found.append(state)
    return np.array(found)


def run(method: str, substeps: int, p: Rope = P) -> np.ndarray:
    model = Model("swing", Rope, Swing, discretised(rates, method, substeps=substeps))
    made = simulate(Machine(model, p), {"torque": TORQUE}, RATE, begin=BEGIN)
    return np.column_stack([made["arm.angle"], made["arm.speed"], made["work"]])


@pytest.mark.parametrize("method", ORDER)
def test_sub_steps_converge_with_the_order_of_the_method(method: str, exact: np.ndarray) -> None:
    coarse, fine = (np.abs(run(method, each) - exact).max() for each in (1, 2))
    assert coarse / fine == pytest.approx(2.0 ** ORDER[method], rel=0.15)
    assert fine < {"euler": 0.1, "heun": 2e-3, "midpoint": 2e-3, "rk4": 1e-7}[method]


@pytest.mark.parametrize("method", ORDER)
def test_derivatives_are_those_of_the_step(method: str) -> None:
    model = Model("swing", Rope, Swing, discretised(rates, method))
    found = sensitivities(
        Machine(model, P),
        {"torque": TORQUE},
        RATE,
        parameters=["length", "start.arm.angle"],
        begin=BEGIN,
    )["arm.angle"]
    step = 1e-5
    by_length = (run(method, 1, Rope(1.0 + step, 0.3)) - run(method, 1, Rope(1.0 - step, 0.3)))[
        :, 0
    ]
    assert found[:, 0] == pytest.approx(by_length / (2.0 * step), abs=1e-9)
    assert np.abs(found[:, 0]).max() > 0.1
    assert found[0, 1] == 1.0


def test_an_end_stop_holds_and_has_no_derivative() -> None:
    step = discretised(rates, "heun", substeps=3, project=stopped)
    model = Model("swing", Rope, Swing, step, given=Wall)
    swing = Machine(model, P, given=Wall(0.35))
    angle = simulate(swing, {"torque": 4.0 * TORQUE}, RATE, begin=BEGIN)["arm.angle"]
    assert angle[-1] == angle.max() == 0.35
    found = sensitivities(swing, {"torque": 4.0 * TORQUE}, RATE, parameters=["drag"], begin=BEGIN)
    by = found["arm.angle"]
    assert (by[angle == 0.35] == 0.0).all()
    assert by[10, 0] != 0.0


@equation
def leaves_out(state: Swing, torque: float) -> Arm:
    return state.arm


@equation
def of_the_step(state: Arm, h: float) -> Arm:
    return Arm(state.angle * h, 0.0)


@pytest.mark.parametrize(
    ("equations", "options", "sentence"),
    [
        ((rates, "rk5"), {}, "method 'rk5'; .* euler, heun, midpoint, rk4"),
        ((rates,), {"substeps": 0}, "substeps .* 0, .* whole number"),
        ((leaves_out,), {}, "leaves_out .* state"),
        ((of_the_step,), {}, "of_the_step .* 'h', .* samples"),
    ],
)
def test_what_is_no_right_hand_side_is_refused(equations, options, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        discretised(*equations, **options)
