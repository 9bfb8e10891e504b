# %% [markdown]
# # What a drive does
#
#     .venv/bin/python examples/simulate.py [--figure simulate.png]
#
# From a joystick's voltage to the shaft's speed: the packaged drives, a maneuver, what each limit
# does to it, other parameters, many of them at once, and a user-defined loop. Everything is in SI;
# degrees are for people.

# %%
import argparse
import sys
from math import atan, inf

import numpy as np

from swashplate import Drive, Limit, maneuvers
from swashplate.report.figures import plot_comparison, save_figure

parser = argparse.ArgumentParser(description="What a drive does.")
parser.add_argument("--figure", help="draw the step with and without its limits here")
options = parser.parse_args([] if "ipykernel" in sys.modules else None)

# %% [markdown]
# ## The packaged drives
# Where a constant voltage leads. Hoist and luff are winches, slew is the turret itself.

# %%
for name in ("hoist", "slew", "luff"):
    drive = Drive.preset(name)
    speeds = np.degrees(drive.steady_speed([-9.0, -4.0, 0.0, 4.0, 9.0]))
    print(f"{name:5s} at -9, -4, 0, 4, 9 V:", *(f"{speed:8.2f}" for speed in speeds), "deg/s")

# %% [markdown]
# ## A maneuver
# A step of 9 V from 1 s to 6 s, sampled at 512 Hz. The result has every signal of the chain, from
# the current to the shaft's position.

# %%
hoist = Drive.preset("hoist")
command = maneuvers.step(9.0)
run = hoist.simulate(command.sample(512.0))
turns = run.shaft_position[-1] / (2.0 * np.pi)
print(f"{command.name}: {np.degrees(run.shaft_speed.max()):.1f} deg/s, {turns:.3f} turns")

# %% [markdown]
# ## What each limit does
# Every sample is marked with the limits that act. What one costs shows when it is gone: how fast
# the step then becomes, and after what time it has 90 % of that. Without its stop the plate may go
# as far as the feedback arm follows, to Z3 tan α = 0.98.

# %%
limits = {
    "dead zone": (Limit.DEAD_ZONE, {"V_dz": 0.0, "Z17": 0.0}),
    "current rate": (Limit.CURRENT_RATE, {"lim1": inf, "lim2": inf}),
    "orifice": (Limit.ORIFICE, {"Z16": inf}),
    "swash stop": (Limit.SWASH_STOP, {"Z13": atan(0.98 / hoist["Z3"].value)}),
}
runs = {"the hoist as it is": run}
for name, (limit, changes) in limits.items():
    acting = run.active(limit) & (run.voltage != 0.0)
    print(f"{name:12s} acts for {acting.sum() / 512.0:.2f} s of the 5 s")
    runs[f"without {name}"] = hoist.replace(**changes).simulate(run.voltage)
for name, each in runs.items():
    top = each.shaft_speed.max()
    reached = each.time[np.argmax(each.shaft_speed >= 0.9 * top)] - 1.0
    print(f"{name:20s} {np.degrees(top):6.1f} deg/s, 90 % of it after {reached:.2f} s")

# %% [markdown]
# ## Other parameters
# A drive is immutable: `replace` and `scale` give another one. Both ways at once (`Z16`), or one
# (`Z16_plus`). `to_toml` keeps it, `Drive.from_toml` brings it back.

# %%
larger = hoist.scale(Z16=1.5, Z10=1.5)  # orifices, and the pump by speed for swash angle
print(f"orifice and pump + 50 %: {np.degrees(larger.steady_speed(10.0)):.1f} deg/s")

# %% [markdown]
# ## Many at once
# Fifteen hundred orifices under the same step, side by side on all cores: how fast is the drum half
# a second after the command?

# %%
factors = np.linspace(0.5, 2.0, 1501)
plus, minus = hoist["Z16"].value
batch = hoist.simulate_many(
    {"Z16_plus": factors * plus, "Z16_minus": factors * minus}, voltage=run.voltage
)
soon = np.degrees(batch.output[:, 768])  # at 1.5 s
for factor, speed in zip(factors[::500], soon[::500], strict=True):
    print(f"orifice x {factor:.1f}: {speed:5.1f} deg/s half a second on")

# %% [markdown]
# ## A user-defined loop
# The stepper takes one voltage and gives one sample, with the same numbers as `simulate`. Here the
# stick is let go once the drum has done a turn. That it goes on is the delay, the orifice, the lag.

# %%
stepper = hoist.stepper(512.0)
sample, stick = stepper.step(0.0), 6.5
while stick or sample.shaft_speed > 0.1:
    sample = stepper.step(stick)
    if sample.shaft_position >= 2.0 * np.pi:
        stick = 0.0
print(f"let go after a turn, it all but stands at {np.degrees(sample.shaft_position):.1f} deg")

# %%
if options.figure:
    title = "The hoist under a step of 9 V, and without its limits"
    save_figure(plot_comparison(runs, title=title), options.figure)
