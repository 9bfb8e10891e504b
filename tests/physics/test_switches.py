"""The one-sided derivatives that are declared at switches."""

import pytest

from swashplate.physics import card_dynamics as dynamics
from swashplate.physics import control_card as card
from swashplate.physics.solenoid import solenoid_partials
from swashplate.physics.spool import opening_partials
from swashplate.physics.stroker import pressure_limit_partials
from swashplate.physics.swash import swash_angle_partials

pytestmark = pytest.mark.interpreted

COEFFICIENTS = (2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_edge_of_the_solenoids_dead_zone_belongs_to_the_dead_side() -> None:
    assert solenoid_partials(0.25, 0.25, *COEFFICIENTS)[:3] == (0.0, 0.0, 0.0)
    assert solenoid_partials(-0.25, 0.25, *COEFFICIENTS)[:3] == (0.0, 0.0, 0.0)


def test_without_dead_zone_zero_current_belongs_to_the_positive_side() -> None:
    assert solenoid_partials(0.0, 0.0, *COEFFICIENTS)[:3] == (0.0, 2.0, -2.0)


def test_edge_of_the_cards_dead_zone_belongs_to_the_dead_side() -> None:
    value, by_command, by_share, by_V_dz, *_ = card.steady_partials(
        0.5, 0.25, 0.5, 0.3, 0.1, 0.0, 0.0
    )
    assert (value, by_command, by_share, by_V_dz) == (0.075, 0.0, 0.3, 0.0)


def test_command_resting_at_the_threshold_gives_no_derivative() -> None:
    assert card.jump_share_partials(0.5, 0.5, 0.5, 0.3, 0.5) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("position", "by_position", "by_Z14", "by_plus", "by_minus"),
    [
        (2e-4, 0.0, 0.0, 1.0, 0.0),
        (-3e-4, 0.0, 0.0, 0.0, -1.0),
        (1.9e-4, 1.0, 0.0, 0.0, 0.0),
    ],
)
def test_on_an_orifices_limit_the_limited_side_counts(
    position: float, by_position: float, by_Z14: float, by_plus: float, by_minus: float
) -> None:
    _, *partials = opening_partials(position, 1e-3, 2e-4, 3e-4)
    assert partials == [by_position, by_Z14, by_plus, by_minus]


def test_where_stroke_and_orifice_coincide_the_orifice_counts() -> None:
    assert opening_partials(5e-3, 1e-3, 1e-3, 1e-3) == (1e-3, 0.0, 0.0, 1.0, 0.0)


def test_on_a_stop_the_stop_counts() -> None:
    assert swash_angle_partials(0.5, 0.3, 0.2, None) == (0.3, 0.0, 1.0, 0.0)
    assert swash_angle_partials(-0.5, 0.3, 0.2, None) == (-0.2, 0.0, 0.0, -1.0)


def test_where_stop_and_relief_coincide_the_stop_counts() -> None:
    stop = pressure_limit_partials(1e-6, 0.0, 0.25, 1e9, 1.0)
    same = pressure_limit_partials(1e-6, 0.0, 0.25, stop[0], 1.0)
    assert same == stop
    assert pressure_limit_partials(1e-6, 0.0, 0.25, 1e5, -1.0) == (-1e5, 0.0, 0.0, 0.0, -1.0)


def test_at_the_limiters_switches_the_unlimited_side_counts() -> None:
    args = {"lim1": 2.0, "lim2": 2.0, "I_t1": 0.25, "I_t2": 0.125, "decay": 0.5, "step": 0.125}
    # target exactly at I_t1, exactly at what the rate limit allows, and exactly at the decay
    assert dynamics.limiter_partials(0.25, 0.1, 1.0, **args)[1:3] == (1.0, 0.0)
    assert dynamics.limiter_partials(0.75, 0.5, 1.0, **args)[1:3] == (1.0, 0.0)
    assert dynamics.limiter_partials(0.25, 0.5, 1.0, **args)[1:3] == (1.0, 0.0)
    assert dynamics.limiter_partials(0.0625, 0.125, 1.0, **args)[1:3] == (1.0, 0.0)


def test_ends_of_the_smooth_sign_are_saturated() -> None:
    h = 0.125
    width = dynamics.COULOMB_WIDTH * h
    within = dynamics.filter_partials(0.5 * width, 0.0, 0.0, 0.5, 1.0, 2.0, h, None)
    at_end = dynamics.filter_partials(width, 0.0, 0.0, 0.5, 1.0, 2.0, h, None)
    assert within[1] - at_end[1] == pytest.approx(-2.0 * h / dynamics.COULOMB_WIDTH)
    assert at_end[6] == pytest.approx(-h * h)
