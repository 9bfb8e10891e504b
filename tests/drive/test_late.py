"""A drive whose spool is late behind the current, against the drive behind a late current."""

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.drive.experiments import RATE, SWING

from swashplate import Drive, InputError, ParameterError, linearize, maneuvers

Array = NDArray[np.float64]
STEP = 1.0 / RATE
DELAY, LAG = 0.0401, 0.015
"""A delay that is no whole number of samples, and a lag. [s]"""


def late(current: Array, delay: float, lag: float, before: float = 0.0) -> Array:
    """A current through a delay line, straight between samples, and a lag, exactly integrated."""
    time = np.arange(current.size) * STEP
    delayed = np.interp(time - delay, time, current, left=before)
    if lag == 0.0:
        return delayed
    out, y, u = np.empty_like(delayed), before, before
    for n, value in enumerate(delayed):
        # y' = (u - y)/lag under u + slope t: a straight line lag behind, and what dies away
        slope = (value - u) / STEP
        y = value - slope * lag + (y - u + slope * lag) * np.exp(-STEP / lag)
        out[n], u = y, value
    return out


@pytest.mark.parametrize(("delay", "lag"), [(DELAY, 0.0), (0.0, LAG), (DELAY, LAG), (7e-4, 0.3)])
@pytest.mark.parametrize("start", ["rest", "steady"])
@pytest.mark.parametrize("fed_by", ["voltage", "current"])
def test_it_is_the_drive_behind_a_late_current(
    hoist: Drive, delay: float, lag: float, start: str, fed_by: str
) -> None:
    drive = hoist.replace(solenoid_delay=delay, solenoid_lag=lag)
    if fed_by == "voltage":
        run = drive.simulate(SWING + 2.0, RATE, start=start)
        current = hoist.simulate(SWING + 2.0, RATE, start=start).current
    else:
        current = 0.4 * np.sin(np.arange(900) / 30.0) + (0.3 if start == "steady" else 0.0)
        run = drive.simulate_current(current, RATE, start=start)
    assert np.array_equal(run.current, current)
    before = current[0] if start == "steady" else 0.0
    expected = hoist.simulate_current(late(current, delay, lag, before), RATE, start=start)
    for name in ("solenoid_force", "spool_position", "shaft_speed", "shaft_position"):
        size = np.abs(expected[name]).max()
        assert np.abs(run[name] - expected[name]).max() <= 1e-10 * size, name
    if start == "steady":
        assert run.shaft_speed[0] == pytest.approx(hoist.steady_speed(SWING[0] + 2.0)) or (
            fed_by == "current"
        )


def test_off_it_is_not_there(axis: Drive) -> None:
    command = maneuvers.step(4.0).sample(RATE)
    off = axis.replace(solenoid_delay=0.0, solenoid_lag=0.0)
    assert off.parameters.refinements == ()
    run = off.simulate(command)
    assert not run.refined
    assert np.array_equal(run.shaft_speed, axis.simulate(command).shaft_speed)
    assert off.steady_speed(4.0) == axis.steady_speed(4.0)
    assert axis.replace(solenoid_delay=0.04, solenoid_lag=0.1).steady_speed(
        4.0
    ) == axis.steady_speed(4.0)


def test_a_number_of_it_at_zero_leaves_the_other(hoist: Drive) -> None:
    """Bit for bit the limit: a delay or a lag that is all but none."""
    command = maneuvers.step(4.0).sample(RATE)
    for name in ("solenoid_delay", "solenoid_lag"):
        one = hoist.replace(**{name: 0.02}).simulate(command)
        other = ({"solenoid_delay", "solenoid_lag"} - {name}).pop()
        both = hoist.replace(**{name: 0.02, other: 1e-12}).simulate(command)
        assert np.abs(one.shaft_speed - both.shaft_speed).max() < 1e-9


@pytest.mark.parametrize(("delay", "lag"), [(DELAY, LAG), (4e-4, LAG), (DELAY, 0.0)])
@pytest.mark.parametrize("start", ["rest", "steady"])
def test_derivatives_are_those_of_differences(
    hoist: Drive, delay: float, lag: float, start: str
) -> None:
    """By both numbers, and by numbers of the card, whose currents' past counts."""
    drive = hoist.replace(solenoid_delay=delay, solenoid_lag=lag)
    command = 3.0 + 1.5 * np.sin(np.arange(900) / 40.0)
    names = ["solenoid_delay", "solenoid_lag", "tau", "G1_plus", "omega_plus", "Z8"]
    found = drive.sensitivities(command, parameters=names, start=start)["shaft_position"]
    for column, name in zip(found.T, names, strict=True):
        value = drive.parameters.numbers.get(name, 0.0)
        by = 1e-5 * max(abs(value), 1e-3)
        low, high = max(value - by, 0.0), value + by
        ends = [
            drive.replace(**{name: each}).simulate(command, start=start).shaft_position
            for each in (low, high)
        ]
        difference = (ends[1] - ends[0]) / (high - low)
        assert np.abs(column - difference).max() <= 1e-5 * np.abs(difference).max(), name


def test_many_at_once_are_each_by_itself(hoist: Drive) -> None:
    delays, lags = [0.0, 0.04, 0.0401, 0.0], [0.0, 0.0, 0.015, 0.02]
    batch = hoist.simulate_many({"solenoid_delay": delays, "solenoid_lag": lags}, voltage=SWING)
    for output, delay, lag in zip(batch.output, delays, lags, strict=True):
        one = hoist.replace(solenoid_delay=delay, solenoid_lag=lag).simulate(SWING)
        assert np.array_equal(output, one.shaft_speed)


@pytest.mark.interpreted
def test_a_stepper_returns_to_an_instant_with_what_is_on_its_way(hoist: Drive) -> None:
    drive = hoist.replace(solenoid_delay=DELAY, solenoid_lag=LAG)
    run = drive.simulate(SWING[:400])
    walker = drive.stepper()
    first = [walker.step(v).shaft_speed for v in SWING[:200]]
    kept = walker.state
    for _ in range(100):
        walker.step(-5.0)
    walker.state = kept
    first += [walker.step(v).shaft_speed for v in SWING[200:400]]
    assert np.array_equal(first, run.shaft_speed)


# --- linear models --------------------------------------------------------------------------------


def test_the_linear_model_has_the_delay_and_the_lag(hoist: Drive) -> None:
    drive = hoist.replace(solenoid_delay=DELAY, solenoid_lag=LAG)
    plain, model = hoist.linearize(4.0), drive.linearize(4.0)
    assert model.delay == plain.delay + DELAY
    assert "lagged_current" in model.states
    f = np.array([0.1, 1.0, 5.0])
    s = 2j * np.pi * f
    expected = plain.response(f) * np.exp(-s * DELAY) / (1.0 + s * LAG)
    np.testing.assert_allclose(model.response(f), expected, rtol=1e-9)
    assert model.largest_gain < 0.5 * plain.largest_gain
    shown = " ".join(model.summary().split())
    assert "delay of the card 14.000 ms" in shown
    assert "delay of the solenoids 40.100 ms lag of the solenoids 15.000 ms" in shown
    assert "solenoids" not in plain.summary()
    assert drive.linearize(current=0.45).delay == DELAY
    assert drive.linearize(4.0, input="solenoid_force").delay == 0.0
    current = drive.linearize(4.0, outputs="current")
    assert current.delay == plain.delay
    with pytest.raises(InputError, match="current is not behind .* 0.0401 s.* by itself"):
        drive.linearize(4.0, outputs=("current", "shaft_speed"))


def test_it_answers_a_small_sine_as_the_simulation(hoist: Drive) -> None:
    drive = hoist.replace(solenoid_delay=DELAY, solenoid_lag=LAG)
    swept = drive.frequency_response([1.0, 4.0], [1e-3], bias=4.0, tolerance=1e-6)
    exact = drive.linearize(4.0).discrete(RATE).response([1.0, 4.0])[0]
    np.testing.assert_allclose(swept.ratio[0], exact, rtol=3e-5)


def test_a_loop_at_its_largest_gain_swings(hoist: Drive) -> None:
    """The margin that a controller is designed by: a little below it decays, above it grows."""
    drive = hoist.replace(solenoid_delay=DELAY, solenoid_lag=LAG)
    model = drive.linearize(4.0).discrete(RATE, "previous")
    most = model.margins(lambda f: np.exp(-2j * np.pi * f * STEP)).gain_margin
    for part, grows in ((0.97, False), (1.03, True)):
        walker = drive.stepper(RATE, interpolation="previous", start="steady")
        sample = walker.step(4.0)
        begun, errors = sample.shaft_speed, []
        for _ in range(12 * 512):
            errors.append(begun + np.radians(0.02) - sample.shaft_speed)
            sample = walker.step(4.0 + part * most * errors[-1])
        assert (np.ptp(errors[-512:]) > np.ptp(errors[1024:1536])) == grows


def test_current_and_speed_in_one_model_of_a_machine(hoist: Drive) -> None:
    """Sampled, past currents are states: outputs before and behind the delay go together."""
    drive = hoist.replace(solenoid_delay=DELAY, solenoid_lag=LAG)
    model = linearize(drive, {"voltage": 4.0}, RATE, outputs=["current", "shaft_speed"])
    u = 1e-5 * np.hanning(60)
    u = np.concatenate([u, np.zeros(240)])
    run = drive.simulate(4.0 + u, start="steady")
    whole = round(model.delay * RATE)
    x, y = np.zeros(len(model.states)), []
    for value in np.concatenate([np.zeros(whole), u])[: u.size]:
        y.append(model.C @ x + model.D[:, 0] * value)
        x = model.A @ x + model.B[:, 0] * value
    for k, name in enumerate(("current", "shaft_speed")):
        moved = run[name] - run[name][0]
        assert np.abs(moved - np.array(y)[:, k]).max() < 1e-4 * np.abs(moved).max()


def test_refusals(hoist: Drive) -> None:
    for name in ("solenoid_delay", "solenoid_lag"):
        with pytest.raises(ParameterError, match=f"{name} .* is -0.1 s"):
            hoist.replace(**{name: -0.1})
        with pytest.raises(ParameterError, match=name):
            hoist.replace(**{name: 11.0})
