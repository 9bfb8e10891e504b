"""What a fit leaves open of its numbers, of a motion, and of the band about a simulation."""

from collections.abc import Mapping

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.identification.given import TIME, run_of, virtual

from swashplate import Campaign, Drive, Identification, identify, maneuvers, rig
from swashplate.identification import (
    Posterior,
    assess_fit,
    drawn_drive,
    posterior_of,
    predict,
    whole_drive,
)
from swashplate.identification.estimation.posterior import mean_square_bound
from swashplate.maneuvers import parse

HOIST = Drive.preset("hoist")


@given(st.integers(0, 10_000), st.integers(1, 12))
@settings(max_examples=20, deadline=None)
def test_nine_of_ten_draws_stay_below_the_bound(seed: int, sources: int) -> None:
    rng = np.random.default_rng(seed)
    errors = rng.normal(size=(40, sources)) * rng.lognormal(sigma=1.5, size=sources)
    draws = rng.normal(size=(4000, sources))
    squares = np.mean((draws @ errors.T) ** 2, axis=1)
    below = np.mean(squares <= mean_square_bound(errors, 0.9))
    assert below == pytest.approx(0.9, abs=0.03)


def test_nothing_is_left_open_of_what_is_known() -> None:
    assert mean_square_bound(np.zeros((5, 0)), 0.9) == 0.0
    assert mean_square_bound(np.zeros((5, 3)), 0.9) == 0.0


class Ramp:
    """A model that is a number times time, and another one."""

    def simulate(self, values: Mapping[str, float], experiment) -> dict[str, np.ndarray]:
        return {"speed": values["slope"] * experiment["speed"].time + values["zero"]}


def test_errors_of_numbers_are_those_of_what_is_simulated() -> None:
    changes = np.array([[0.3, 0.0], [0.1, 0.2]])
    posterior = Posterior(("slope", "zero"), changes)
    run = run_of("a", np.sin(TIME), {"speed": TIME}, time=TIME)
    errors = posterior.errors_of(Ramp(), {"slope": 2.0, "zero": 1.0}, run)["speed"]
    expected = np.column_stack([0.3 * TIME + 0.1, np.full(TIME.size, 0.2)])
    np.testing.assert_allclose(errors, expected, atol=1e-6)
    np.testing.assert_allclose(posterior.covariance, [[0.09, 0.03], [0.03, 0.05]])


@pytest.fixture(scope="module")
def two_numbers(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    tests = rig.run("hoist", {"step": maneuvers.step(9.0), "sine": maneuvers.sine(9.0, 0.1)})
    file = rig.write(tests, tmp_path_factory.mktemp("two"))
    return identify(file, "hoist", {"Z8": (0.5, 2), "Z10": (0.5, 2)})


def test_its_variances_are_those_of_the_estimates(two_numbers: Identification) -> None:
    posterior = posterior_of(two_numbers.fit)
    errors = dict(zip(posterior.names, np.sqrt(np.diag(posterior.covariance)), strict=True))
    assert set(errors) == {"Z8", "Z10"}
    for name, error in errors.items():
        assert error == pytest.approx(two_numbers[name].standard_error, rel=1e-6)


def test_a_stored_fit_has_the_same_band(two_numbers: Identification, tmp_path) -> None:
    two_numbers.save(tmp_path / "fitted")
    loaded = Identification.load(tmp_path / "fitted", two_numbers.campaign)
    command = maneuvers.sine(5.0, 0.3)
    fresh, stored = two_numbers.band(command), loaded.band(command)
    assert stored.reach == fresh.reach
    np.testing.assert_allclose(stored.half_width, fresh.half_width, rtol=1e-9)
    np.testing.assert_array_equal(stored.speed, two_numbers.drive.simulate(command).shaft_speed)
    frame = fresh.to_polars()
    assert frame.columns == ["time", "shaft_speed", "shaft_speed_lower", "shaft_speed_upper"]
    assert frame.select((pl.col("shaft_speed_lower") <= pl.col("shaft_speed")).all()).item()


MANEUVERS = [
    *(parse(f"step:{volts},length=6") for volts in (9, -9, 4, -4)),
    parse("sine:6,0.1,length=15"),
    parse("sine:3,0.2,length=10"),
]
NEW = ("step:1", "step:-1", "sine:5,0.5", "ramp:2,length=6")


@pytest.fixture(scope="module")
def truth() -> Drive:
    return drawn_drive(HOIST, whole_drive(HOIST.parameters), seed=8, spread=0.1)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory, truth: Drive) -> Campaign:
    folder = tmp_path_factory.mktemp("encoder")
    return virtual(
        folder, "hoist", MANEUVERS, truth=truth, seed=8, channels=("encoder_counts",), validate=()
    )


@pytest.fixture(scope="module")
def encoder_alone(campaign: Campaign) -> Identification:
    return identify(campaign)


@pytest.mark.slow
@pytest.mark.parametrize("name", NEW)
def test_the_machine_lies_in_the_band(
    encoder_alone: Identification, truth: Drive, name: str
) -> None:
    command = parse(name)
    band = encoder_alone.band(command)
    measured = truth.simulate(command).shaft_speed
    inside = (band.lower <= measured) & (measured <= band.upper)
    assert np.mean(inside) > 0.9
    # and it is no band of everything
    assert np.sqrt(np.mean(band.half_width**2)) < 0.1 * np.ptp(measured)


@pytest.mark.slow
def test_a_motion_beyond_the_tests_is_known_less(encoder_alone: Identification) -> None:
    prediction = encoder_alone.verdict.error
    assert [part.motion for part in prediction.beyond] == ["a sine of 0.5 Hz"]
    slow, fast = (encoder_alone.band(maneuvers.sine(8.0, hertz)) for hertz in (0.1, 1.0))
    assert np.mean(fast.half_width) > np.mean(slow.half_width)


@pytest.mark.slow
def test_a_run_that_is_predicted_has_its_band(
    encoder_alone: Identification, truth: Drive, tmp_path
) -> None:
    command = [parse("sine:8,0.6,length=8")]
    tests = virtual(
        tmp_path,
        "hoist",
        command,
        truth=truth,
        seed=9,
        channels=("encoder_counts",),
        validate=(),
    )
    (quality,) = predict(encoder_alone.drive, tests.experiments, encoder_alone.posterior)
    assert quality.left_open is not None
    assert quality.left_open.shape[0] == quality.simulated.size
    assert predict(encoder_alone.drive, tests.experiments)[0].left_open is None
    of_fit = encoder_alone.verdict
    # faster than all that was fitted, and predicted within what was left open
    assert assess_fit(None, [quality], of_fit=of_fit).sound
