"""A crew that damps by hand: what follows from delay, threshold and the pendulum alone."""

from dataclasses import replace
from math import cos, exp, log10, pi, radians, sin, sqrt

import numpy as np
import pytest

from swashplate.crane import (
    Crane,
    OperatorCommand,
    Scatter,
    Seaway,
    Spectrum,
    Study,
    control,
    linear_response,
    operability,
    simulate,
)
from swashplate.crane.studies import WORKABLE
from swashplate.errors import InputError

G = 9.80665
ROPE = 27.0
OWN = sqrt(G / ROPE)
PERIOD = 2.0 * pi / OWN
RATE = 512
ABEAM = {"slew_deg": 90.0, "rope_m": ROPE}
LINEAR = control.Crew(threshold_deg=0.0, gain=0.1, share=10.0, lag=0.01, return_time=1000.0)
"""Answers the least swing, with a quick arm, and leaves the tip where it is."""


@pytest.fixture(scope="module")
def crane():
    return Crane.preset("tg3637")


def free_swing(crane, crew, degrees_out=0.2, length=60.0, **how):
    """A load that swings along the boom on ideal drives and has no damping of its own."""
    options = {"actuation": "ideal", "swing_damping": 0.0, **ABEAM, **how}
    offset = (0.0, ROPE * sin(radians(degrees_out)))
    return simulate(
        crane, OperatorCommand.rest(length), control=crew, load_offset=offset, **options
    )


def peaks_of(run):
    swing = run.load[:, 1] - run.tip[:, 1]
    at = 1 + np.flatnonzero((swing[1:-1] > swing[:-2]) & (swing[1:-1] >= swing[2:]))
    return swing[at]


def decay_by_root(crew):
    """Ratio of successive peaks by the root near iω₀ of s² + K s e^(-sτ)/(1 + T s) + ω₀² = 0."""

    def value(s):
        return s * s + crew.gain * s * np.exp(-s * crew.delay) / (1.0 + crew.lag * s) + OWN**2

    s = 1j * OWN
    for _ in range(50):
        s -= value(s) * 2e-6 / (value(s + 1e-6) - value(s - 1e-6))
    assert abs(value(s)) < 1e-9
    return exp(2.0 * pi * s.real / s.imag)


# --- the operator ---------------------------------------------------------------------------------


def test_nothing_moves_before_the_delay_and_the_tip_moves_after_it(crane):
    for delay in (0.25, 0.5):
        tip = free_swing(crane, replace(LINEAR, delay=delay), length=2.0).tip
        moves = np.any(tip != tip[0], axis=1)
        # the swing is there at once, and a sample after the hand has moved the shaft has
        first = int(np.argmax(moves)) / RATE
        assert moves.any()
        assert delay <= first <= delay + 3.0 / RATE


def test_below_the_threshold_nothing_moves(crane):
    crew = control.Crew(threshold_deg=0.5)
    for actuation in ("ideal", "inverse"):
        seen, unseen = (
            free_swing(crane, crew, out, length=15.0, actuation=actuation) for out in (1.5, 0.49)
        )
        alone = free_swing(crane, None, 0.49, length=15.0, actuation=actuation)
        np.testing.assert_array_equal(unseen.tip, alone.tip)
        np.testing.assert_array_equal(unseen.load, alone.load)
        assert np.ptp(seen.tip[:, 1]) > 0.0


@pytest.mark.parametrize("slew", [0.0, 90.0, -120.0])
@pytest.mark.parametrize("toward", [0.0, 90.0, 200.0, 315.0])
def test_the_tip_goes_over_the_load(crane, slew, toward):
    """Whichever way the boom points, along it by the luff and across it by the slew."""
    out = np.array([cos(radians(toward)), sin(radians(toward))])
    run = simulate(
        crane,
        OperatorCommand.rest(2.0),
        control=replace(LINEAR, share=0.8),
        actuation="ideal",
        slew_deg=slew,
        rope_m=ROPE,
        load_offset=tuple(0.5 * out),
    )
    moved = (run.tip[-1] - run.tip[0])[:2]
    # a quarter of a metre a second for each metre of swing is less than either drive can do
    np.testing.assert_allclose(moved / np.linalg.norm(moved), out, atol=0.03)


@pytest.mark.parametrize("delay", [0.1, 0.3, 0.5])
def test_a_free_swing_is_damped_as_the_delayed_equation_says(crane, delay):
    crew = replace(LINEAR, delay=delay)
    peaks = peaks_of(free_swing(crane, crew))[1:5]
    wanted = decay_by_root(crew)
    assert wanted < 1.0
    np.testing.assert_allclose(peaks[1:] / peaks[:-1], wanted, atol=0.01)
    # a small gain: ζ = K cos(ω₀ τ)/(2 ω₀), with the arm's lag as a part of the delay
    damping = crew.gain * cos(OWN * (delay + crew.lag)) / (2.0 * OWN)
    assert wanted == pytest.approx(exp(-2.0 * pi * damping), rel=0.02)


def test_the_assumed_numbers_damp_and_half_a_period_late_they_drive_the_swing(crane):
    assumed = peaks_of(free_swing(crane, control.Crew(), degrees_out=3.0))
    # from 3 deg to hardly more than the threshold of 0.5 deg in four periods
    assert assumed[3] < 1.2 * ROPE * sin(radians(0.5))
    late = replace(LINEAR, delay=0.5 * PERIOD)
    peaks = peaks_of(free_swing(crane, late, length=70.0))
    wanted = decay_by_root(late)
    assert wanted > 1.5
    np.testing.assert_allclose(peaks[3:] / peaks[2:-1], wanted, rtol=0.03)


def test_hand_and_drives_have_limits(crane):
    """Of the luff at 45 degrees, by a computation apart: 0.454 m/s and 0.110 m/s²."""
    hasty = control.Crew(gain=10.0, share=10.0)
    run = free_swing(crane, hasty, degrees_out=6.0, length=12.0)
    low, high = crane.inverse("luff").limits
    assert run.shaft_speed[:, 2].max() == pytest.approx(high, rel=1e-9)
    assert run.shaft_speed[:, 2].min() == pytest.approx(low, rel=1e-9)
    built = free_swing(crane, hasty, degrees_out=6.0, length=12.0, actuation="inverse")
    assert np.abs(built.voltage).max() <= 10.0
    knowing = free_swing(crane, control.Crew(share=0.5), degrees_out=6.0, length=12.0)
    speed = np.abs(np.diff(knowing.tip[:, 1])).max() * RATE
    assert speed == pytest.approx(0.5 * 0.110 / OWN, rel=0.02)


def test_the_tip_comes_back_to_the_place_that_the_command_gives_it(crane):
    command = OperatorCommand.trapezoid(slew=0.3, until={"slew_deg": 100.0}, length=200.0)
    crew = control.Crew(threshold_deg=0.0, return_time=15.0)
    run = simulate(crane, command, control=crew, actuation="ideal", **ABEAM)
    assert run.slew_deg[-1] == pytest.approx(100.0, abs=0.05)


# --- the ship -------------------------------------------------------------------------------------


def test_a_list_is_no_swing_but_the_ships_roll_is(crane):
    still = OperatorCommand.rest(20.0)
    count = len(np.arange(20 * RATE + 1))
    listed = np.zeros((count, 6))
    listed[:, 3] = radians(5.0)
    how = {"actuation": "ideal", "swing_damping": 0.0, **ABEAM}
    with_crew, alone = (
        simulate(crane, still, sea=listed, control=crew, **how) for crew in (LINEAR, None)
    )
    np.testing.assert_allclose(with_crew.boom_deg, alone.boom_deg, atol=1e-9)
    # seen from the cab a load that hangs plumb goes out as the ship rolls
    rolling = np.zeros((count, 6))
    rolling[:, 3] = radians(1.0) * np.sin(2.0 * pi * np.arange(count) / count) ** 2
    run = simulate(crane, still, sea=rolling, control=LINEAR, **how)
    assert np.ptp(run.boom_deg) > 0.01


def test_the_frequency_domain_is_the_simulated_crane_in_a_regular_sway(crane):
    """Amplitude of the swing by the transfer functions against a run of the loop."""
    omega = 0.45
    time = np.arange(400 * RATE + 1) / RATE
    sway = np.zeros((time.size, 6))
    sway[:, 1] = 0.05 * np.sin(omega * time)
    crew = control.Crew(threshold_deg=0.0, gain=0.2, share=10.0, return_time=20.0)
    run = simulate(
        crane, OperatorCommand.rest(400.0), sea=sway, control=crew, actuation="ideal", **ABEAM
    )
    swing = (run.load[:, 1] - run.tip[:, 1])[200 * RATE :]
    s = 1j * omega
    hand = np.exp(-s * crew.delay) / (1.0 + crew.lag * s)
    kept = s / (s + 1.0 / crew.return_time)
    offset = crew.gain * kept * hand / (s + hand / crew.return_time)
    wanted = omega**2 / (OWN**2 - omega**2 * (1.0 + offset) + 2j * 0.005 * OWN * omega) * 0.05
    assert 0.5 * np.ptp(swing) == pytest.approx(abs(wanted), rel=0.01)


class Sways:
    """A ship that only sways, as far as the water does."""

    name, frequencies = "sways", np.array([0.1, 7.0])

    def response(self, omega, heading, speed=0.0):
        made = np.zeros((6, omega.size), complex)
        made[1] = 1.0
        return made


def test_swing_with_a_crew_is_a_sum_over_waves(crane):
    crew = control.Crew(threshold_deg=0.0)
    found = linear_response(crane, Seaway(Spectrum(0.1, 9.0), ship=Sways()), crew, **ABEAM)
    omega = np.linspace(0.2, 6.0, 400_001)
    peak = 2.0 * pi / 9.0
    density = omega**-5.0 * np.exp(-1.25 * (peak / omega) ** 4)
    density *= 0.1**2 / 16.0 / np.trapezoid(density, omega)
    s = 1j * omega
    hand = np.exp(-0.3 * s) / (1.0 + 0.1 * s)
    offset = 0.3 * s / (s + 1.0 / 30.0) * hand / (s + hand / 30.0)
    swing = omega**2 / (OWN**2 - omega**2 * (1.0 + offset) + 2j * 0.005 * OWN * omega) / ROPE
    rms = sqrt(np.trapezoid(density * np.abs(swing) ** 2, omega))
    assert found.values["swing"].rms == pytest.approx(rms, rel=2e-3)
    without = linear_response(crane, Seaway(Spectrum(0.1, 9.0), ship=Sways()), **ABEAM)
    assert 20.0 * log10(found.values["swing"].rms / without.values["swing"].rms) < -10.0
    with pytest.raises(InputError, match="crew's hand through control of the tip"):
        linear_response(crane, Seaway("ss2"), crew | control.Clip(), **ABEAM)


# --- studies --------------------------------------------------------------------------------------


def test_a_crew_is_a_variant_beside_no_control(crane):
    study = Study.of(crane, control.Clip(), seeds=[1], crew=control.Crew())
    assert list(study.cases) == ["no control", "crew", "ideal", "identified"]
    assert study.cases["crew"].driven
    assert study.crewed
    assert not Study.of(crane, control.Clip(), seeds=[1]).crewed
    assert Study.of(crane, {"none": None, "by hand": control.Crew()}, seeds=[1]).crewed


def test_waves_in_which_no_swing_is_seen_are_those_without_a_crew(crane):
    """From ahead, 4 s: the load of a ship of 200 m hardly swings, so that nothing is simulated."""
    scatter = Scatter.of([1.25], [4.0], [1.0])
    year = operability(crane, control.Crew(), scatter, headings=[180.0], drives=["identified"])
    (cell,) = year.cells["identified"].values()
    assert cell == year.cells["no control"][0, 180.0]
    assert cell.limited_by == WORKABLE
    assert not cell.simulated


@pytest.mark.slow
def test_a_crew_works_a_calm_sea_abeam_in_which_the_free_load_swings_too_far(crane):
    """0.1 m at the period of 27 m of rope; the largest swing of a free load needs no simulation."""
    year = operability(
        crane,
        control.Clip(),
        Scatter.of([0.1], [10.4], [1.0]),
        headings=[90.0],
        drives=["ideal"],
        crew=control.Crew(),
        length=300.0,
        seeds=range(16),
    )
    assert year.workable("no control") == 0.0
    assert year.workable("crew") == 1.0
    assert any("No number of the crew was measured" in words for words in year.sentences())


def test_crews_that_make_no_sense_are_refused():
    for numbers, sentence in (
        ({"delay": -0.1}, r"delay of a crew is -0\.1, .* 0 to 10"),
        ({"threshold_deg": 90.0}, r"threshold_deg of a crew is 90\.0, .* 0 to 30"),
        ({"gain": 0.0}, r"gain of a crew is 0\.0, .* 0\.001 to 10"),
        ({"share": float("nan")}, "share of a crew is nan"),
        ({"lag": 0.0}, r"lag of a crew is 0\.0, .* 0\.01 to 10"),
        ({"return_time": "long"}, "return_time of a crew is 'long'"),
    ):
        with pytest.raises(InputError, match=sentence):
            control.Crew(**numbers)
    with pytest.raises(InputError, match="one crew, not 2"):
        control.Crew() | control.Crew()
