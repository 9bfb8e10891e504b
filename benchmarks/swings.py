"""Swinging loads that share no line with swashplate, logged, fitted and counted.

    .venv/bin/python benchmarks/swings.py --out found.jsonl [--seeds 0 9]
    .venv/bin/python benchmarks/swings.py --report found.jsonl

A load that swings freely below a crane at rest, integrated by SciPy from its equations of motion:
a point on a sphere, or a hook with the load on slings. Of each load there is one log of both angles
with the sensor's zero and noise. Five seeds in a row are one of each kind:

- plain: linear damping, in one plane or along an ellipse;
- drag: with a resistance that grows with the square of the speed besides;
- beats: a load on slings below a hook that was moving on its own when the log begins;
- turning: something turns the plane of swing, as Foucault's pendulum does, up to a right angle;
- two planes: the damping along the boom is not that across it.

Each log becomes a campaign and is fitted by `identify` with a crane's `body` as the machine.
Counted is whether the 95 % intervals of damping ratio and rope hold, or are refused: the fit is not
usable, or an interval lacks an end. Of a log with two dampings an interval holds if it has both.
The rope of a load on slings is asked only of the fit that has slings. What `swing_damping` makes of
the same log stands beside it.

Seeds 0 to 9 are for development, 200 to 239 for judgement, drawn after the ranges were committed.
Seeds 100 to 139 had judged fits at 100 steps a second, which take damping for 0.005 % of the rope.
Every load is a line of JSON.
"""

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from swashplate import SwashplateError, identify
from swashplate.crane import Crane, Suspension, body, swing_damping
from swashplate.identification import ModelSetup

GRAVITY = 9.80665

# --- the ranges of what is drawn ------------------------------------------------------------------

KINDS = ("plain", "drag", "beats", "turning", "two planes")
DAMPING = (0.002, 0.01)
"""Ratio, evenly in its logarithm. [1]"""
ROPE = (8.0, 40.0)
"""[m]"""
ROPE_NOMINAL = 0.03
"""Standard deviation of what the owner takes for the rope's length, over the length. [1]"""
AMPLITUDE = (3.0, 12.0)
"""Of the swing as the log begins. [deg]"""
ELLIPSE = (0.0, 0.5)
"""Smaller over larger axis of its path; 0 in one of two plain logs. [1]"""
SWINGS = (10.0, 30.0)
"""Length of the log."""
RATE = (5.0, 10.0, 20.0)
"""[Hz]"""
NOISE = (0.03, 0.2)
"""Standard deviation, in one of two logs with a memory of `MEMORY`. [deg]"""
MEMORY = (0.1, 1.0)
"""[s]"""
ZERO = 1.0
"""Standard deviation of each sensor's zero. [deg]"""
DRAG = (0.3, 2.0)
"""Damping ratio of the quadratic resistance at the first amplitude, over the linear one. [1]"""
SLING = (2.0, 5.0)
"""[m]"""
MASSES = (4.0, 20.0)
"""Load over hook. [1]"""
HOOK_SPEED = 0.3
"""Standard deviation of the hook's own speed on each axis as the log begins. [m/s]"""
KNOWN_SLING, KNOWN_MASSES = 0.02, 0.05
"""Standard deviations of what the owner knows of slings and masses, over these. [1]"""
TURN = (10.0, 90.0)
"""By which the plane turns over the log, either way. [deg]"""
OTHER_DAMPING = (1.2, 2.5)
"""Damping across the boom over that along it, or the inverse. [1]"""


def drawn(seed: int) -> dict[str, float | str]:
    """Numbers of a load and its log, SI but for angles in degrees."""
    random = np.random.default_rng([20261130, seed])
    kind = KINDS[seed % len(KINDS)]

    def between(ends: tuple[float, float], *, by_order: bool = False) -> float:
        low, high = np.log(ends) if by_order else ends
        value = random.uniform(low, high)
        return float(np.exp(value) if by_order else value)

    rope, amplitude = between(ROPE), between(AMPLITUDE)
    flat = kind == "plain" and seed // len(KINDS) % 2 == 0
    ellipse = between(ELLIPSE)
    load: dict[str, float | str] = {
        "seed": seed,
        "kind": kind,
        "rope": rope,
        "rope_nominal": rope * (1.0 + ROPE_NOMINAL * random.standard_normal()),
        "damping": between(DAMPING, by_order=True),
        "amplitude": amplitude,
        "ellipse": 0.0 if flat else ellipse,
        "direction": random.uniform(0.0, 360.0),
        "swings": between(SWINGS),
        "rate": float(random.choice(RATE)),
        "noise": between(NOISE, by_order=True),
        "memory": between(MEMORY, by_order=True) if random.uniform() < 0.5 else 0.0,
        "zero_off_lead": ZERO * random.standard_normal(),
        "zero_side_lead": ZERO * random.standard_normal(),
    }
    if kind == "drag":
        load["drag"] = between(DRAG)
    if kind == "beats":
        load["sling"], load["masses"] = between(SLING), between(MASSES)
        load["hook_x"], load["hook_y"] = (HOOK_SPEED * random.standard_normal(2)).tolist()
        load["sling_nominal"] = load["sling"] * (1.0 + KNOWN_SLING * random.standard_normal())
        load["masses_nominal"] = load["masses"] * (1.0 + KNOWN_MASSES * random.standard_normal())
    if kind == "turning":
        load["turn"] = between(TURN) * float(random.choice([-1.0, 1.0]))
    if kind == "two planes":
        load["other"] = between(OTHER_DAMPING) ** float(random.choice([-1.0, 1.0]))
    return load


# --- equations of motion --------------------------------------------------------------------------


def angles(load: dict) -> tuple[np.ndarray, np.ndarray]:
    """Stamps [s], and off-lead and side-lead (2, n) of the rope without zero and noise. [rad]

    Bodies of positions p and velocities v move under their accelerations a less multipliers of the
    constraints |p_1| = L and |p_2 - p_1| = l, from the second derivatives of these.
    """
    rope, sling = load["rope"], load.get("sling", 0.0)
    masses = np.array([1.0, load["masses"]]) if sling else np.ones(1)
    bodies = masses.size
    omega = np.sqrt(GRAVITY / (rope + sling))
    amplitude = np.radians(load["amplitude"])
    period = 2.0 * np.pi / omega
    length = load["swings"] * period
    rates = 2.0 * omega * load["damping"] * np.array([1.0, load.get("other", 1.0), 1.0])
    # over a swing k |v| v takes what a linear resistance of 8 k v/(3 pi) at its largest speed does
    drag = load.get("drag", 0.0) * load["damping"] * 3.0 * np.pi / (4.0 * rope * amplitude)
    turn = np.radians(load.get("turn", 0.0)) / length

    def motion(_: float, state: np.ndarray) -> np.ndarray:
        p, v = state.reshape(2, bodies, 3)
        a = -rates * v - drag * np.linalg.norm(v, axis=1)[:, None] * v
        a[:, 2] -= GRAVITY
        a[:, 0] += 2.0 * turn * v[:, 1]
        a[:, 1] -= 2.0 * turn * v[:, 0]
        # rows of constraints: gradients by all positions, and what they do not take in
        gradients = np.zeros((bodies, bodies, 3))
        gradients[0, 0] = p[0]
        rest = np.zeros(bodies)
        rest[0] = v[0] @ v[0]
        if bodies == 2:
            line, speed = p[1] - p[0], v[1] - v[0]
            gradients[1, 0], gradients[1, 1] = -line, line
            rest[1] = speed @ speed
        flat = gradients.reshape(bodies, -1)
        weights = np.repeat(1.0 / masses, 3)
        multipliers = np.linalg.solve(flat * weights @ flat.T, flat @ a.ravel() + rest)
        a -= (weights * (flat.T @ multipliers)).reshape(bodies, 3)
        return np.concatenate([v.ravel(), a.ravel()])

    way = np.radians(load["direction"])
    along, across = (
        np.array([np.cos(way), np.sin(way), 0.0]),
        np.array([-np.sin(way), np.cos(way), 0.0]),
    )
    line = np.sin(amplitude) * along - np.array([0.0, 0.0, np.cos(amplitude)])
    sideways = load["ellipse"] * amplitude * omega * across
    p = np.array([rope * line, (rope + sling) * line])[:bodies]
    v = np.array([rope * sideways, (rope + sling) * sideways])[:bodies]
    if bodies == 2:
        # the hook's own speed lies in the sphere, and turns the slings
        own = np.array([load["hook_x"], load["hook_y"], 0.0])
        v[0] += own - (own @ line) * line
    time = np.arange(0.0, length, 1.0 / load["rate"])
    start = np.concatenate([p.ravel(), v.ravel()])
    states = solve_ivp(motion, (0.0, length), start, t_eval=time, rtol=1e-10, atol=1e-10).y
    x, y, z = states[:3]
    return time, np.array([np.arctan2(x, -z), np.arctan2(-y, -z)])


def slow_damping(load: dict) -> float:
    """Damping ratio of a load's slow mode in small swings.

    Both bodies lose speed at the rate 2 ζ √(g/(L + l)), so that a mode of frequency ω has the
    damping ratio ζ √(g/(L + l))/ω.
    """
    sling = load.get("sling", 0.0)
    if not sling:
        return load["damping"]
    # tensions (M + m) g and M g on two strings, with masses 1 of the hook and M of the load
    mass, whole = load["masses"], 1.0 + load["masses"]
    upper, lower = whole * GRAVITY / load["rope"], mass * GRAVITY / sling
    stiffness = np.array([[upper + lower, -lower], [-lower, lower]])
    square = np.linalg.eigvals(np.diag([1.0, 1.0 / mass]) @ stiffness).min()
    return load["damping"] * float(np.sqrt(GRAVITY / square / (load["rope"] + sling)))


def logged(load: dict) -> tuple[np.ndarray, np.ndarray]:
    """Stamps [s], and off-lead and side-lead (2, n) as a sensor has them. [deg]"""
    time, true = angles(load)
    random = np.random.default_rng([20261130, int(load["seed"]), 1])
    white = random.standard_normal((2, time.size))
    kept = np.exp(-1.0 / (load["rate"] * load["memory"])) if load["memory"] else 0.0
    noise = white.copy()
    for n in range(1, time.size):
        noise[:, n] = kept * noise[:, n - 1] + np.sqrt(1.0 - kept**2) * white[:, n]
    zeros = np.array([[load["zero_off_lead"]], [load["zero_side_lead"]]])
    return time, np.degrees(true) + zeros + load["noise"] * noise


# --- what an owner does ---------------------------------------------------------------------------

CAMPAIGN = """
[axes.load]
time = { column = "time", unit = "s" }
input = { kind = "none" }
channels.off_lead = { kind = "swing_angle", column = "off_lead", unit = "deg", noise = 0.1 }
channels.side_lead = { kind = "swing_angle", column = "side_lead", unit = "deg", noise = 0.1 }

[[runs]]
file = "swing.csv"
"""


def setup(load: dict, *, hook: bool) -> ModelSetup:
    """What an owner writes into the model file."""
    suspension = Suspension()
    mass = 20_000.0
    if hook:
        suspension = Suspension(hook=mass / load["masses_nominal"], sling=load["sling_nominal"])
    machine = body(
        Crane.preset("tg3637"), rope_m=load["rope_nominal"], load=mass, suspension=suspension
    )
    each_run = ("offset_x", "offset_y", "velocity_x", "velocity_y")
    free = {"swing_damping": (0.0, 0.05), "rope": (5.0, 50.0), "drag": (0.0, 0.001, 0.1)}
    free |= dict.fromkeys(each_run, (-20.0, 20.0))
    free |= dict.fromkeys(("offset off_lead", "offset side_lead"), (-0.2, 0.0, 0.2, "rad"))
    uncertain = {"sling": f"{100 * KNOWN_SLING:g} %", "ratio": f"{100 * KNOWN_MASSES:g} %"}
    return ModelSetup(
        machine,
        free,
        rate=256.0,
        each_run=each_run,
        inputs=dict.fromkeys(machine.ports.external, 0.0),
        standard_uncertainty=uncertain if hook else {},
    )


def fitted(file: Path, model: ModelSetup, truths: dict[str, list[float]]) -> dict:
    """Estimates of a fit with the truths that their intervals should hold, or its refusal."""
    try:
        result = identify(file, model)
        verdict = result.verdict
        rows = []
        for name, truth in truths.items():
            full = f"{'home' if name == 'rope' else 'hanging'}.{name}"
            estimate = result[full]
            lower, upper = estimate.interval
            row = {"name": name, "value": estimate.value, "lower": lower, "upper": upper}
            rows.append(row | {"truths": truth})
    except SwashplateError as error:
        return {"refused": str(error)}
    return {"usable": verdict.usable, "headline": verdict.headline, "estimates": rows}


def truths_of(load: dict) -> dict[str, list[float]]:
    """What intervals of the fit of a load on its rope should hold."""
    damping = slow_damping(load)
    truths = {"swing_damping": [damping, damping * load.get("other", 1.0)]}
    if "sling" not in load:
        truths["rope"] = [load["rope"]]
    return truths


def by_command(load: dict, time: np.ndarray, degrees: np.ndarray) -> dict:
    """What `crane damping` says of a log, or its refusal."""
    rope = load["rope_nominal"] + load.get("sling_nominal", 0.0)
    try:
        swing = swing_damping(time, *np.radians(degrees), rope=rope)
    except SwashplateError as error:
        return {"refused": str(error)}
    estimates = {"swing_damping": swing.damping, "rope": swing.rope}
    rows = []
    for name, truths in truths_of(load).items():
        estimate = estimates[name]
        lower, upper = estimate.interval
        row = {"name": name, "value": estimate.value, "lower": lower, "upper": upper}
        rows.append(row | {"truths": truths})
    return {"usable": True, "estimates": rows}


def judged(load: dict, folder: Path) -> dict:
    """A load's log, and what its fits say of it."""
    time, degrees = logged(load)
    rows = [f"{t:.4f},{a:.5f},{b:.5f}" for t, a, b in zip(time, *degrees, strict=True)]
    (folder / "swing.csv").write_text("\n".join(["time,off_lead,side_lead", *rows]), "utf-8")
    file = folder / "campaign.toml"
    file.write_text(CAMPAIGN, "utf-8")
    found, point = dict(load), truths_of(load)
    found["point"] = fitted(file, setup(load, hook=False), point)
    if "sling" in load:
        own = {"swing_damping": [load["damping"]], "rope": [load["rope"]]}
        found["hook"] = fitted(file, setup(load, hook=True), own)
    found["command"] = by_command(load, time, degrees)
    return found


# --- what is counted ------------------------------------------------------------------------------

FITS = {
    "point": "load on its rope",
    "hook": "load on slings",
    "command": "`crane damping`",
}
"""What a log was fitted with, by its entry in a record."""


WIDE = 0.1
"""Half width from which an interval is wide, over the value. [1]"""


def counted(records: list[dict], fit: str, name: str) -> str:
    """Cells of a table.

    Logs; intervals that hold, and how many of those are wide, which a verdict says not to quote;
    those that miss; those that are refused; median half width of those that hold.
    """
    held, wide, missed, refused, widths = 0, 0, 0, 0, []
    for record in records:
        found = record[fit]
        row = next((row for row in found.get("estimates", ()) if row["name"] == name), None)
        ends = (None, None) if row is None else (row["lower"], row["upper"])
        holds = None not in ends and all(ends[0] <= truth <= ends[1] for truth in row["truths"])
        if None in ends or not found["usable"]:
            refused += 1
        elif holds:
            held += 1
            wide += 0.5 * (ends[1] - ends[0]) > WIDE * row["value"]
            widths.append(50.0 * (ends[1] - ends[0]) / row["truths"][0])
        else:
            missed += 1
    width = f"{np.median(widths):.2g}" if widths else "-"
    return f"{len(records)} | {held} | {wide} | {missed} | {refused} | {width}"


def _is_asked(record: dict, fit: str, name: str) -> bool:
    """Whether a fit was made, and may be asked for a number."""
    if name == "rope":
        return fit in record and ("sling" not in record or fit == "hook")
    return fit in record


def report(records: list[dict]) -> None:
    """Print the table of the documentation."""
    print("| log | fit | of | logs | hold | of these wide | miss | refused | half width % |")
    print("|---|---|---|--:|--:|--:|--:|--:|--:|")
    for fit, words in FITS.items():
        for name in ("swing_damping", "rope"):
            having = [record for record in records if _is_asked(record, fit, name)]
            for kind in (*KINDS, "all"):
                alike = [record for record in having if kind in (record["kind"], "all")]
                if alike:
                    print(f"| {kind} | {words} | {name} | {counted(alike, fit, name)} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--report", type=Path)
    parser.add_argument("--seeds", type=int, nargs=2, default=(200, 239))
    options = parser.parse_args()
    if options.report:
        lines = options.report.read_text("utf-8").splitlines()
        report([json.loads(line) for line in lines])
        raise SystemExit
    for seed in range(options.seeds[0], options.seeds[1] + 1):
        load = drawn(seed)
        with tempfile.TemporaryDirectory() as folder:
            found = judged(load, Path(folder))
        with options.out.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(found) + "\n")
