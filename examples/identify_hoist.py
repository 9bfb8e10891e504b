# %% [markdown]
# # Identify a hoist
#
#     .venv/bin/python examples/identify_hoist.py [--out identified] [--figure identified.png]
#
# From the logs of its tests to a drive that predicts others. The hoist is a virtual one, so that
# the truth can stand beside the estimates: every number differs by some 5 % from that of
# the published one, which the fit starts from. With logs of your own, begin at "The campaign".

# %%
import argparse
import sys
from pathlib import Path

import numpy as np

from swashplate import Campaign, Drive, identify, rig
from swashplate.identification import (
    drawn_drive,
    run_information,
    smooth,
    true_value,
    uncertainty_of,
    whole_drive,
    with_speeds,
)
from swashplate.report.figures import plot_channel, save_figure

parser = argparse.ArgumentParser(description="Identify a hoist.")
parser.add_argument("--out", type=Path, default=Path("identified"), help="folder for all files")
parser.add_argument("--figure", help="draw a predicted run and the estimates here")
options = parser.parse_args([] if "ipykernel" in sys.modules else None)

# %% [markdown]
# ## Virtual tests
# Kruse's 13 tests: ramps, steps and sines, logged at 512 Hz through a 12-bit command, an
# ammeter that does not know the sign, and an encoder. The same seed gives the same logs.

# %%
nominal = Drive.preset("hoist").at_every_rate()
setup = whole_drive(nominal.parameters)  # every number, known beforehand to within 30 %
truth = drawn_drive(nominal, setup, seed=1)
tests = rig.run("hoist", truth=truth, seed=1)
path = rig.write(tests, options.out / "virtual", overwrite=True)

# %% [markdown]
# ## The campaign
# `campaign.toml` says which column is what, which runs are for the fit and which are held back.

# %%
campaign = Campaign.from_toml(path)
runs = campaign.select(role="fit")
held_back = campaign.select(role="validate")
start = campaign.drive("hoist").parameters
print(f"{len(runs)} runs to fit, {len(held_back)} held back")

# %% [markdown]
# ## Before the fit: what can these runs tell?
# The runs are simulated with the drive that the fit starts from. What no run depends on, and what
# can only be told together, is said before anything is fitted.

# %%
information = run_information(setup, smooth(start), runs)
print(f"{len(information.problem.unknowns.names)} parameters")
for sentence in information.sentences():
    print(f"  {sentence}")

# %% [markdown]
# ## The fit
# All numbers at once, from the ammeter and from the shaft's position.

# %%
result = identify(campaign, free=setup)
print("converged" if result.fit.solution.converged else result.fit.solution.message)

# %% [markdown]
# ## The estimates, and the truth
# Intervals of 95 %, for residuals that are coloured. Where the data give none, its status says why.

# %%
SHOWN = ("V_dz_plus", "G1_plus", "omega_plus", "Z8", "Z10", "Z13_plus", "Z16_plus")
true, inside = {}, []
print("              truth   estimate     95 % from         to")
problem = result.fit.problem
for unknown, each in zip(problem.unknowns, uncertainty_of(result.fit).estimates, strict=True):
    value = true_value(unknown, problem.model, truth.parameters)
    if value is None:  # the zero of a run's position
        continue
    true[unknown.name] = value
    if each.lower is not None and each.upper is not None:
        inside.append(each.lower <= value <= each.upper)
        ends = f"{each.lower:10.4g} {each.upper:10.4g}"
    else:
        ends = each.status
    if unknown.name in SHOWN:
        print(f"{unknown.name:10s} {value:10.4g} {each.value:10.4g}    {ends}")
print(f"{sum(inside)} of {len(inside)} intervals hold the truth")

# %% [markdown]
# ## Is it any good
# The runs held back are predicted from their voltage alone.

# %%
speeds = [
    each
    for each in with_speeds(result.predicted)
    if each.experiment[each.channel].kind == "shaft_speed"
]
for each in speeds:
    print(f"{each.experiment.run}: speed to {np.degrees(each.measures.rmse):.2f} deg/s rms")
print(result.verdict.headline)

# %% [markdown]
# ## The folder of the fit
# All commands take it, and `Drive.from_toml` and `Identification.load` read it.

# %%
result.save(options.out)
for name, drive in (("identified", result.drive), ("true", truth)):
    print(f"{name} limits:", *np.degrees(drive.steady_speed([-10.0, 10.0])).round(1), "deg/s")
if options.figure:
    run = speeds[-1]
    save_figure(plot_channel(run.experiment[run.channel], run.simulated), options.figure)
