# %% [markdown]
# # Shape the operator's commands
#
#     .venv/bin/python examples/joint_shaper.py [--figure slews.png]
#
# An open-loop control of a crane needs nothing but the length of its rope: each command is split
# into two, half a period of the load apart, and the second one stops the swing of the first. What
# is left of that if the drives are not ideal? A slew by 45 degrees at full stick, with an undamped
# load.

# %%
import argparse
import sys

import numpy as np

from swashplate.crane import Crane, OperatorCommand, simulate
from swashplate.report.figures import plot_crane, save_figure

parser = argparse.ArgumentParser(description="Shape the operator's commands.")
parser.add_argument("--figure", help="draw the slews here")
options = parser.parse_args([] if "ipykernel" in sys.modules else None)

RATE = 512.0
ROPE = 20.0
GRAVITY = 9.80665
crane = Crane.preset("tg3637")

# %% [markdown]
# ## The shaper
# ZV, zero vibration: half of the command at once, half of it half a period later. It is made for
# one rope; a crane that hoists while it slews needs another delay from moment to moment.


# %%
def shaped(commands: np.ndarray, rope: float) -> np.ndarray:
    """(n, 3) commands of hoist, slew and luff through a ZV shaper for a rope. [m]"""
    time = np.arange(len(commands)) / RATE
    half = np.pi * np.sqrt(rope / GRAVITY)
    late = [np.interp(time - half, time, axis) for axis in commands.T]
    return 0.5 * (commands + np.transpose(late))


# %% [markdown]
# ## The slews
# Ideal drives show what the shaper does if nothing is in its way. With volts, 10 V stand for full
# speed: half of the voltage is not half of the speed, so that the halves do not cancel, and the
# slew misses its target by far. The inverse map of each drive undoes that.

# %%
operator = OperatorCommand.trapezoid(slew=1.0, until={"slew_deg": 45.0}, length=60.0)
plain = simulate(crane, operator, actuation="ideal", rope_m=ROPE, swing_damping=0.0)
commands = {
    "as it is": operator,
    "shaped": OperatorCommand.record(shaped(plain.stick, ROPE), RATE),
}

# %%
runs = {}
for actuation in ("ideal", "volts", "inverse"):
    for name, command in commands.items():
        run = simulate(crane, command, actuation=actuation, rope_m=ROPE, swing_damping=0.0)
        runs[f"{actuation}, {name}"] = run
        print(
            f"{actuation:8s} {name:9s} {run.residual_deg:5.2f} deg are left, "
            f"the slew ends at {run.slew_deg[-1]:5.2f} deg"
        )

# %%
if options.figure:
    save_figure(plot_crane(runs), options.figure)
