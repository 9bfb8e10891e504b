# %% [markdown]
# # Model predictive control beside the clip
#
#     .venv/bin/python examples/crane_mpc.py [--seeds 6]
#
# A crane lies abeam in beam seas and slews by 30 degrees. The luff drive cannot accelerate the tip
# as fast as the ship moves it: control that does not know this feeds the swing. The clip knows it
# by one number. A predictive controller knows more: it solves, five times a second and for each
# direction of the tip, a quadratic program over the next ten seconds, with the speed and the
# acceleration of the identified drives as its constraints. Is that worth it?
#
# Needs `osqp`: pip install 'swashplate[mpc]'.

# %%
import argparse
import sys
from time import process_time

import numpy as np
import osqp
from scipy import signal, sparse

from swashplate.crane import (
    Crane,
    CraneStepper,
    OperatorCommand,
    Seaway,
    control,
    follow,
    kinematics,
    simulate,
)

parser = argparse.ArgumentParser(description="Model predictive control beside the clip.")
parser.add_argument("--seeds", type=int, default=6, help="number of seaways")
parser.add_argument("--length", type=float, default=120.0, help="of each [s]")
options = parser.parse_args([] if "ipykernel" in sys.modules else None)

RATE, BLOCK = 512.0, 100  # samples a second, samples between two programs
H, HORIZON = BLOCK / RATE, 51  # [s], steps: 10 s
LAG = 0.2  # of the identified drives, delay and lag of the pump together [s]
START = 40.0  # swing counts from here on [s]
POSE = {"slew_deg": 75.0, "boom_deg": 45.0, "rope_m": 27.0}
STICK = OperatorCommand.trapezoid(
    slew=0.5, until={"slew_deg": 105.0}, start=50.0, length=options.length
)
crane = Crane.preset("tg3637")

# %% [markdown]
# ## The model
# The load is a pendulum along the boom and one across it, driven by the tip's speed u. To each are
# added the tip's distance y from where the operator wants it over the sea, the drive
# as a lag T behind its command c, and what the ship adds to the tip's speed, w:
#
#     d' = v - u - w,   v' = -g/L d,   y' = u + w,   u' = (c - u)/T,   c' = a.
#
# The program chooses the acceleration a of the command for each step.

# %%
A, B = np.zeros((5, 5)), np.zeros((5, 2))
A[0, 1], A[1, 0] = 1.0, -9.80665 / POSE["rope_m"]
A[0, 3], A[2, 3] = -1.0, 1.0
A[3, 3:] = -1.0 / LAG, 1.0 / LAG
B[4, 0], B[0, 1], B[2, 1] = 1.0, -1.0, 1.0  # a, and the ship's w
F, G, *_ = signal.cont2discrete((A, B, np.eye(5), np.zeros((5, 2))), H)
powers = [np.linalg.matrix_power(F, k) for k in range(HORIZON + 1)]
FREE = np.array(powers[1:])  # (steps, 5, 5) by the present state
FORCED = np.zeros((2, HORIZON, 5, HORIZON))  # by a and by w of each step
for k in range(HORIZON):
    for j in range(k + 1):
        FORCED[:, k, :, j] = (powers[k - j] @ G).T

# Cost: squares of the swing d, of the load's distance d + y from its place, of the acceleration.
COST = np.zeros((3, 5))
COST[0, 0], COST[1, [0, 2]] = 2.0, 1.0
EFFORT = 0.05


class Axis:
    """The quadratic program of one direction of the tip."""

    def __init__(self) -> None:
        self.solver = osqp.OSQP()
        self.rows = np.einsum("rs,ksj->krj", COST, FORCED[0]).reshape(-1, HORIZON)
        speeds = FORCED[0][:, 4]
        self.solver.setup(
            sparse.csc_matrix(self.rows.T @ self.rows + EFFORT * np.eye(HORIZON)),
            np.zeros(HORIZON), sparse.csc_matrix(np.vstack([np.eye(HORIZON), speeds])),
            np.full(2 * HORIZON, -1.0), np.ones(2 * HORIZON), verbose=False, eps_abs=1e-4,
            eps_rel=1e-4, warm_starting=True,
        )  # fmt: skip

    def acceleration(self, coming: np.ndarray, speed: float, least: float, most: float) -> float:
        """First of the best accelerations [m/s²], at speeds up to one [m/s].

        coming: (steps, 5) states that come if the command stays as it is.
        """
        ones = np.ones(HORIZON)
        self.solver.update(
            q=self.rows.T @ (coming @ COST.T).ravel(),
            l=np.concatenate([least * ones, -speed - coming[:, 4]]),
            u=np.concatenate([most * ones, speed - coming[:, 4]]),
        )
        return float(np.clip(self.solver.solve(raise_error=True).x[0], least, most))


# %% [markdown]
# ## The loop
# The controller sees what the others see: load, tip, speeds of the shafts, motion of the ship. How
# the ship will move it takes for a sine of the sea's mean period with the present place and speed;
# the stick, to stay as it is.


# %%
def wanted_path(stick: np.ndarray) -> np.ndarray:
    """(n, 2) where the operator wants the load over the sea. [m]"""
    low, high = crane.inverse("slew").limits
    speed = np.where(stick[:, 1] > 0.0, high, -low) * stick[:, 1]
    slew = np.radians(POSE["slew_deg"]) + np.cumsum(speed) / RATE
    g = crane.geometry
    reach = g.foot + g.boom * np.cos(np.radians(POSE["boom_deg"]))
    return np.stack([g.axis.x + reach * np.cos(slew), g.axis.y - reach * np.sin(slew)], axis=1)


def predictive(ship: np.ndarray, stick: np.ndarray, omega: float) -> tuple[np.ndarray, list[float]]:
    """Signals of the crane under predictive control, and processor times of its steps. [s]"""
    stepper, axes, g = CraneStepper(crane, **POSE), (Axis(), Axis()), crane.geometry
    inverses = crane.inverse("luff"), crane.inverse("slew")
    wanted, command, spent = wanted_path(stick), np.zeros(2), []
    out = [stepper.take(np.zeros((BLOCK, 3)), ship[:BLOCK])]
    middle, end = H * (np.arange(HORIZON) + 0.5), H * np.arange(1.0, HORIZON + 1.0)
    for n in range(BLOCK, len(stick), BLOCK):
        begun = process_time()
        past, now = (stepper.named(row) for row in out[-1][-2:])
        boom = kinematics.Boom(now["boom_cos"], now["boom_sin"])
        slew = np.radians(POSE["slew_deg"]) + now["shaft_slew"]
        turn = np.array([[np.cos(slew), -np.sin(slew)], [-np.sin(slew), -np.cos(slew)]])
        reach = g.foot + g.boom * boom.cos
        # speeds of the tip, for each rad/s of a shaft
        rates = np.array([-kinematics.reach_rate(boom, g), reach])
        # what the ship adds to the tip's place, and how fast
        x, y = g.axis.x + reach * np.cos(slew), g.axis.y - reach * np.sin(slew)
        surge, sway, _, roll, pitch, yaw = ship[n - 2 : n].T
        z = g.axis.z + g.boom * boom.sin
        shift = turn @ np.array([surge - yaw * y + pitch * z, sway + yaw * x - roll * z])
        tip, load, before = (
            turn @ np.array([each[f"{what}_x"], each[f"{what}_y"]])
            for each, what in ((now, "tip"), (now, "load"), (past, "load"))
        )
        path = turn @ wanted[n - 2 : n].T
        state = np.stack(
            [load - tip, (load - before) * RATE, tip - path[:, 1],
             rates * (now["speed_luff"], now["speed_slew"]), command]
        )  # fmt: skip
        driven = np.diff(path)[:, 0] * RATE
        following = np.zeros(2)
        for k, inverse in enumerate(inverses):
            w = np.diff(shift[k])[0] * RATE * np.cos(omega * middle)
            w -= omega * shift[k, 1] * np.sin(omega * middle)
            coming = FREE @ state[:, k] + FORCED[1] @ w
            coming[:, 2] -= driven[k] * end
            plus, minus = inverse.acceleration
            least, most = sorted((-rates[k] * minus, rates[k] * plus))
            speed = abs(rates[k]) * min(np.abs(inverse.limits))
            following[k] = command[k] + H * axes[k].acceleration(coming, speed, least, most)
        spent.append(process_time() - begun)
        count = min(BLOCK, len(stick) - n)
        ramp = command + np.outer(np.arange(1, count + 1) / BLOCK, following - command)
        speeds = ramp / rates
        full = np.array([[-each.limits[0], each.limits[1]] for each in inverses])
        parts = np.clip(speeds / np.where(speeds > 0.0, full[:, 1], full[:, 0]), -1.0, 1.0)
        sticks = np.stack([stick[n : n + count, 0], parts[:, 1], parts[:, 0]], axis=1)
        out.append(stepper.take(sticks, ship[n : n + count]))
        command = following
    return np.concatenate(out), spent


# %% [markdown]
# ## The comparison
# Shaper, clip and predictive control in the same seaways. Swing is the root mean square angle of
# the rope; off the place, the load's distance from where the operator wants it over the sea.

# %%
SHAPER = control.TipShaper("zv")
LAWS = {
    "no control": None,
    "shaper": SHAPER,
    "clip": SHAPER
    | control.DelayedFeedback(0.2, 0.2)
    | control.ShipCompensation()
    | control.Clip(),
}


def outcome(out: np.ndarray, names: tuple[str, ...], wanted: np.ndarray) -> tuple[float, float]:
    """Swing [deg] and distance from the wanted place [m], root mean squares."""
    column = {name: out[round(START * RATE) :, k] for k, name in enumerate(names)}
    tip, load = (
        np.stack([column[f"{each}_{axis}"] for axis in "xyz"], axis=1) for each in ("tip", "load")
    )
    d = load - tip
    swing = np.degrees(np.arctan2(np.hypot(d[:, 0], d[:, 1]), -d[:, 2]))
    off = np.linalg.norm(load[:, :2] - wanted[round(START * RATE) :], axis=1)
    return float(np.sqrt(np.mean(swing**2))), float(np.sqrt(np.mean(off**2)))


def compared(sea: str) -> dict[str, np.ndarray]:
    """(seaways, 2) outcomes of each controller, and what a step of the predictive one takes."""
    omega = 2.0 * np.pi / follow(crane, [7.5], seas=(sea,)).seas[sea].period
    made: dict[str, list[tuple[float, float]]] = {name: [] for name in (*LAWS, "predictive")}
    times: list[float] = []
    for seed in range(options.seeds):
        runs = {}
        seaway = Seaway(sea, seed=seed)
        for name, law in LAWS.items():
            run = simulate(crane, STICK, sea=seaway, control=law, **POSE)
            runs[name] = run.out
        wanted = wanted_path(run.stick)
        runs["predictive"], spent = predictive(run.ship, run.stick, omega)
        times += spent
        for name, out in runs.items():
            made[name].append(outcome(out, run.rows, wanted))
    return {name: np.array(each) for name, each in made.items()} | {"times": np.array(times)}


# %%
for sea in ("ss2", "ss3"):
    found = compared(sea)
    times = found.pop("times")
    print(f"{sea}, {options.seeds} seaways")
    for name, values in found.items():
        (swing, off), worst = values.mean(axis=0), values[:, 0].max()
        print(f"  {name:12s} {swing:5.2f} deg (worst {worst:5.2f}), {off:5.2f} m off the place")
    print(f"  a step of predictive control takes {1e3 * np.median(times):.1f} ms")
