"""Steps and rates: first order in h, and the same answer from any sampling of one maneuver."""

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest

from swashplate import Drive, InputError, maneuvers

FULL_SPEED = {"hoist": np.deg2rad(196.0), "slew": np.deg2rad(4.242), "luff": np.deg2rad(155.9)}


def test_halving_the_step_halves_the_error(axis: Drive) -> None:
    smooth = maneuvers.sine(4.0, 0.2, start=0.1, length=6.0)
    voltage = smooth.sample(512.0)
    runs = [axis.simulate(voltage, substeps=m).shaft_speed for m in (1, 2, 4, 8)]
    # where the error is largest it falls by two each time, as a method of first order does
    errors = [np.abs(a - b).max() for a, b in itertools.pairwise(runs)]
    ratios = [a / b for a, b in itertools.pairwise(errors)]
    assert all(1.7 < ratio < 2.3 for ratio in ratios), ratios


@pytest.mark.parametrize(
    ("maneuver", "interpolation"),
    [
        (maneuvers.step(9.0), "previous"),
        (maneuvers.step(-4.0), "previous"),
        (maneuvers.sine(6.5, 0.1, length=20.0), "linear"),
        (maneuvers.ramp(1.0), "linear"),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_every_rate_gives_the_same_answer(
    axis: Drive, maneuver: maneuvers.Maneuver, interpolation: str
) -> None:
    """Within 0.5 % of full speed, compared at the samples that all rates share: each 0.25 s."""
    shared = []
    for rate in (100.0, 512.0, 1000.0, 10_000.0):
        run = axis.simulate(maneuver.sample(rate), rate, interpolation=interpolation)
        shared.append(run.shaft_speed[:: int(rate) // 4])
    spread = np.ptp(np.stack(shared), axis=0).max()
    assert spread < 0.005 * FULL_SPEED[axis.name]


@pytest.mark.parametrize("name", ["hoist", "slew"])
@pytest.mark.parametrize(
    "maneuver", [maneuvers.step(4.0, length=8.0), maneuvers.sine(4.0, 1.0, length=4.0)]
)
def test_the_filters_equation_answers_alike_at_every_rate(
    name: str, maneuver: maneuvers.Maneuver
) -> None:
    """Within 0.2 % of the largest current at 512 and 2048 Hz; Kruse's recursion is 2 % off."""
    voltage = maneuver.sample(512.0)
    coarse, fine = np.arange(voltage.size) / 512.0, np.arange(4 * voltage.size - 3) / 2048.0
    published = Drive(replace(Drive.preset(name).parameters, card_switch="split"))

    def spread(drive: Drive) -> float:
        one = drive.simulate(voltage).current
        four = drive.simulate(np.interp(fine, coarse, voltage), 2048.0).current[::4]
        return np.abs(one - four).max() / np.abs(one).max()

    anywhere = published.at_every_rate()
    assert anywhere.parameters.rate is None
    assert anywhere.at_every_rate() == anywhere
    assert spread(anywhere) < 2e-3
    assert spread(Drive(replace(published.parameters, rate=None))) < 2e-3
    assert spread(published) > 2e-2
    # with the recursion's poles the equation gives what the recursion gives at its own rate
    currents = [each.simulate(voltage).current for each in (anywhere, published)]
    assert np.abs(np.subtract(*currents)).max() < 7e-3 * np.abs(currents[0]).max()


def test_a_recursion_that_alternates_is_no_filter_of_another_rate() -> None:
    """By hand ωh = 0.7, ζ = 1.4: a pole at 1 - 0.98 - 0.7 √0.96 = -0.67."""
    drive = recursive(1.4).replace(omega=0.7 * 512.0)
    with pytest.raises(InputError, match="plus channel"):
        drive.at_every_rate()


@pytest.mark.parametrize("rate", [9.99, 100_001.0, float("nan"), 0.0, -512.0])
def test_rates_out_of_range_are_refused(hoist: Drive, rate: float) -> None:
    with pytest.raises(InputError, match="10 and 100000 Hz"):
        hoist.simulate([0.0, 1.0], rate)


def recursive(zeta: float) -> Drive:
    """The neutral drive with the recursion as its filter."""
    parameters = Drive.preset("neutral").parameters.with_numbers({"zeta": zeta})
    return Drive(replace(parameters, rate=512.0))


@pytest.mark.parametrize("zeta", [0.05, 0.3, 0.9, 1.0, 1.2, 5.0, 40.0])
def test_an_unstable_filter_is_refused_with_the_least_substeps_that_do(zeta: float) -> None:
    drive, voltage = recursive(zeta).replace(omega=1500.0), np.full(64, 5.0)
    with pytest.raises(InputError, match="zeta = .* omega = 1500 .* unstable") as refused:
        drive.simulate(voltage)
    least = int(re.findall(r"substeps=(\d+)", str(refused.value))[0])
    assert np.isfinite(drive.simulate(voltage, substeps=least).current).all()
    if least > 2:
        with pytest.raises(InputError, match="omega = 1500 .* unstable"):
            drive.simulate(voltage, substeps=least - 1)


@pytest.mark.parametrize("zeta", [1e300, 1e-5])
def test_a_filter_that_no_step_would_do_for_is_refused(zeta: float) -> None:
    with pytest.raises(InputError, match="zeta nearer to 1"):
        recursive(zeta).simulate(np.ones(10))


@pytest.mark.slow
def test_the_differential_equation_bears_half_a_swing_in_a_step() -> None:
    """By hand: ωh √(1 - ζ²) = π at ω = 512 π/0.8 = 2011 rad/s and ζ = 0.6."""
    drive, voltage = Drive.preset("neutral").replace(zeta=0.6, omega=2012.0), np.full(512, 5.0)
    with pytest.raises(InputError, match=r"1/512 s; .* substeps=2"):
        drive.simulate(voltage)
    slower = drive.replace(omega=2e3)
    for settled in (drive.simulate(voltage, substeps=2), slower.simulate(voltage)):
        assert settled.current[-1] == pytest.approx(0.015 * 5.0, rel=1e-9)
    with pytest.raises(InputError, match="lower omega"):
        drive.replace(omega=1e6).simulate(voltage)
    batch = drive.simulate_many({"omega": [2e3, 2012.0]}, voltage=voltage)
    assert list(batch.failures) == [1]
