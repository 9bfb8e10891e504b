"""The one-sided derivatives that the models declare where two branches meet."""

from math import log, tan
from typing import Any

import pytest
from tests.marks import rest_slow

from swashplate.machine import derive
from swashplate.machine.library import faded, small_arctangent, soft_threshold
from swashplate.models import amplifier
from swashplate.models import displacement_control as control
from swashplate.models.amplifier import CardChannel
from swashplate.models.displacement_control import Pump, Stroking

pytestmark = pytest.mark.interpreted

H = 0.125


def channel(**values: float) -> CardChannel:
    """A channel of zeros but for some values."""
    return CardChannel(*[0.0] * len(CardChannel._fields))._replace(**values)


def pump_with(**values: float) -> Pump:
    """A pump of zeros but for some values."""
    return Pump(*[0.0] * 28)._replace(**values)


def partials(
    function: Any, by: tuple[str, ...], *arguments: Any, **options: Any
) -> tuple[float, ...]:
    """Partials of one result by some inputs, zeros included."""
    derived = derive(function, by, options)
    got = derived(*arguments)
    found = dict(zip(derived.entries, got[len(derived.outputs) :], strict=True))
    return tuple(found.get((0, i), 0.0) for i in range(len(derived.inputs)))


OPENING = (control.orifice_opening, ("position", "p.Z14", "p.Z16_plus", "p.Z16_minus"))
ORIFICES = pump_with(Z14=1e-3, Z16_plus=2e-4, Z16_minus=3e-4)
ANGLE = (control.swash_angle, ("tangent", "p.Z13_plus", "p.Z13_minus"))
STOPS = pump_with(Z13_plus=0.3, Z13_minus=0.2)
FORCE = (control.solenoid_force, ("current", "p.Z17", "p.Z19_plus", "p.Z19_minus"))
SOLENOIDS = pump_with(Z17=0.25, Z19_plus=2.0, Z19_minus=3.0)
SHARE = (amplifier.share_above, ("first", "last", "threshold"))
ZONES = (
    (control.effective_current, ("current", "Z17")),
    (soft_threshold, ("value", "width")),
)
LIMITED = (amplifier.limited_current, ("target", "previous"))
LIMITS = channel(lim1=2.0, lim2=2.0, I_t1=0.25, I_t2=0.125, a=log(2.0) / H)
CARD = channel(V_dz=0.5, J=0.3, G1=0.1)
NO_HEAD = (1e6, 1e-4, Stroking(0.1, 0.0, 1e6, 1e6))

TIES: list[tuple[tuple[Any, tuple[str, ...]], tuple, dict, tuple[float, ...]]] = [
    # edges of a dead zone belong to it; without one, zero belongs to the positive side
    *((zone, (0.25, 0.25), {}, (0.0, 0.0)) for zone in ZONES),
    *((zone, (-0.25, 0.25), {}, (0.0, 0.0)) for zone in ZONES),
    *((zone, (0.5, 0.25), {}, (1.0, -1.0)) for zone in ZONES),
    *((zone, (-0.5, 0.25), {}, (1.0, 1.0)) for zone in ZONES),
    *((zone, (0.0, 0.0), {}, (1.0, -1.0)) for zone in ZONES),
    *((FORCE, (current, SOLENOIDS), {}, (0.0, 0.0, 0.0, 0.0)) for current in (0.25, -0.25)),
    (FORCE, (0.0, SOLENOIDS._replace(Z17=0.0)), {}, (2.0, -2.0, 0.0, 0.0)),
    # the card's belongs to the dead side
    (
        (amplifier.steady_current, ("command", "share", "p.V_dz", "p.J", "p.G1")),
        (0.5, 0.25, CARD),
        {},
        (0.0, 0.3, 0.0, 0.25, 0.0),
    ),
    # a command that rests at the threshold gives no derivative, one that begins there has a slope
    (
        (amplifier.jump_share, ("newest", "middle", "oldest", "fraction", "threshold")),
        (0.5, 0.5, 0.5, 0.3, 0.5),
        {},
        (0.0,) * 5,
    ),
    (SHARE, (0.5, 0.5, 0.5), {}, (0.0, 0.0, 0.0)),
    (SHARE, (0.5, 1.5, 0.5), {}, (1.0, 0.0, -1.0)),
    (SHARE, (1.5, 0.5, 0.5), {}, (0.0, 1.0, -1.0)),
    # on an orifice's limit the limited side counts, and the orifice before the stroke
    (OPENING, (2e-4, ORIFICES), {}, (0.0, 0.0, 1.0, 0.0)),
    (OPENING, (-3e-4, ORIFICES), {}, (0.0, 0.0, 0.0, -1.0)),
    (OPENING, (1.9e-4, ORIFICES), {}, (1.0, 0.0, 0.0, 0.0)),
    (OPENING, (5e-3, ORIFICES._replace(Z16_plus=1e-3)), {}, (0.0, 0.0, 1.0, 0.0)),
    # on a stop the stop counts
    *(
        (ANGLE, (at, stops, steep), {"steep": steep}, expected)
        for steep in (None, True)
        for at, stops, expected in (
            (0.4, STOPS, (0.0, 1.0, 0.0)),
            (-0.4, STOPS, (0.0, 0.0, -1.0)),
            (0.3, STOPS._replace(Z13_plus=small_arctangent(0.3)), (0.0, 1.0, 0.0)),
        )
    ),
    # the target exactly at I_t1, at what the rate limit allows either way, and at the decay
    *(
        (LIMITED, (target, previous, 1.0, LIMITS, H, split), {"split": split}, (1.0, 0.0))
        for split in (None, True)
        for target, previous in ((0.25, 0.1), (0.75, 0.5), (0.25, 0.5), (0.0625, 0.125))
    ),
    # at δP = Z9 the root's slope is infinite; it counts as none
    *(
        (
            (control.pressure_rate, ("pressure", "p.Z9")),
            (*NO_HEAD, symmetric),
            {"symmetric": symmetric},
            (0.0, 0.0),
        )
        for symmetric in (None, True)
    ),
    ((control.head_root, ("head",)), (0.0,), {}, (0.0,)),
    ((faded, ("value",)), (0.0,), {}, (1.0,)),
]


@pytest.mark.parametrize(
    ("of", "arguments", "options", "expected"),
    rest_slow(TIES, 10),
    ids=lambda each: getattr(each[0], "__name__", "") if isinstance(each, tuple) else "",
)
def test_where_branches_meet_the_declared_side_counts(of, arguments, options, expected) -> None:
    function, by = of
    assert partials(function, by, *arguments, **options) == expected


def test_where_stop_and_relief_coincide_the_stop_counts() -> None:
    stop = tan(0.25) / 1e-6
    p = pump_with(Z1=1e-6, Z13_plus=0.25, Z13_minus=0.25, Z15=stop)
    derived = derive(control.pressure_limits, ("p.Z1", "p.Z13_plus", "p.Z13_minus", "p.Z15"))
    found = dict(zip(derived.entries, derived(p)[4:], strict=True))
    for output in (2, 3):
        assert found[output, 0] != 0.0
        assert found.get((output, 3), 0.0) == 0.0
    relieved = derived(p._replace(Z15=1e5))
    found = dict(zip(derived.entries, relieved[4:], strict=True))
    assert relieved[2:4] == (-1e5, 1e5)
    assert (found[2, 3], found[3, 3], found[3, 0]) == (-1.0, 1.0, 0.0)


def test_ends_of_the_smooth_sign_are_saturated_and_at_rest_the_input_is_followed() -> None:
    width, by = amplifier.COULOMB_WIDTH * H, ("now", "before", "steady", "p.C")
    p, off = channel(zeta=0.5, omega=1.0, C=2.0), {"literal": None}
    within, at_end = (
        partials(amplifier.filtered_current, by, share * width, 0.0, 0.0, p, H, None, **off)
        for share in (0.5, 1.0)
    )
    assert within[0] - at_end[0] == pytest.approx(-2.0 * H / amplifier.COULOMB_WIDTH)
    assert at_end[3] == pytest.approx(-H * H)
    p, w = channel(zeta=0.5, omega=0.2 / H), 0.2
    found = partials(amplifier.filtered_current, by, 0.0, 0.0, 0.0, p, H, None, **off)
    assert found[:3] == pytest.approx((2.0 * (1.0 - 0.5 * w), w - w * w - 1.0, w * w))


def test_leakage_that_is_zero_has_a_derivative() -> None:
    """The step without leakage declares what leakage would do to it: that of Runge-Kutta at 0."""
    h = 1.0 / 512.0
    for pressure, opening in ((3e5, 1e-4), (-2e5, -1.5e-4), (1e5, 2e-5)):
        arguments = (pressure, opening, Stroking(0.07, 0.0, 1.65e6, 1.07e7), h)
        (tight,) = partials(control.tight_step, ("p.Z7",), *arguments, None, symmetric=None)
        (leaky,) = partials(control.leaky_step, ("p.Z7",), *arguments, None, symmetric=None)
        assert tight == pytest.approx(leaky, rel=1e-3)
        assert tight != 0.0
