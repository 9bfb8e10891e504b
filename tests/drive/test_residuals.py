"""Residuals against plain simulations, the Jacobian against differences, the triangle against both.

Extrapolated differences of the residuals are the reference.
"""

import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from tests.drive.experiments import HARD, RATE, SWING, jacobian, residuals, triangle

from swashplate import DomainError, Drive, InputError, ParameterError, maneuvers
from swashplate.drive import ALL_COLUMNS, PUMP_COLUMNS, simulate_drive
from swashplate.machine.marching import Observation, ObservedRecord, RunValues, record_of

CARD = ("current", "current_sum", "current_positive", "current_negative")
PUMP = ("shaft_speed", "shaft_position", "stroker_pressure", "swash_angle", "spool_position")
OBSERVABLE = (*CARD, *PUMP)


SCENES = {
    "hoist, hard": (HARD, {}, "rest"),
    "hoist, steady start": (3.0 + SWING, {}, "steady"),
    "spool stop": (2.5 * SWING, {"Z14": 1.05e-4}, "rest"),
    "relief valve": (HARD, {"Z15": 3e5}, "rest"),
    "one way": (np.abs(2.0 * SWING), {}, "rest"),
}


def observed_at_samples(command: np.ndarray, start: str = "rest", signals=OBSERVABLE, **more):
    time = np.arange(command.size) / RATE
    seen = [Observation(signal, time, np.zeros(time.size)) for signal in signals]
    return ObservedRecord(record_of(command, RATE, what="voltage"), seen, start=start, **more)


def simulated(run, signal: str) -> np.ndarray:
    if signal == "current_sum":
        return run.current_positive + run.current_negative
    return getattr(run, signal)


@pytest.mark.traced
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES.keys())
def test_signals_are_those_of_a_simulation_to_the_last_bit(scene) -> None:
    command, changes, start = scene
    drive = Drive.preset("hoist").replace(**changes)
    observed = observed_at_samples(command, start)
    run, found = drive.simulate(command, start=start), residuals(drive.parameters, observed)
    for number, signal in enumerate(OBSERVABLE):
        assert np.array_equal(found[observed.rows_of(number)], simulated(run, signal)), signal


@pytest.mark.traced
def test_a_current_drives_the_pump_alone(hoist: Drive) -> None:
    run = hoist.simulate(2.0 * SWING)
    current = np.array(run.current)
    time = np.arange(current.size) / RATE
    observed = ObservedRecord(
        record_of(current, RATE, what="current"),
        [Observation(signal, time, np.zeros(time.size)) for signal in OBSERVABLE],
        driven_by="current",
    )
    alone = hoist.simulate_current(current)
    found = jacobian(hoist.parameters, observed, ALL_COLUMNS)
    for number, signal in enumerate(OBSERVABLE):
        assert np.array_equal(found.residuals[observed.rows_of(number)], simulated(alone, signal))
    by = hoist.sensitivities_current(current)
    speed = found.columns[observed.rows_of(OBSERVABLE.index("shaft_speed"))]
    close(speed[:, : len(PUMP_COLUMNS)], by["shaft_speed"])
    assert (speed[:, len(PUMP_COLUMNS) :] == 0.0).all()
    for signal in CARD:
        assert (found.columns[observed.rows_of(OBSERVABLE.index(signal))] == 0.0).all()


def close(found: np.ndarray, expected: np.ndarray, tolerance: float = 1e-11) -> None:
    """Columns agree by the scale of each."""
    scale = np.abs(expected).max(axis=0)
    error = np.abs(found - expected).max(axis=0)
    assert (error <= tolerance * scale).all(), (error / np.where(scale > 0.0, scale, 1.0)).max()


def everything_observed(command: np.ndarray, start: str = "rest") -> ObservedRecord:
    """All signals off the grid, some with a free offset."""
    rng = np.random.default_rng(0)
    seen = []
    for signal in OBSERVABLE:
        time = (np.arange(3, command.size - 6, 3) + rng.uniform(0.1, 0.9)) / RATE
        weight = rng.uniform(0.5, 2.0, time.size)
        weight[20:30] = 0.0
        seen.append(
            Observation(
                signal,
                time,
                rng.normal(size=time.size),
                weight=weight,
                free_offset=signal in ("shaft_position", "shaft_speed"),
            )
        )
    return ObservedRecord(record_of(command, RATE, what="voltage"), seen, start=start)


OWN = RunValues({"pump.pressure": 2e4}, offsets=(0.0, 0.0, 0.0, 0.0, 0.1, -0.2, 0.0, 0.0, 0.0))


def test_derivatives_by_what_is_an_experiments_own(hoist: Drive) -> None:
    """By offsets that of the weights, by the pressure at the start that of differences."""
    observed = everything_observed(HARD)
    found = jacobian(hoist.parameters, observed, ["Z8", "start.pump.pressure"], OWN)
    assert found.names == ("Z8", "start.pump.pressure", *observed.own_columns)
    assert np.array_equal(found.residuals, residuals(hoist.parameters, observed, OWN))
    for column, signal in zip(found.columns.T[2:], ("shaft_speed", "shaft_position"), strict=True):
        number = OBSERVABLE.index(signal)
        expected = np.zeros(column.size)
        expected[observed.rows_of(number)] = observed.observations[number].weight
        np.testing.assert_allclose(column, expected, rtol=1e-14)

    def at(pressure: float) -> np.ndarray:
        return residuals(
            hoist.parameters, observed, OWN._replace(start={"pump.pressure": pressure})
        )

    slope = (8.0 * (at(2e4 + 20.0) - at(2e4 - 20.0)) - (at(2e4 + 40.0) - at(2e4 - 40.0))) / 240.0
    error = np.abs(found.columns[:, 1] - slope)
    for number in range(len(OBSERVABLE)):
        rows = observed.rows_of(number)
        largest = np.abs(found.columns[rows, 1]).max()
        assert (error[rows] > 1e-5 * largest + 1e-12).mean() < 0.005, OBSERVABLE[number]


@pytest.mark.traced
def test_residuals_at_any_stamps(hoist: Drive) -> None:
    """On the grid, between its points, and outside the record, where the ends are held."""
    command = maneuvers.step(4.0, start=0.1, stop=0.6, length=1.0).sample(100.0)
    run = hoist.simulate(command, 100.0)
    fine = hoist.simulate_current(run.fine("current"), 600.0)
    time = np.array([-1.0, 0.0, 0.07, 0.07 + 0.25 / 600.0, 0.5, 0.5, 5.0])
    observed = ObservedRecord(
        record_of(command, 100.0, what="voltage"),
        [
            Observation("shaft_speed", time, np.arange(7.0), weight=2.0, free_offset=True),
            Observation("shaft_speed", time, np.zeros(7), free_offset=True),
        ],
    )
    assert observed.own_columns == ("offset of shaft_speed [0]", "offset of shaft_speed [1]")
    assert observed.rows_of(1) == slice(7, 14)
    found = residuals(hoist.parameters, observed, RunValues({}, (0.5, 0.0)))
    seen = np.interp(time, fine.time, fine.shaft_speed)
    expected = 2.0 * (seen + 0.5 - np.arange(7.0))
    np.testing.assert_allclose(found[:7], expected, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found[7:], seen, rtol=0.0, atol=1e-12)


@pytest.mark.traced
@pytest.mark.parametrize("start", ["rest", "steady"])
def test_a_start_pressure_is_that_of_a_simulation(hoist: Drive, start: str) -> None:
    observed, own = observed_at_samples(3.0 + SWING, start), RunValues({"pump.pressure": -5e4})
    found = residuals(hoist.parameters, observed, own)
    run = simulate_drive(hoist.parameters, {"voltage": observed.record}, start, -5e4)
    assert run.stroker_pressure[0] == -5e4
    for number, signal in enumerate(OBSERVABLE):
        assert np.array_equal(found[observed.rows_of(number)], simulated(run, signal)), signal


FREE = ("Z8", "G1", "Z16", "tau", "Z6", "start.pump.pressure", "Z10", "Z12", "lim1_minus")


@pytest.mark.parametrize("columns", [FREE, ALL_COLUMNS, ()], ids=["some", "all", "own alone"])
@pytest.mark.parametrize("name", ["hoist, hard", "one way"])
def test_triangle_is_the_qr_of_the_jacobian(name: str, columns: tuple) -> None:
    command, changes, start = SCENES[name]
    drive, observed = Drive.preset("hoist").replace(**changes), everything_observed(command, start)
    whole = jacobian(drive.parameters, observed, columns, OWN)
    found = triangle(drive.parameters, observed, columns, OWN)
    assert found.names == whole.names
    matrix = np.column_stack([whole.columns, whole.residuals])
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0.0] = 1.0
    factor = found.factor
    assert np.array_equal(factor, np.triu(factor))
    products = (factor.T @ factor - matrix.T @ matrix) / np.outer(size, size)
    assert np.abs(products).max() < 1e-12
    expected = np.linalg.svd(matrix / size, compute_uv=False)
    np.testing.assert_allclose(
        np.linalg.svd(factor / size, compute_uv=False), expected, atol=1e-12 * expected[0]
    )


@pytest.mark.traced
def test_where_a_record_ends_does_not_count(hoist: Drive) -> None:
    """After a few samples, or about the end of a block of 512."""
    columns = ["Z8", "G1_plus", "Z10"]
    longest = observed_at_samples(3.0 + SWING[:1100], "steady", ["shaft_speed"])
    whole = jacobian(hoist.parameters, longest, columns)
    for samples in (1, 2, 3, 511, 512, 513, 1024, 1025):
        observed = observed_at_samples(3.0 + SWING[:samples], "steady", ["shaft_speed"])
        found = jacobian(hoist.parameters, observed, columns)
        assert np.array_equal(found.rows, whole.rows[:, :samples])
        triangle(hoist.parameters, observed, ["Z8"])


def test_a_triangle_needs_no_memory_for_the_jacobian(hoist: Drive) -> None:
    command = np.tile(SWING, 60)
    observed = observed_at_samples(command, signals=["shaft_speed"])
    short = observed_at_samples(SWING, signals=["shaft_speed"])
    residuals(hoist.parameters, observed)  # where the observations look is kept with them
    triangle(hoist.parameters, short, PUMP_COLUMNS)  # whatever else is made once
    tracemalloc.start()
    triangle(hoist.parameters, observed, PUMP_COLUMNS)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3e6 < 8 * command.size * len(PUMP_COLUMNS)


def test_threads_do_not_disturb_each_other(hoist: Drive) -> None:
    tests = [observed_at_samples(level * SWING, signals=["shaft_speed"]) for level in (1, 2, 3)]
    columns = ["Z8", "Z16", "G1"]
    alone = [triangle(hoist.parameters, each, columns).factor for each in tests]
    with ThreadPoolExecutor(3) as pool:
        found = pool.map(lambda each: triangle(hoist.parameters, each, columns).factor, 20 * tests)
        assert all(np.array_equal(a, b) for a, b in zip(found, 20 * alone, strict=True))


def test_refusals(hoist: Drive) -> None:
    observed = observed_at_samples(HARD, signals=["shaft_speed"])
    with pytest.raises(InputError, match="Z16_plus .* twice"):
        jacobian(hoist.parameters, observed, ["Z16", "Z16_plus"])
    with pytest.raises(InputError, match="signal 'torque'"):
        residuals(hoist.parameters, observed_at_samples(HARD, signals=["torque"]))
    with pytest.raises(ParameterError, match="parameter 'Z99'"):
        triangle(hoist.parameters, observed, ["Z99"])
    with pytest.raises(DomainError, match="pressure .* 1e.07 Pa"):
        residuals(hoist.parameters, observed, RunValues({"pump.pressure": 1e7}))
