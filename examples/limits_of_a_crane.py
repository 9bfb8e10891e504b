# %% [markdown]
# # What limits my crane
#
#     .venv/bin/python examples/limits_of_a_crane.py [drive.toml] [--figure limits.png]
#
# What can it do at all? Which of its limits costs a working cycle most? What would a change of the
# costliest component bring, and how large a change is needed? For the packaged hoist, or for a
# parameter file of your own, such as the `drive.toml` of a fit.

# %%
import argparse
import sys

import numpy as np

from swashplate import Drive, maneuvers
from swashplate.analysis import (
    Requirements,
    envelope,
    limit_shares,
    performance,
    size,
    trial_of,
    what_if,
)
from swashplate.report.figures import plot_limit_timeline, save_figure

parser = argparse.ArgumentParser(description="What limits my crane.")
parser.add_argument("drive", nargs="?", help="a parameter file; by default the packaged hoist")
parser.add_argument("--figure", help="draw which limit acts when here")
options = parser.parse_args([] if "ipykernel" in sys.modules else None)
drive = Drive.from_toml(options.drive) if options.drive else Drive.preset("hoist")

# %% [markdown]
# ## The envelope
# Each way from the edge of the dead zone to the speed limit, and how hard it sets off.

# %%
found = envelope(drive)
for name, way in (("up", found.plus), ("down", found.minus)):
    end = way.saturation_voltage or np.copysign(10.0, way.top_speed)  # 10 V where it never stays
    print(
        f"{name:5s} from {way.dead_zone:.3f} to {end:.2f} V, "
        f"{np.degrees(way.top_speed):.1f} deg/s, {np.degrees(way.acceleration):.1f} deg/s²"
    )

# %% [markdown]
# ## A working cycle
# Lift fast, place slowly, wait, lower fast, place slowly. Each limit is taken away in turn and the
# cycle is simulated again: by how much of itself does the error fall? The error is the rms of the
# speed less that of the same drive without any limit.

# %%
cycle = maneuvers.stairs([9.0, 1.5, 0.0, -9.0, -1.5, 0.0], dwell=3.0)
shares = limit_shares(drive, cycle.sample())
print(
    f"over a cycle of {cycle.length:g} s the limits cost {np.degrees(shares.error):.1f} deg/s rms"
)
for share in shares.shares[:3]:
    print(f"{share.limit:12s} {100 * share.error_share:5.1f} %, {share.component}")

# %% [markdown]
# ## What if it were better
# The component that comes first, changed by what a workshop can do.

# %%
REMEDIES = {
    "dead zone": {"dead_zone": 0.5},
    "current rate": {"rate_limits": 2.0},
    "final decay": {"I_t2": 0.5},
    "delay": {"tau": 0.5},
    "orifice": {"orifice": 1.5},
    "spool stop": {"spool_stroke": 1.5},
    "swash stop": {"pump": 1.25},
    "relief valve": {"relief": 1.25},
    "spool offset": {"spool_offset": 0.5},
}
first = shares.shares[0].limit
step = trial_of(drive, maneuvers.step(9.0).sample())
better = what_if(drive, REMEDIES[first], step, outcomes=["peak_speed", "rise_time"])
(speed, rise), (then, sooner) = better.before.values, better.after.values
factors = (f"{variable} x {factor:g}," for variable, factor in REMEDIES[first].items())
print(*factors, "a step of 9 V:")
print(f"  {np.degrees(speed):.1f} -> {np.degrees(then):.1f} deg/s, in {rise:.2f} -> {sooner:.2f} s")

# %% [markdown]
# ## How large must it be
# A tenth more speed and a fifth more acceleration than now, each in its worse direction: the
# smallest change of pump and orifice that is enough, and what each would need by itself.

# %%
now = performance(drive)
required = Requirements(speed=1.1 * now.speed, acceleration=1.2 * now.acceleration)
sized = size(drive, required, {"pump": (0.5, 2.0), "orifice": (0.5, 2.0)})
for variable, factor in sized.factors.items():
    alone = sized.sufficient_factors[variable]
    print(f"{variable} x {factor:.3f}, by itself {'never' if alone is None else f'x {alone:.3f}'}")

# %%
if options.figure:
    save_figure(plot_limit_timeline(shares.run), options.figure)
