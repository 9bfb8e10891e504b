# %% [markdown]
# # A load that does not swing
#
#     .venv/bin/python examples/controller.py [--figure controller.png]
#
# A turret slews a boom, from whose tip a load hangs on a rope. Ω is the turret's speed, r the
# radius of the tip, l the rope, s how far the load is ahead of the tip. For small angles
#
#     s'' + 2 ζ₀ ω s' + ω² s = -r Ω',    ω² = g/l.
#
# If the turret did at once what it is told, Ω = stick + (2 ζ ω/r) s would damp the swing by ζ. It
# does not: it has a delay, a lag, a dead zone and an orifice, and the sensor on the hook is late.
# Here the controller is designed on `drive.linearize(...)` and tried on the nonlinear drive.

# %%
import argparse
import sys
from collections import deque
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from swashplate import DomainError, Drive
from swashplate.analysis import inverse_map

parser = argparse.ArgumentParser(description="A load that does not swing.")
parser.add_argument("--figure", help="draw positions and speeds here")
options = parser.parse_args([] if "ipykernel" in sys.modules else None)

# %% [markdown]
# ## The crane
# The drive is the published one, but for its card: the jump J shall be set too low, so that the
# dead zone reaches to 1.7 V. Rope, radius and damping are assumed, and so is the sensor: it gives s
# and s' of 0.3 s ago. The controller runs at 50 Hz.

# %%
ROPE, RADIUS, OWN_DAMPING = 4.0, 15.0, 0.005  # l [m], r [m], ζ₀ [1]
SWING = np.sqrt(9.81 / ROPE)  # ω [rad/s]
LATE = 0.3  # of the sensor [s]
H = 0.02  # between two commands [s]
TIME = np.arange(0.0, 40.0, H)
STICK = np.where((TIME >= 1.0) & (TIME < 8.0), np.radians(4.0), 0.0)  # wanted speed [rad/s]

slew = Drive.preset("slew").replace(J=0.1)
model = slew.linearize(3.0)  # small motions about 3 V
inverse = inverse_map(slew)

# %% [markdown]
# ## The controller
# A PI controller of the speed, whose integral cancels the pump's lag T:
#
#     wanted = stick + (2 ζ ω/r) s,    demand = e + (1/T) ∫ e dt,    e = wanted - Ω.
#
# The demand is a speed; the voltage is in proportion to it, or what the inverse map says. The drive
# follows with Ω' = (demand - Ω)/T until its orifice holds Ω' at a: all beyond Ω ± a T is in vain,
# and a controller that knows does not integrate it. While the sensor is late the swing can be
# foretold, because (s, s') turn like a pendulum.


# %%
class Controller(NamedTuple):
    damping: float  # ζ that the swing would have with a perfect drive
    foretold: float = 0.0  # how far ahead of the sensor the swing is computed [s]
    compensated: bool = False  # voltage by the inverse map
    limited: bool = False  # demand within reach, the integral with it

    def swing(self, position, speed):
        """The swing a while after it was s and s': the pendulum's turn. [m]"""
        angle = SWING * self.foretold
        return position * np.cos(angle) + speed / SWING * np.sin(angle)

    def voltage(self, demand):
        """Voltage for a demanded speed. [V]"""
        if self.compensated:
            return float(inverse.voltage(demand, clip=True))
        ratio = inverse.plus.voltage[-1] / inverse.limits[1]
        return float(np.clip(ratio * demand, -10.0, 10.0))

    def response(self, frequency):
        """Volts by the speed's error at frequencies [Hz]: what closes the loop around the drive."""
        s = 2j * np.pi * frequency
        swing_by_speed = -RADIUS * s / (s**2 + 2.0 * OWN_DAMPING * SWING * s + SWING**2)
        late = np.exp(-LATE * s) * self.swing(1.0, s)
        wanted_by_speed = 2.0 * self.damping * SWING / RADIUS * late * swing_by_speed
        return (1.0 + 1.0 / (model.time_constant * s)) * (1.0 - wanted_by_speed) / model.gain


# %% [markdown]
# ## Design
# As much damping as leaves a delay margin of 0.1 s: the loop bears so much more than the delays of
# drive and sensor, and the samples take 0.03 s of it. The stick alone does not damp; the others but
# the last ignore something, the textbook all, and it asks for a swing without a second one.


# %%
def margin(controller):
    """Further delay that the linear loop bears, 0 if it is unstable already. [s]"""
    try:
        return model.margins(controller.response).delay_margin
    except DomainError:
        return 0.0


designed = Controller(0.0, foretold=LATE, compensated=True, limited=True)
damping = max(z for z in np.arange(0.05, 1.0, 0.05) if margin(designed._replace(damping=z)) > 0.1)
designed = designed._replace(damping=damping)
controllers = {
    "stick alone": designed._replace(damping=0.0),
    "textbook": Controller(1.0),
    "delay ignored": designed._replace(foretold=0.0),
    "limits ignored": designed._replace(limited=False),
    "dead zone ignored": designed._replace(compensated=False),
    "designed": designed,
}

# %% [markdown]
# ## On the nonlinear drive
# The stepper takes a voltage and returns the drive's signals 0.02 s later. Beyond 30° the equation
# of small angles ends, and so does the run.


# %%
def tried(controller):
    """Position of the load [m] and speed of the turret [rad/s] over `TIME`."""
    drive = slew.stepper(1.0 / H, interpolation="previous")
    reach = inverse.acceleration[0] * model.time_constant
    position = speed = turret = integral = 0.0
    seen = deque([(0.0, 0.0)] * (1 + round(LATE / H)))
    run = np.full((TIME.size, 2), np.inf)
    for n, stick in enumerate(STICK):
        wanted = stick + 2.0 * controller.damping * SWING / RADIUS * controller.swing(*seen[0])
        demand = wanted - turret + integral
        if controller.limited:
            demand = np.clip(np.clip(demand, turret - reach, turret + reach), *inverse.limits)
        integral += H / model.time_constant * (demand - integral)
        before, turret = turret, drive.step(controller.voltage(demand)).shaft_speed
        speed -= RADIUS * (turret - before)
        speed -= H * (2.0 * OWN_DAMPING * SWING * speed + SWING**2 * position)
        position += H * speed
        seen.append((position, speed))
        seen.popleft()
        run[n] = position, turret
        if abs(position) > 0.5 * ROPE:
            break
    return run.T


# %% [markdown]
# What is left of the swing in the last ten seconds, and when after the stick was let go it has come
# below 20 mm for good.

# %%
runs = {name: tried(controller) for name, controller in controllers.items()}
print(f"damping {damping:.2f}, a swing takes {2.0 * np.pi / SWING:.2f} s")
for name, (position, _) in runs.items():
    left = 1e3 * np.abs(position[TIME > 30.0]).max()
    calm = TIME[np.abs(position) > 0.02][-1] - 8.0
    swing = f"{left:.0f} mm" if left < np.inf else "over 30 deg"
    after = f"after {calm:.1f} s" if calm < 31.0 else "never"
    print(f"{name:18s} margin {margin(controllers[name]):.2f} s, {swing:>11s}, calm {after}")

# %%
figure = Figure(figsize=(9.0, 4.0), layout="constrained")
axes = figure.subplots()
for name, (position, _) in runs.items():
    axes.plot(TIME, position, lw=2.5 if name == "designed" else 1.0, label=name)
axes.set(xlabel="time [s]", ylabel="load ahead of the tip [m]", xlim=(0, 30), ylim=(-2, 2))
axes.legend(ncols=2)
if options.figure:
    figure.savefig(options.figure, dpi=150)
