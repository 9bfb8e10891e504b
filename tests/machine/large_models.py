"""Models of many states: a crane's body, three drives with it, and a chain of masses."""

import importlib.util
from pathlib import Path
from typing import Any, NamedTuple

from swashplate import Drive
from swashplate.crane import Crane, OperatorCommand, simulate
from swashplate.crane.kinematics import (
    Geometry,
    Home,
    Shafts,
    Vector,
    add_scaled,
    boom_at,
    rope_length,
    rotation,
    tip_of,
    to_inertial,
)
from swashplate.crane.rope import Hanging, Hung, hanging_load, rope_step, set_off
from swashplate.machine import Model, equation, join
from swashplate.models.drive import drive

# --- a crane's body: three speeds and the ship's motion in, the load out --------------------------


class Body(NamedTuple):
    geometry: Geometry
    home: Home
    hanging: Hanging


class Inputs(NamedTuple):
    hoist: float
    slew: float
    luff: float
    surge: float
    sway: float
    heave: float
    roll: float
    pitch: float
    yaw: float


class State(NamedTuple):
    count: float
    speeds: Shafts
    shafts: Shafts
    rope: float
    tip: Vector
    hung: Hung


class Signals(NamedTuple):
    shafts: Shafts
    rope: float
    tip: Vector
    hung: Hung


@equation
def sample(state: State, inputs: Inputs, p: Body, h: float) -> Signals:
    half = 0.5 * h if state.count > 0.5 else 0.0
    shafts = Shafts(
        state.shafts.hoist + half * (state.speeds.hoist + inputs.hoist),
        state.shafts.slew + half * (state.speeds.slew + inputs.slew),
        state.shafts.luff + half * (state.speeds.luff + inputs.luff),
    )
    boom = boom_at(shafts.luff, p.geometry, p.home)
    rope = rope_length(shafts, p.geometry, p.home)
    r = rotation(inputs.roll, inputs.pitch, inputs.yaw)
    shift = Vector(inputs.surge, inputs.sway, inputs.heave)
    tip = to_inertial(r, tip_of(p.home.slew + shafts.slew, boom, p.geometry), shift)
    hung = state.hung
    if state.count < 0.5:
        hung = hanging_load(tip, 0.0, 0.0, rope, p.hanging)
    else:
        square = h * h
        if state.count < 1.5:
            square = 0.5 * square
            moved = add_scaled(tip, -1.0, state.tip)
            hung = set_off(hung, state.tip, moved, rope - state.rope, 0.0, 0.0, h)
        hung = rope_step(hung, state.tip, tip, rope, p.hanging, h, square)
    return Signals(shafts, rope, tip, hung)


@equation
def step(state: State, signals: Signals, inputs: Inputs) -> State:
    speeds = Shafts(inputs.hoist, inputs.slew, inputs.luff)
    return State(
        min(state.count + 1.0, 2.0),
        speeds,
        signals.shafts,
        signals.rope,
        signals.tip,
        signals.hung,
    )


body = Model("body", parameters=Body, state=State, step=step, sample=sample, inputs=Inputs)
SHIP = ("surge", "sway", "heave", "roll", "pitch", "yaw")


def crane_run(*, brake: bool = True):  # of crane.simulate
    """A run of the packaged crane, whose parts the body takes."""
    command = OperatorCommand.trapezoid(
        slew=1.0, luff=0.3, hoist=-0.2, until={"slew_deg": 45.0}, duration=5.0
    )
    return simulate(Crane.preset("tg3637"), command, brake=brake)


# --- three drives and the body --------------------------------------------------------------------

AXES = ("hoist", "slew", "luff")

crane = join(
    "crane",
    {**dict.fromkeys(AXES, drive), "body": body},
    links={f"body.{axis}": f"{axis}.shaft_speed" for axis in AXES},
)


class Numbers(NamedTuple):
    p: Any
    options: Any


def numbers_of_drive(axis: str) -> Numbers:
    """Parameters and options of a packaged drive."""
    parts = Drive.preset(axis).parts
    p = drive.parameters(*(part.p for part in parts))
    return Numbers(p, drive.options(*(part.options for part in parts)))


def numbers_of_crane(numbers: Body) -> Numbers:
    """Those of the packaged drives and a body on their shafts."""
    drives = {axis: numbers_of_drive(axis) for axis in AXES}
    p = crane.parameters(**{axis: each.p for axis, each in drives.items()}, body=numbers)
    return Numbers(p, crane.options(**{axis: each.options for axis, each in drives.items()}))


# --- a chain of masses, springs and stops ---------------------------------------------------------

HEAD = '''
from typing import NamedTuple

from swashplate.machine import Model, equation


class Chain(NamedTuple):
    mass: float
    stiffness: float
    damping: float
    stop: float
    hard: float


@equation
def force(a: float, b: float, v: float, w: float, p: Chain) -> float:
    """Of a spring between two masses, harder beyond a stop."""
    stretch = b - a
    pull = p.stiffness * stretch + p.damping * (w - v)
    if stretch > p.stop:
        pull = pull + p.hard * (stretch - p.stop)
    elif stretch < -p.stop:
        pull = pull + p.hard * (stretch + p.stop)
    return pull
'''


def chain_of(masses: int, folder: Path):  # a module made of a text
    """A module with the model of some masses in a row, the first tied to a wall."""
    n = range(masses)
    lines = [HEAD, "", "class State(NamedTuple):"]
    lines += [f"    {letter}{i}: float" for letter in "xv" for i in n]
    lines += ["", "", "class End(NamedTuple):", "    end: float", "", ""]
    lines += [
        "@equation",
        "def sample(state: State) -> End:",
        f"    return End(state.x{masses - 1})",
    ]
    lines += ["", "", "@equation"]
    lines += ["def step(state: State, push: float, p: Chain, h: float) -> State:"]
    lines += ["    f0 = force(0.0, state.x0, 0.0, state.v0, p)"]
    for i in range(1, masses):
        ends = f"state.x{i - 1}, state.x{i}, state.v{i - 1}, state.v{i}"
        lines.append(f"    f{i} = force({ends}, p)")
    lines.append(f"    f{masses} = push")
    lines += [f"    v{i} = state.v{i} + h * (f{i + 1} - f{i}) / p.mass" for i in n]
    places = ", ".join(f"state.x{i} + h * v{i}" for i in n)
    lines.append(f"    return State({places}, {', '.join(f'v{i}' for i in n)})")
    lines += [
        "",
        "",
        'chain = Model("chain", parameters=Chain, state=State, step=step, sample=sample)',
    ]
    file = folder / f"chain_of_{masses}.py"
    file.write_text("\n".join([*lines, ""]), "utf-8")
    spec = importlib.util.spec_from_file_location(file.stem, file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
