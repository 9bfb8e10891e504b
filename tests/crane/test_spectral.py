"""The crane in the frequency domain: against sums over waves, and against simulated seaways."""

from math import cos, degrees, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

from swashplate.crane import (
    Crane,
    Hull,
    OperatorCommand,
    Seaway,
    Spectrum,
    Study,
    control,
    linear_response,
    read_ship,
    simulate,
)
from swashplate.errors import InputError

G = 9.80665
S175 = Path(__file__).parents[3] / "shared" / "data" / "s175" / "input.re1"


@pytest.fixture(scope="module")
def crane():
    return Crane.preset("tg3637")


class Rolls:
    """A ship that only rolls, by a fixed angle for each metre of wave."""

    name, frequencies = "rolls", np.array([0.1, 7.0])

    def response(self, omega, heading, speed=0.0):
        made = np.zeros((6, omega.size), complex)
        made[3] = 0.01 * np.sin(heading)
        return made


def bretschneider(height, period, omega):
    peak = 2.0 * pi / period
    return 5.0 / 16.0 * height**2 * peak**4 / omega**5 * np.exp(-1.25 * (peak / omega) ** 4)


def test_swing_and_leads_are_sums_over_waves(crane):
    """By hand: a ship that rolls by 0.01 rad for each metre, the boom abeam at 45 degrees."""
    found = linear_response(crane, Seaway("ss3", ship=Rolls()), rope_m=20.0, swing_damping=0.01)
    omega = np.linspace(0.2, 6.0, 400_001)
    density = bretschneider(0.88, 7.5, omega)
    density *= 0.88**2 / 16.0 / np.trapezoid(density, omega)
    # tip: 19 m + 36 m sin 45° above the origin, so that roll moves it by -z to port
    height = 19.0 + 36.0 * sin(radians(45.0))
    own = sqrt(G / 20.0)
    swing = omega**2 / (own**2 - omega**2 + 2j * 0.01 * own * omega) * (-height * 0.01) / 20.0
    rms = sqrt(np.trapezoid(density * np.abs(swing) ** 2, omega))
    assert found.values["swing"].rms == pytest.approx(rms, rel=1e-3)
    # in the crane's axes the rope leans by the roll as well: a roll to starboard is outwards
    lead = sqrt(np.trapezoid(density * np.abs(-swing + 0.01) ** 2, omega))
    assert found.values["off_lead"].rms == pytest.approx(lead, rel=1e-3)
    assert found.values["side_lead"].rms == pytest.approx(0.0, abs=1e-9)
    # the tip is 36 m cos 45° + 2.5 m + 8.5 m to starboard: roll lowers it
    arm = 36.0 * cos(radians(45.0)) + 2.5 + 8.5
    speed = sqrt(np.trapezoid(density * (omega * arm * 0.01) ** 2, omega))
    assert found.values["hook_speed"].rms == pytest.approx(speed, rel=1e-3)


def test_a_list_is_a_mean_lead(crane):
    found = linear_response(crane, Seaway("ss2", list_deg=2.0, trim_deg=1.0))
    # the boom points to starboard, to which the ship lists; its trim is across the boom
    assert degrees(found.values["off_lead"].mean) == pytest.approx(2.0)
    assert degrees(found.values["side_lead"].mean) == pytest.approx(-1.0)


def test_leads_of_a_run_have_the_signs_of_the_frequency_domain(crane):
    lean = np.tile([0.0, 0.0, 0.0, radians(2.0), radians(1.0), 0.0], (1025, 1))
    run = simulate(crane, OperatorCommand.rest(2.0), sea=lean, slew_deg=90.0, rope_m=27.0)
    assert run.off_lead_deg[-1] == pytest.approx(2.0, abs=0.05)
    assert run.side_lead_deg[-1] == pytest.approx(-1.0, abs=0.05)


def test_swing_without_damping_has_no_stationary_state(crane):
    with pytest.raises(InputError, match="swing_damping .* 0"):
        linear_response(crane, swing_damping=0.0)


def test_ideal_ship_compensation_leaves_nothing(crane):
    found = linear_response(crane, control=control.ShipCompensation())
    assert found.values["swing"].rms == pytest.approx(0.0, abs=1e-12)
    assert found.values["luff_acceleration"].largest > 1.0


def test_delayed_feedback_damps_as_its_root_says(crane):
    """White forcing of a resonance: variance is as 1/ζ, so 0.5 % to 0.5 + 11.6 % is a ratio."""
    swell = Seaway(Spectrum(0.5, 30.0 / 3.0, 1.0))
    none = linear_response(crane, swell, swing_damping=0.005).values["swing"].rms
    fed = (
        linear_response(crane, swell, control.DelayedFeedback(0.2, 0.25), swing_damping=0.005)
        .values["swing"]
        .rms
    )
    # resonance alone, without what the waves' own band adds: within a fifth
    assert fed / none == pytest.approx(sqrt(0.005 / 0.121), rel=0.35)


SHIPS = {
    "hull": Hull(203.8, 23.2, 9.75),
    "s175": S175,
}


@pytest.mark.slow
@pytest.mark.parametrize("ship", SHIPS)
@pytest.mark.parametrize("heading", [90.0, 60.0, 135.0])
@pytest.mark.parametrize("damping", [0.002, 0.005, 0.01, 0.02, 0.05])
def test_simulated_swing_is_that_of_the_spectrum(crane, ship, heading, damping):
    """Small waves, so that all is linear; 24 seaways of ten minutes."""
    if ship == "s175" and not S175.exists():
        pytest.skip("the S175's transfer functions are not beside this checkout")
    hull = SHIPS[ship] if ship == "hull" else read_ship(S175)
    sea = Seaway(Spectrum(0.2, 8.0), heading_deg=heading, ship=hull)
    study = Study.of(
        crane, control.Clip(), sea=sea, seeds=range(24), swing_damping=damping, run_in=0.0
    )
    swings = np.array(
        [outcome.rms_swing for (outcome,) in study.outcomes([study.cases["no control"]])]
    )
    # variances are unbiased, their roots are not
    mean, error = np.mean(swings**2), np.std(swings**2, ddof=1) / sqrt(24.0)
    expected = linear_response(crane, sea, swing_damping=damping).values["swing"].rms ** 2
    assert abs(mean - expected) < 3.0 * error
