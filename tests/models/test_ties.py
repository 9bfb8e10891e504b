"""The one-sided derivatives that the models declare where two branches meet."""

from math import tan
from typing import Any

import pytest

from swashplate.equations import derive
from swashplate.equations.library import faded, small_arctangent, soft_threshold
from swashplate.models import channel as single
from swashplate.models import displacement_control as control
from swashplate.models.channel import Channel
from swashplate.models.displacement_control import Pump

pytestmark = pytest.mark.interpreted

H = 0.125


def channel(**values: float) -> Channel:
    """A channel of zeros but for some values."""
    return Channel(*[0.0] * len(Channel._fields))._replace(**values)


def pump_with(**values: float) -> Pump:
    """A pump of zeros but for some values."""
    return Pump(*[0.0] * 28)._replace(**values)


def partials(
    function: Any, by: tuple[str, ...], *arguments: Any, **options: Any
) -> tuple[float, ...]:
    """Partials of one result by some inputs, zeros included; interpreted and compiled the same."""
    derived = derive(function, by, options)
    got = derived.python(*arguments)
    assert tuple(derived.compiled(*arguments)) == pytest.approx(got, rel=1e-14)
    found = dict(zip(derived.entries, got[len(derived.outputs) :], strict=True))
    return tuple(found.get((0, i), 0.0) for i in range(len(derived.inputs)))


@pytest.mark.parametrize("function", [control.effective_current, soft_threshold])
def test_edges_of_a_dead_zone_belong_to_it(function: Any) -> None:
    by = ("current", "Z17") if function is control.effective_current else ("value", "width")
    assert partials(function, by, 0.25, 0.25) == (0.0, 0.0)
    assert partials(function, by, -0.25, 0.25) == (0.0, 0.0)
    assert partials(function, by, 0.5, 0.25) == (1.0, -1.0)
    assert partials(function, by, -0.5, 0.25) == (1.0, 1.0)
    # without a dead zone, zero belongs to the positive side
    assert partials(function, by, 0.0, 0.0) == (1.0, -1.0)


def test_edge_of_the_solenoids_dead_zone_has_no_force_and_no_slope() -> None:
    by = ("current", "p.Z17", "p.Z19_plus", "p.Z19_minus")
    p = pump_with(Z17=0.25, Z19_plus=2.0, Z19_minus=3.0)
    for current in (0.25, -0.25):
        assert partials(control.solenoid_force, by, current, p) == (0.0, 0.0, 0.0, 0.0)
    p = p._replace(Z17=0.0)
    assert partials(control.solenoid_force, by, 0.0, p) == (2.0, -2.0, 0.0, 0.0)


def test_edge_of_the_cards_dead_zone_belongs_to_the_dead_side() -> None:
    p = channel(V_dz=0.5, J=0.3, G1=0.1)
    by = ("command", "share", "p.V_dz", "p.J", "p.G1")
    assert partials(single.steady_current, by, 0.5, 0.25, p) == (0.0, 0.3, 0.0, 0.25, 0.0)


def test_a_command_resting_at_the_threshold_gives_no_derivative() -> None:
    by = ("newest", "middle", "oldest", "fraction", "threshold")
    assert partials(single.jump_share, by, 0.5, 0.5, 0.5, 0.3, 0.5) == (0.0,) * 5
    assert partials(single.share_above, ("first", "last", "threshold"), 0.5, 0.5, 0.5) == (0.0,) * 3


def test_a_command_that_begins_at_the_threshold_has_a_slope() -> None:
    by = ("first", "last", "threshold")
    # the way from 0.5 to 1.5 is above 0.5 but for its first point: only that one moves the share
    assert partials(single.share_above, by, 0.5, 1.5, 0.5) == (1.0, 0.0, -1.0)
    assert partials(single.share_above, by, 1.5, 0.5, 0.5) == (0.0, 1.0, -1.0)


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        (2e-4, (0.0, 0.0, 1.0, 0.0)),
        (-3e-4, (0.0, 0.0, 0.0, -1.0)),
        (1.9e-4, (1.0, 0.0, 0.0, 0.0)),
        (5e-3, (0.0, 0.0, 1.0, 0.0)),
    ],
)
def test_on_an_orifices_limit_the_limited_side_counts(position: float, expected: tuple) -> None:
    p = pump_with(Z14=1e-3, Z16_plus=2e-4, Z16_minus=3e-4)
    by = ("position", "p.Z14", "p.Z16_plus", "p.Z16_minus")
    assert partials(control.orifice_opening, by, position, p) == expected


def test_where_stroke_and_orifice_coincide_the_orifice_counts() -> None:
    p = pump_with(Z14=1e-3, Z16_plus=1e-3, Z16_minus=1e-3)
    by = ("position", "p.Z14", "p.Z16_plus", "p.Z16_minus")
    assert partials(control.orifice_opening, by, 5e-3, p) == (0.0, 0.0, 1.0, 0.0)


@pytest.mark.parametrize("steep", [None, True])
def test_on_a_stop_the_stop_counts(steep: Any) -> None:
    p = pump_with(Z13_plus=0.3, Z13_minus=0.2)
    by = ("tangent", "p.Z13_plus", "p.Z13_minus")
    assert partials(control.swash_angle, by, 0.4, p, steep, steep=steep) == (0.0, 1.0, 0.0)
    assert partials(control.swash_angle, by, -0.4, p, steep, steep=steep) == (0.0, 0.0, -1.0)
    at_stop = p._replace(Z13_plus=small_arctangent(0.3))
    assert partials(control.swash_angle, by, 0.3, at_stop, steep, steep=steep) == (0.0, 1.0, 0.0)


def test_where_stop_and_relief_coincide_the_stop_counts() -> None:
    stop = tan(0.25) / 1e-6
    p = pump_with(Z1=1e-6, Z13_plus=0.25, Z13_minus=0.25, Z15=stop)
    by = ("p.Z1", "p.Z13_plus", "p.Z13_minus", "p.Z15")
    derived = derive(control.pressure_limits, by)
    got = derived.python(p)
    found = dict(zip(derived.entries, got[4:], strict=True))
    for output in (2, 3):
        assert found[output, 0] != 0.0
        assert found.get((output, 3), 0.0) == 0.0
    relieved = derived.python(p._replace(Z15=1e5))
    found = dict(zip(derived.entries, relieved[4:], strict=True))
    assert relieved[2:4] == (-1e5, 1e5)
    assert (found[2, 3], found[3, 3]) == (-1.0, 1.0)
    assert found[3, 0] == 0.0


@pytest.mark.parametrize("split", [None, True])
@pytest.mark.parametrize(
    ("target", "previous"), [(0.25, 0.1), (0.75, 0.5), (0.25, 0.5), (0.0625, 0.125)]
)
def test_at_the_limiters_switches_the_unlimited_side_counts(
    target: float, previous: float, split: Any
) -> None:
    """The target exactly at I_t1, at what the rate limit allows either way, and at the decay."""
    p = channel(lim1=2.0, lim2=2.0, I_t1=0.25, I_t2=0.125)
    arguments = (target, previous, 1.0, p, 0.5, H, split)
    by = ("target", "previous")
    assert partials(single.limited_current, by, *arguments, split=split) == (1.0, 0.0)


def test_ends_of_the_smooth_sign_are_saturated() -> None:
    width = single.COULOMB_WIDTH * H
    p = channel(zeta=0.5, omega=1.0, C=2.0)
    by = ("now", "p.C")
    within = partials(single.filtered_current, by, 0.5 * width, 0.0, 0.0, p, H, None, literal=None)
    at_end = partials(single.filtered_current, by, width, 0.0, 0.0, p, H, None, literal=None)
    assert within[0] - at_end[0] == pytest.approx(-2.0 * H / single.COULOMB_WIDTH)
    assert at_end[1] == pytest.approx(-H * H)


def test_at_rest_the_filter_still_follows_its_input() -> None:
    p, h = channel(zeta=0.5, omega=100.0), 1.0 / 512.0
    w = 100.0 * h
    by = ("now", "before", "steady")
    found = partials(single.filtered_current, by, 0.0, 0.0, 0.0, p, h, None, literal=None)
    assert found == pytest.approx((2.0 * (1.0 - 0.5 * w), w - w * w - 1.0, w * w))
    assert partials(faded, ("value",), 0.0) == (1.0,)


@pytest.mark.parametrize("symmetric", [None, True])
def test_without_head_the_flow_has_no_slope(symmetric: Any) -> None:
    """At δP = Z9 the root's slope is infinite; it counts as none."""
    arguments = (1e6, 1e-4, 0.1, 0.0, 1e6, 1e6, symmetric)
    by_pressure, by_supply = partials(
        control.pressure_rate, ("pressure", "Z9"), *arguments, symmetric=symmetric
    )
    assert (by_pressure, by_supply) == (0.0, 0.0)
    assert partials(control.head_root, ("head",), 0.0) == (0.0,)


def test_leakage_that_is_zero_has_a_derivative() -> None:
    """The step without leakage declares what leakage would do to it: that of Runge-Kutta at 0."""
    h = 1.0 / 512.0
    for pressure, opening in ((3e5, 1e-4), (-2e5, -1.5e-4), (1e5, 2e-5)):
        arguments = (pressure, opening, 0.07, 0.0, 1.65e6, 1.07e7, h)
        (tight,) = partials(control.tight_step, ("Z7",), *arguments, None, symmetric=None)
        (leaky,) = partials(control.leaky_step, ("Z7",), *arguments, None, symmetric=None)
        assert tight == pytest.approx(leaky, rel=1e-3)
        assert tight != 0.0
