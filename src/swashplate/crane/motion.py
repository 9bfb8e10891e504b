"""Motion of boom, rope and load at the speeds of the three shafts, on a moving ship: a model.

It is what `swashplate.join` puts behind three drives, see `swashplate.crane.plant`. The equations
are those of `kinematics` and `rope`; here stands what they are called with at a sample, and what
is kept for the next one.
"""

from math import atan2, cos, sin, sqrt
from typing import Annotated, NamedTuple

from swashplate.crane.kinematics import (
    Boom,
    Geometry,
    Home,
    Rotation,
    Shafts,
    Vector,
    add_scaled,
    boom_at,
    norm,
    rope_length,
    rotation,
    shaft_torques,
    tip_of,
    to_inertial,
    to_ship,
)
from swashplate.crane.rope import (
    FASTEST,
    Hanging,
    Hung,
    Start,
    hanging_load,
    rope_step,
    set_off,
)
from swashplate.machine import Definition, Model, equation


class Travel(NamedTuple):
    """Ends of the travel of rope and boom."""

    shortest: Annotated[float, Definition("shortest rope below the tip", "m")]
    longest: Annotated[float, Definition("longest rope below the tip", "m")]
    lowest: Annotated[float, Definition("sine of the boom's lowest elevation", "1")]
    highest: Annotated[float, Definition("sine of the boom's highest elevation", "1")]


class Ship(NamedTuple):
    """Motion of a ship where none is given: it is at rest."""

    surge: Annotated[float, Definition("ship forward, if it is not given", "m")] = 0.0
    sway: Annotated[float, Definition("ship to port, if it is not given", "m")] = 0.0
    heave: Annotated[float, Definition("ship up, if it is not given", "m")] = 0.0
    roll: Annotated[float, Definition("roll of the ship, if it is not given", "rad")] = 0.0
    pitch: Annotated[float, Definition("pitch of the ship, if it is not given", "rad")] = 0.0
    yaw: Annotated[float, Definition("yaw of the ship, if it is not given", "rad")] = 0.0


SHIP = {name: f"ship.{name}" for name in Ship._fields}
"""Parameter that stands for each motion of the ship if it is not given."""


class Body(NamedTuple):
    """Boom, rope and load, and where they begin."""

    geometry: Geometry
    home: Home
    hanging: Hanging
    release: Start
    mass: Annotated[float, Definition("mass of load and hook", "kg", above=0.0)]
    travel: Travel
    ship: Ship = Ship()


class BodyInputs(NamedTuple):
    """Speeds of the shafts, positive hoists, slews to starboard, lifts; motion of the ship."""

    hoist_speed: Annotated[float, Definition("speed of the hoist's shaft", "rad/s")]
    slew_speed: Annotated[float, Definition("speed of the slew, at the turret", "rad/s")]
    luff_speed: Annotated[float, Definition("speed of the luff's shaft", "rad/s")]
    surge: Annotated[float, Definition("ship forward", "m")]
    sway: Annotated[float, Definition("ship to port", "m")]
    heave: Annotated[float, Definition("ship up", "m")]
    roll: Annotated[float, Definition("roll of the ship, positive with port up", "rad")]
    pitch: Annotated[float, Definition("pitch of the ship, positive with the bow down", "rad")]
    yaw: Annotated[float, Definition("yaw of the ship, positive to port", "rad")]


class BodyState(NamedTuple):
    """The sample before, and load and hook at the one before that."""

    samples: float
    """Samples so far, 2 if they are more: the first two are not like the others."""
    last_speed: Shafts
    """[rad/s]"""
    last_shaft: Shafts
    last_rope: float
    """[m]"""
    last_tip: Vector
    last_load: Vector
    earlier_load: Vector
    last_hook: Vector
    earlier_hook: Vector
    last_pull: float
    """[N/kg]"""
    last_stretch: float
    """[m]"""


class BodySignals(NamedTuple):
    """What is known of boom, rope and load at a sample; points are inertial."""

    shaft_hoist: Annotated[float, Definition("angle of the hoist's shaft from home", "rad")]
    shaft_slew: Annotated[float, Definition("angle of the slew from home", "rad")]
    shaft_luff: Annotated[float, Definition("angle of the luff's shaft from home", "rad")]
    tip_x: Annotated[float, Definition("tip of the boom, forward", "m")]
    tip_y: Annotated[float, Definition("tip of the boom, to port", "m")]
    tip_z: Annotated[float, Definition("tip of the boom, up", "m")]
    load_x: Annotated[float, Definition("load, forward", "m")]
    load_y: Annotated[float, Definition("load, to port", "m")]
    load_z: Annotated[float, Definition("load, up", "m")]
    hook_x: Annotated[float, Definition("hook, forward", "m")]
    hook_y: Annotated[float, Definition("hook, to port", "m")]
    hook_z: Annotated[float, Definition("hook, up", "m")]
    pull: Annotated[float, Definition("tension for each kilogram of load and hook", "N/kg")]
    stretch: Annotated[float, Definition("elongation of the rope by its tension", "m")]
    rope: Annotated[float, Definition("rope below the tip", "m")]
    boom_cos: Annotated[float, Definition("cosine of the boom's elevation", "1")]
    boom_sin: Annotated[float, Definition("sine of the boom's elevation", "1")]
    slew: Annotated[float, Definition("slew from forward, positive to starboard", "rad")]
    boom: Annotated[float, Definition("elevation of the boom", "rad")]
    swing: Annotated[float, Definition("angle between tip-to-load line and plumb line", "rad")]
    off_lead: Annotated[float, Definition("angle of the rope outwards along the boom", "rad")]
    side_lead: Annotated[float, Definition("angle of the rope to starboard of the boom", "rad")]
    tension: Annotated[float, Definition("tension of the rope, 0 if it is slack", "N")]
    torque_hoist: Annotated[float, Definition("torque of the rope on the hoist's shaft", "N m")]
    torque_slew: Annotated[float, Definition("torque of the rope on the slew", "N m")]
    torque_luff: Annotated[float, Definition("torque of the rope on the luff's shaft", "N m")]


class BodyLimits(NamedTuple):
    """Ends that are met, and the slack rope."""

    rope_end: Annotated[bool, Definition("the rope is shorter or longer than it can be", "")]
    boom_end: Annotated[bool, Definition("the boom is beyond the ends of its travel", "")]
    slack: Annotated[bool, Definition("the rope is slack", "")]


@equation
def tip_at(shafts: Shafts, inputs: BodyInputs, p: Body) -> Vector:
    """Tip of the boom, inertial, at angles of the shafts. [m]"""
    r = rotation(inputs.roll, inputs.pitch, inputs.yaw)
    boom = boom_at(shafts.luff, p.geometry, p.home)
    shift = Vector(inputs.surge, inputs.sway, inputs.heave)
    return to_inertial(r, tip_of(p.home.slew + shafts.slew, boom, p.geometry), shift)


class UpperEnd(NamedTuple):
    """The rope's upper end, and how long it is below."""

    tip: Vector
    rope: float
    """[m]"""


@equation
def led_load(
    before: Hung,
    last: UpperEnd,
    now: UpperEnd,
    samples: float,
    start: Start,
    s: Hanging,
    h: float,
) -> Hung:
    """Load and hook at a sample, after the tip has moved and the rope has changed its length. [m]

    At the first sample the load hangs still, at its offset; `samples` are those before this one.
    The second step of Verlet's method is half a step from a given velocity.
    """
    hung = before
    if samples < 0.5:
        hung = hanging_load(now.tip, start.offset_x, start.offset_y, now.rope, s)
    else:
        square = h * h
        if samples < 1.5:
            square = 0.5 * square
            tip_step = add_scaled(now.tip, -1.0, last.tip)
            lowered = now.rope - last.rope
            v_x, v_y = start.velocity_x, start.velocity_y
            hung = set_off(hung, last.tip, tip_step, lowered, v_x, v_y, h)
        hung = rope_step(hung, last.tip, now.tip, now.rope, s, h, square)
    return hung


@equation
def rope_torques(
    hung: Hung, tip: Vector, r: Rotation, slew: float, boom: Boom, mass: float, g: Geometry
) -> Shafts:
    """Torques of the rope's tension on the three shafts. [N m]"""
    tension = mass * hung.pull
    along = add_scaled(hung.hook, -1.0, tip)
    force = add_scaled(Vector(0.0, 0.0, 0.0), tension / norm(along), along)
    return shaft_torques(to_ship(r, force), slew, boom, tension, g)


@equation
def body_sample(state: BodyState, inputs: BodyInputs, p: Body, h: float) -> BodySignals:
    """Boom, rope and load at a sample; shafts by the trapezoidal rule."""
    half = 0.5 * h if state.samples > 0.5 else 0.0
    shafts = Shafts(
        state.last_shaft.hoist + half * (state.last_speed.hoist + inputs.hoist_speed),
        state.last_shaft.slew + half * (state.last_speed.slew + inputs.slew_speed),
        state.last_shaft.luff + half * (state.last_speed.luff + inputs.luff_speed),
    )
    g = p.geometry
    boom = boom_at(shafts.luff, g, p.home)
    rope = rope_length(shafts, g, p.home)
    r = rotation(inputs.roll, inputs.pitch, inputs.yaw)
    slew = p.home.slew + shafts.slew
    tip = tip_at(shafts, inputs, p)
    before = Hung(
        load=state.last_load,
        previous_load=state.earlier_load,
        hook=state.last_hook,
        previous_hook=state.earlier_hook,
        pull=state.last_pull,
        stretch=state.last_stretch,
    )
    hung = led_load(
        before,
        UpperEnd(state.last_tip, state.last_rope),
        UpperEnd(tip, rope),
        state.samples,
        p.release,
        p.hanging,
        h,
    )
    d = add_scaled(hung.load, -1.0, tip)
    along = add_scaled(hung.hook, -1.0, tip)
    torques = rope_torques(hung, tip, r, slew, boom, p.mass, g)
    lead = to_ship(r, along)
    c, s = cos(slew), sin(slew)
    return BodySignals(
        shaft_hoist=shafts.hoist,
        shaft_slew=shafts.slew,
        shaft_luff=shafts.luff,
        tip_x=tip.x,
        tip_y=tip.y,
        tip_z=tip.z,
        load_x=hung.load.x,
        load_y=hung.load.y,
        load_z=hung.load.z,
        hook_x=hung.hook.x,
        hook_y=hung.hook.y,
        hook_z=hung.hook.z,
        pull=hung.pull,
        stretch=hung.stretch,
        rope=rope,
        boom_cos=boom.cos,
        boom_sin=boom.sin,
        slew=slew,
        boom=atan2(boom.sin, boom.cos),
        swing=atan2(sqrt(d.x * d.x + d.y * d.y), -d.z),
        off_lead=atan2(lead.x * c - lead.y * s, -lead.z),
        side_lead=atan2(-lead.x * s - lead.y * c, -lead.z),
        tension=p.mass * hung.pull,
        torque_hoist=torques.hoist,
        torque_slew=torques.slew,
        torque_luff=torques.luff,
    )


@equation
def body_step(state: BodyState, signals: BodySignals, inputs: BodyInputs) -> BodyState:
    """Keep a sample for the next one."""
    return BodyState(
        samples=min(state.samples + 1.0, 2.0),
        last_speed=Shafts(inputs.hoist_speed, inputs.slew_speed, inputs.luff_speed),
        last_shaft=Shafts(signals.shaft_hoist, signals.shaft_slew, signals.shaft_luff),
        last_rope=signals.rope,
        last_tip=Vector(signals.tip_x, signals.tip_y, signals.tip_z),
        last_load=Vector(signals.load_x, signals.load_y, signals.load_z),
        earlier_load=state.last_load,
        last_hook=Vector(signals.hook_x, signals.hook_y, signals.hook_z),
        earlier_hook=state.last_hook,
        last_pull=signals.pull,
        last_stretch=signals.stretch,
    )


@equation
def body_settled(inputs: BodyInputs, p: Body, h: float) -> BodyState:
    """The load straight below the tip and moving with it, at home, in calm air."""
    speeds = Shafts(inputs.hoist_speed, inputs.slew_speed, inputs.luff_speed)
    shafts = Shafts(0.0, 0.0, 0.0)
    before = Shafts(-h * speeds.hoist, -h * speeds.slew, -h * speeds.luff)
    rope = rope_length(shafts, p.geometry, p.home)
    lowered = rope - rope_length(before, p.geometry, p.home)
    tip = tip_at(shafts, inputs, p)
    tip_step = add_scaled(tip, -1.0, tip_at(before, inputs, p))
    hung = hanging_load(tip, 0.0, 0.0, rope, p.hanging)
    hung = set_off(hung, tip, tip_step, lowered, 0.0, 0.0, h)
    return BodyState(
        samples=2.0,
        last_speed=speeds,
        last_shaft=shafts,
        last_rope=rope,
        last_tip=tip,
        last_load=hung.load,
        earlier_load=hung.previous_load,
        last_hook=hung.hook,
        earlier_hook=hung.previous_hook,
        last_pull=hung.pull,
        last_stretch=hung.stretch,
    )


@equation
def body_limits(signals: BodySignals, p: Body) -> BodyLimits:
    """Which ends are met, and whether the rope is slack."""
    within = p.travel.lowest <= signals.boom_sin <= p.travel.highest
    return BodyLimits(
        rope_end=not p.travel.shortest <= signals.rope <= p.travel.longest,
        boom_end=not (within and signals.boom_cos > 0.0),
        slack=signals.pull <= 0.0,
    )


@equation
def body_domain(signals: BodySignals) -> float:
    """Above 0 unless the pull says that the tip moves through the rope's length within a step."""
    return signals.pull + 0.5


@equation
def bounce_margin(p: Body, h: float) -> float:
    """Above 0 unless an elastic rope lets the load bounce too fast for the step."""
    s = p.hanging
    bounce = sqrt(s.stiffness * (1.0 + s.ratio) / p.travel.shortest)
    return FASTEST + 1e-9 - bounce * h


def too_fast_bounce(p: Body, h: float, options: None) -> str:
    """What is wrong with a step [s] at which the load bounces too fast."""
    del options
    return (
        f"{p.mass:g} kg bounce on {p.travel.shortest:g} m of elastic rope too fast for "
        f"{1.0 / h:g} samples a second: use more, or a rigid rope."
    )


body = Model(
    "body",
    parameters=Body,
    state=BodyState,
    step=body_step,
    sample=body_sample,
    settled=body_settled,
    inputs=BodyInputs,
    defaults=SHIP,
    limits=body_limits,
    domain=body_domain,
    outside="the boom's tip moves within one sample by more than the rope lets the load follow",
    stable=bounce_margin,
    unstable=too_fast_bounce,
    outputs=(
        *("tip_x", "tip_y", "tip_z", "load_x", "load_y", "load_z", "hook_x", "hook_y", "hook_z"),
        *("slew", "boom", "rope", "swing", "off_lead", "side_lead", "tension"),
        *("torque_hoist", "torque_slew", "torque_luff"),
    ),
)


# --- brake ----------------------------------------------------------------------------------------

BRAKE_WAITS, BRAKE_TAKES = 0.3, 0.2
"""Time at rest before the hoist's brake falls in, and time in which it stops the drum. [s]"""


class Brake(NamedTuple):
    """The edges of the dead zone within which the hoist counts as commanded to rest."""

    lower: Annotated[float, Definition("lower edge of the hoist's dead zone", "V")]
    upper: Annotated[float, Definition("upper edge of the hoist's dead zone", "V")]


class BrakeState(NamedTuple):
    """How long the hoist has been commanded to rest, and how far the brake is in."""

    rest_time: float = 0.0
    """[s]"""
    share: float = 0.0
    """0 to 1."""


class BrakeSignals(NamedTuple):
    """The brake at a sample."""

    rest_time: float
    """[s]"""
    share: Annotated[float, Definition("share by which the hoist's brake is in", "1")]
    braked_speed: Annotated[float, Definition("speed of the hoist's shaft, braked", "rad/s")]


@equation
def braked(state: BrakeState, voltage: float, lower: float, upper: float, h: float) -> BrakeState:
    """The brake falls in some time after the voltage has come into the dead zone, and lifts."""
    rest_time = state.rest_time + h if lower < voltage < upper else 0.0
    change = h / BRAKE_TAKES if rest_time >= BRAKE_WAITS else -h / BRAKE_TAKES
    return BrakeState(rest_time, min(max(state.share + change, 0.0), 1.0))


@equation
def brake_sample(
    state: BrakeState, voltage: float, speed: float, p: Brake, h: float
) -> BrakeSignals:
    """The brake at a sample, and what it leaves of the hoist's speed."""
    now = braked(state, voltage, p.lower, p.upper, h)
    return BrakeSignals(now.rest_time, now.share, speed * (1.0 - now.share))


@equation
def brake_step(signals: BrakeSignals) -> BrakeState:
    """Keep a sample for the next one."""
    return BrakeState(signals.rest_time, signals.share)


@equation
def brake_settled(voltage: float, p: Brake) -> BrakeState:
    """In, if the voltage is within the dead zone; else lifted."""
    is_at_rest = p.lower < voltage < p.upper
    return BrakeState(BRAKE_WAITS, 1.0) if is_at_rest else BrakeState(0.0, 0.0)


brake = Model(
    "brake",
    parameters=Brake,
    state=BrakeState,
    step=brake_step,
    sample=brake_sample,
    settled=brake_settled,
    outputs=("share", "braked_speed"),
)
