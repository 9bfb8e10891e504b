"""The march against SciPy's solvers, on five runs.

    .venv/bin/python -m second_machine.checks        # in benchmarks/; about a minute

The reference shares no code with `equations` but the containers of numbers: filter and pump go
through `solve_ivp` at tight tolerances, the limiter compares samples 4 us apart, and the spool's
balance is in the form without inverse functions. Z2, Z7 and Z11 are 0, Z15 is not reached.
"""

import argparse
import time
from math import atan, pi, sin, sqrt, tan

import numpy as np
from scipy.integrate import solve_ivp

from . import controller, draws
from .equations import march_cylinder, march_drive

FINE = 4e-6
"""Distance of the reference's samples of the limiter. [s]"""
RUNS = (
    ("hoist", 1000, "step +9 V"),
    ("hoist", 1001, "ramp -1 V/s"),
    ("slew", 1002, "step +2 V"),
    ("luff", 1003, "step +9 V"),
    ("cylinder", 1004, "step -4 V"),
)
"""Axis, seed and maneuver."""
TOLERANCES = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12}


def reference_filter(start, stop, state, target, c, instants):
    """I* (n,) at instants of a time in which I_ss is constant, and I* and its rate at the end."""
    level, rate = state
    values = np.full(instants.size, level)
    while start < stop:
        pull = c.omega**2 * (target - level)
        if rate == 0.0 and abs(pull) <= c.C:
            values[instants >= start] = level
            break
        sign = np.sign(rate) if rate != 0.0 else np.sign(pull)

        def rates(_, y, sign=sign):
            force = c.omega**2 * (target - y[0]) - 2.0 * c.zeta * c.omega * y[1]
            return y[1], force - c.C * sign

        def turning(t, y, start=start, sign=sign):
            return y[1] if t > start else sign  # a rate that begins at zero does not end there

        turning.terminal, turning.direction = True, -sign
        events = turning if c.C else None
        solved = solve_ivp(
            rates, (start, stop), (level, rate), dense_output=True, events=events, **TOLERANCES
        )
        inside = (instants >= start) & (instants <= solved.t[-1])
        if inside.any():
            values[inside] = solved.sol(instants[inside])[0]
        start = solved.t[-1]
        level, rate = solved.y[:, -1]
        if solved.status == 1:
            rate = 0.0
    return values, (level, rate)


def reference_channel(edges, volts, c, grid):
    """Output of a channel (n,) on a fine grid. [A]"""
    filtered = np.empty_like(grid)
    state = (0.0, 0.0)
    for start, stop, volt in zip(edges[:-1], edges[1:], volts, strict=True):
        over = volt - c.V_dz
        target = c.J + c.G1 * over + c.G2 * over**2 + c.G3 * over**3 if over > 0.0 else 0.0
        first, last = np.searchsorted(grid, (start, stop), side="left")
        if stop == edges[-1]:
            last = grid.size
        part = slice(first, last)
        filtered[part], state = reference_filter(start, stop, state, target, c, grid[part])
    output, before, decay = np.empty_like(grid), 0.0, np.exp(-c.a * FINE)
    for n, level in enumerate(filtered.tolist()):
        if level >= before:
            if level > c.I_t1:
                level = min(level, max(before, c.I_t1) + c.lim1 * FINE)
        elif before > c.I_t2:
            level = max(level, before - c.lim2 * FINE)
        else:
            level = max(level, before * decay)
        output[n] = before = level
    return output


def reference_pump(current, p, run, grid, instants):
    """Pressure, motor's angle, drum's angle and speed (4, n) at instants."""
    play, moved = 0.0, np.empty_like(current)
    half = 0.5 * run.hysteresis
    for n, value in enumerate(current.tolist()):
        if play < value - half:
            play = value - half
        elif play > value + half:
            play = value + half
        moved[n] = play
    low, high = -tan(p.Z13_m) / p.Z1, tan(p.Z13_p) / p.Z1
    w = 2.0 * pi * run.shaft_frequency

    def rates(t, y):
        pressure = min(max(y[0], low), high)
        place = t / FINE
        n = min(int(place), moved.size - 2)
        i = moved[n] + (place - n) * (moved[n + 1] - moved[n])
        e = max(abs(i) - p.Z17, 0.0)
        if i >= 0.0:
            force = p.Z19_p * e + p.Z20_p * e**2 + p.Z21_p * e**3 + p.Z22_p * e**4
        else:
            force = -p.Z19_m * e + p.Z20_m * e**2 - p.Z21_m * e**3 + p.Z22_m * e**4
        a, s = p.Z5 * force / sqrt(p.Z4), p.Z3 * p.Z1 * pressure
        ca, cs = sqrt(1.0 - a * a), sqrt(1.0 - s * s)
        x = p.Z5 * (a * cs - s * ca) / (ca * cs + a * s) + p.Z18
        x = min(max(x, -p.Z16_m), p.Z16_p)
        widest = p.Z16_p if x >= 0.0 else p.Z16_m
        supply = 1.0 + run.level
        supply += run.ripple * sin(2 * pi * run.ripple_frequency * t + run.ripple_phase)
        supply += run.hunting * sin(2 * pi * run.hunting_frequency * t + run.hunting_phase)
        supply *= 1.0 - run.droop * abs(x) / widest
        flow = p.Z8 * run.orifice * x * sqrt((p.Z9 * supply - pressure) / 2.0) / (1.0 + p.Z6)
        if (pressure >= high and flow > 0.0) or (pressure <= low and flow < 0.0):
            flow = 0.0
        speed = p.Z10 * run.speed * atan(p.Z1 * pressure)
        torque = w * w * (y[1] - y[2]) + 2.0 * run.shaft_damping * w * (speed - y[3])
        return flow, speed, y[3], torque

    tolerances = {"method": "RK45", "rtol": 1e-8, "atol": [1e-1, 1e-9, 1e-9, 1e-8]}
    span = (0.0, float(grid[-1]))
    return solve_ivp(rates, span, [0.0] * 4, t_eval=instants, max_step=1e-3, **tolerances).y


def reference_cylinder(edges, volts, c, instants):
    """Position and speed (2, n) of the cylinder's rod at instants."""
    state, parts = np.zeros(4), []
    for start, stop, volt in zip(edges[:-1], edges[1:], volts, strict=True):

        def rates(_, y, volt=volt):
            over = max(abs(y[0]) - (c.d_plus if y[0] > 0.0 else c.d_minus), 0.0)
            flow = c.K_plus * over if y[0] > 0.0 else -c.K_minus * over
            force = c.omega**2 * (flow - y[2]) - 2.0 * c.zeta * c.omega * y[3]
            return (volt - y[0]) / c.lag, y[2], y[3], force

        solved = solve_ivp(rates, (start, stop), state, dense_output=True, **TOLERANCES)
        inside = (instants >= start) & (instants < stop)
        parts.append(solved.sol(instants[inside])[1:3])
        state = solved.y[:, -1]
    return np.hstack(parts)


def merged(command):
    """A held command without edges at which it stays the same."""
    changes = np.append(True, np.diff(command.volts) != 0.0)
    edges = np.append(command.edges[:-1][changes], command.edges[-1])
    return edges, command.volts[changes]


def differences(axis, seed, run):
    """Largest differences of a run by signal, as shares of the signal's range."""
    length, wish = controller.maneuver(run, axis)
    command = controller.held(wish, length, draws.drawn_controller(axis, seed, run))
    if axis == "cylinder":
        cylinder = draws.drawn_cylinder(seed)
        rows = march_cylinder(command.edges, command.volts, cylinder, 1.0)[:-1:16]
        exact = reference_cylinder(*merged(command), cylinder, rows[:, 0])
        pairs = {"position": (rows[:, 2], exact[0]), "speed": (rows[:, 3], exact[1])}
    else:
        numbers = draws.drawn_parameters(axis, seed)
        late = command.delayed(numbers["tau"], length)
        plus, minus = draws.channel(numbers, "plus"), draws.channel(numbers, "minus")
        pump, condition = draws.pump(numbers), draws.drawn_conditions(axis, seed)[0]
        rows = march_drive(late.edges, late.volts, plus, minus, pump, condition)[:-1:16]
        grid = np.arange(int(length / FINE) + 1) * FINE
        edges, volts = merged(late)
        outputs = [reference_channel(edges, sign * volts, c, grid)
                   for sign, c in ((1.0, plus), (-1.0, minus))]  # fmt: skip
        current = outputs[0] - outputs[1]
        exact = reference_pump(current, pump, condition, grid, rows[:, 0])
        pairs = {
            "current": (rows[:, 1] - rows[:, 2], np.interp(rows[:, 0], grid, current)),
            "pressure": (rows[:, 3], exact[0]),
            "angle": (rows[:, 4], exact[2]),
            "speed": (rows[:, 5], exact[3]),
        }
    return {
        name: float(np.abs(march - solved).max() / np.ptp(solved))
        for name, (march, solved) in pairs.items()
    }


def main():
    """Print the differences of every run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.parse_args()
    print("| run | largest difference, % of range | CPU s |\n|---|---|--:|")
    for axis, seed, run in RUNS:
        begun = time.process_time()
        shares = differences(axis, seed, run)
        text = ", ".join(f"{name} {100.0 * share:.1e}" for name, share in shares.items())
        print(f"| {axis} {seed}, {run} | {text} | {time.process_time() - begun:.0f} |", flush=True)


if __name__ == "__main__":
    main()
