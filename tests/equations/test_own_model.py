"""A model of one's own, marched, differentiated and batched like the package's drives."""

from math import cos, exp, sin
from typing import NamedTuple

import numpy as np
import pytest

from swashplate import InputError
from swashplate.equations import equation
from swashplate.equations.model import Model, Tap, join
from swashplate.equations.use import sensitivities, simulate
from swashplate.simulation.batch import simulate_many


class Valve(NamedTuple):
    lag: float
    overlap: float
    gain: float
    delay: float


class Rod(NamedTuple):
    opening: float
    position: float


class Share(NamedTuple):
    share: float


class Stroke(NamedTuple):
    low: float
    high: float


@equation
def constants(p: Valve, h: float) -> Share:
    return Share(1.0 - exp(-h / p.lag))


@equation
def step(state: Rod, command: float, p: Valve, k: Share, h: float, given: Stroke) -> Rod:
    opening = state.opening + k.share * (command - state.opening)
    flow = max(opening - p.overlap, 0.0) + min(opening + p.overlap, 0.0)
    position = state.position + h * p.gain * flow
    return Rod(opening, min(max(position, given.low), given.high))


valve = Model(
    "valve",
    parameters=Valve,
    state=Rod,
    step=step,
    constants=constants,
    given=Stroke,
    taps={"command": Tap("command", delay="delay", hold="mean")},
)
P, STROKE, RATE = Valve(0.05, 0.1, 0.4, 0.033), Stroke(-1.0, 1.0), 100.0
COMMAND = np.sin(np.arange(300) / 25.0) + 0.3


def by_hand(p: Valve) -> np.ndarray:
    """The same equations in a loop of plain Python, the mean of the command by integration."""
    at = np.arange(COMMAND.size + 1) / RATE
    padded = np.concatenate([[0.0], COMMAND])
    times = np.concatenate([[-1.0 / RATE], at[:-1]])
    fine = np.arange(-10_000, COMMAND.size * 1000) / (1000.0 * RATE)
    value = np.interp(fine, times, padded, left=0.0)
    total = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(fine))])
    opening, position, found = 0.0, 0.0, []
    for n in range(COMMAND.size):
        found.append(position)
        ends = np.interp([(n - 1) / RATE - p.delay, n / RATE - p.delay], fine, total)
        mean = (ends[1] - ends[0]) * RATE
        opening += (1.0 - exp(-1.0 / RATE / p.lag)) * (mean - opening)
        flow = max(opening - p.overlap, 0.0) + min(opening + p.overlap, 0.0)
        position = min(max(position + p.gain * flow / RATE, STROKE.low), STROKE.high)
    return np.array(found)


def test_simulation_is_the_loop_by_hand() -> None:
    run = simulate(valve, P, {"command": COMMAND}, RATE, given=STROKE)
    assert run["position"] == pytest.approx(by_hand(P), abs=1e-9)
    assert run.names == ("command", "opening", "position")


@pytest.mark.parametrize("name", Valve._fields)
def test_derivatives_are_those_of_differences(name: str) -> None:
    found = sensitivities(
        valve, P, {"command": COMMAND}, RATE, output="position", parameters=[name], given=STROKE
    )[:, 0]
    value = getattr(P, name)
    ends = []
    for factor in (1.0 + 1e-5, 1.0 - 1e-5):
        moved = P._replace(**{name: value * factor})
        ends.append(simulate(valve, moved, {"command": COMMAND}, RATE, given=STROKE)["position"])
    assert found == pytest.approx((ends[0] - ends[1]) / (2e-5 * value), rel=1e-5, abs=1e-6)
    assert np.abs(found).max() > 0.0


def test_where_the_state_begins_has_a_derivative() -> None:
    found = sensitivities(
        valve,
        P,
        {"command": COMMAND},
        RATE,
        output="position",
        parameters=["start.position"],
        given=STROKE,
        begin={"position": 0.1},
    )
    assert found[:, 0] == pytest.approx(np.ones(COMMAND.size))


def test_many_sets_are_each_alone_to_the_last_bit() -> None:
    gains = np.linspace(0.1, 0.9, 19)
    free = Model("lagged", Valve, Rod, lagged)
    rows = simulate_many(
        free, P, {"gain": gains}, {"command": COMMAND}, RATE, output="position"
    ).output
    for gain, row in zip(gains, rows, strict=True):
        alone = simulate(free, P._replace(gain=float(gain)), {"command": COMMAND}, RATE)
        assert (alone["position"] == row).all()


def test_a_library_and_decisions_leave_the_bits_of_many_sets_alone() -> None:
    model = Model("wobbling", Valve, Rod, wobbling)
    changes = {"gain": np.linspace(0.1, 0.9, 21), "lag": np.linspace(0.04, 0.08, 21)}
    changes["overlap"] = np.linspace(-0.2, 0.2, 21)
    rows = simulate_many(model, P, changes, {"command": COMMAND}, RATE, output="position").output
    for i, row in enumerate(rows):
        p = P._replace(**{name: float(values[i]) for name, values in changes.items()})
        alone = simulate(model, p, {"command": COMMAND}, RATE)["position"]
        assert (alone == row).all()


@equation
def wobbling(state: Rod, command: float, p: Valve, h: float) -> Rod:
    left = exp(-h / p.lag) if p.lag > 0.05 else exp(-h / 0.05)
    far = abs(command) > p.overlap and (state.position > 0.1 or state.opening < 0.2)
    swing = 0.0
    if far:
        swing = sin(state.position) / (1.0 + cos(state.opening) ** 2)
    target = command + swing if far else p.overlap
    opening = left * state.opening + (1.0 - left) * target
    return Rod(opening, state.position + h * p.gain * opening**3 / (p.overlap + 0.5))


@equation
def lagged(state: Rod, command: float, p: Valve, h: float) -> Rod:
    opening = state.opening + h / p.lag * (command - state.opening)
    return Rod(opening, state.position + h * p.gain * opening)


def test_models_in_series_are_one_after_the_other() -> None:
    first = Model("first", Valve, Rod, lagged)
    second = Model("second", Valve, Rod, lagged, taps={"command": Tap("position", width=0)})
    both = join("both", first, second)
    alone = simulate(first, P, {"command": COMMAND}, RATE)
    assert both.external == ("command",)
    run = simulate(both, both.parameters(P, P), {"command": COMMAND}, RATE)
    assert run["position"].shape == alone["position"].shape


def test_bad_inputs_are_named() -> None:
    with pytest.raises(InputError, match="no input 'voltage'; it has command"):
        simulate(valve, P, {"voltage": COMMAND}, RATE, given=STROKE)
    with pytest.raises(InputError, match="must be a Valve"):
        simulate(valve, STROKE, {"command": COMMAND}, RATE, given=STROKE)
    bad = COMMAND.copy()
    bad[3] = np.nan
    with pytest.raises(InputError, match="command is nan at sample 3"):
        simulate(valve, P, {"command": bad}, RATE, given=STROKE)
    with pytest.raises(InputError, match="no parameter 'lead'"):
        sensitivities(
            valve,
            P,
            {"command": COMMAND},
            RATE,
            output="position",
            parameters=["lead"],
            given=STROKE,
        )
