# %% [markdown]
# # Two winches on one barge
#
# Two hydrostatic winches pull a barge with a rope each. The drives are the package's, the barge is
# a model of one's own; joined, they are one machine, which is simulated, linearised and exported
# like any other.
#
#     .venv/bin/python examples/tug.py --figure tug.png

# %%
import argparse
from typing import NamedTuple

import numpy as np

from swashplate import Drive, Machine, Model, equation, export, join, linearize, simulate

parser = argparse.ArgumentParser(description="Two winches pull a barge.")
parser.add_argument("--figure", metavar="FILE", help="draw the run")
parser.add_argument("--fmu", metavar="FILE", help="write the machine as an FMU")
given = parser.parse_args()

# %% [markdown]
# ## The barge
#
# A rope that is reeled in farther than the barge has come pulls on it, and never pushes.


# %%
class Barge(NamedTuple):
    drum_radius: float = 0.3  # m
    rope_stiffness: float = 8e4  # N/m
    mass: float = 4e5  # kg
    drag: float = 2e4  # N s²/m²


class Place(NamedTuple):
    port_drum: float = 0.0  # rad
    starboard_drum: float = 0.0  # rad
    position: float = 0.0  # m
    speed: float = 0.0  # m/s


class Pulls(NamedTuple):
    port_pull: float  # N
    starboard_pull: float  # N


@equation
def pulls(state: Place, p: Barge) -> Pulls:
    drums = (state.port_drum, state.starboard_drum)
    stretches = tuple(p.drum_radius * angle - state.position for angle in drums)
    return Pulls(*tuple(max(0.0, p.rope_stiffness * stretch) for stretch in stretches))


@equation
def moved(state: Place, signals: Pulls, port: float, starboard: float, p: Barge, h: float) -> Place:
    resistance = p.drag * state.speed * abs(state.speed)
    force = signals.port_pull + signals.starboard_pull - resistance
    speed = state.speed + h * force / p.mass
    return Place(
        state.port_drum + h * port,
        state.starboard_drum + h * starboard,
        state.position + h * speed,
        speed,
    )


@equation
def still(p: Barge) -> Place:
    """Where it rests, if the drums do."""
    return Place(0.0, 0.0, 0.0 * p.mass, 0.0)


barge = Model("barge", Barge, Place, moved, pulls, settled=still)

# %% [markdown]
# ## The tug
#
# The starboard winch has an orifice half as wide. All that a member has stands at a path.

# %%
winch = Drive.preset("hoist")
narrow = winch.scale(Z16_plus=0.5, Z16_minus=0.5)
tug = join(
    "tug",
    {"port": winch, "starboard": narrow, "barge": Machine(barge, Barge())},
    links={"barge.port": "port.shaft_speed", "barge.starboard": "starboard.shaft_speed"},
)

# %%
rate = 512.0
time = np.arange(round(20.0 * rate)) / rate
lever = np.where((time > 1.0) & (time < 8.0), 5.0, 0.0)
run = simulate(tug, {"port.voltage": lever, "starboard.voltage": lever}, rate)
for side in ("port", "starboard"):
    speed, pull = run[f"{side}.shaft_speed"].max(), run[f"{side}_pull"].max()
    print(f"{side}: at most {speed:.2f} rad/s, {1e-3 * pull:.1f} kN")
print(f"the barge has come {run['position'][-1]:.2f} m")

# %% [markdown]
# ## Linear model
#
# About rest the barge swings on both ropes, at √(2 k/m).

# %%
linear = linearize(tug, {"port.voltage": 0.0, "starboard.voltage": 0.0}, rate)
values = np.linalg.eigvals(linear.A)
poles = rate * np.log(values[np.abs(values) > 1e-9].astype(complex))
swings = sorted(pole.imag for pole in poles if 0.1 < pole.imag < 10.0)
expected = np.sqrt(2.0 * Barge().rope_stiffness / Barge().mass)
print(f"it swings at {swings[0]:.3f} rad/s, by formula {expected:.3f} rad/s")

# %%
if given.figure:
    names = ["port.shaft_speed", "starboard.shaft_speed", "port_pull", "starboard_pull", "position"]
    run.plot(names, title="Two winches on one barge").savefig(given.figure)
if given.fmu:
    print(f"{export.fmu(tug, given.fmu, step=1.0 / rate).name} written")
