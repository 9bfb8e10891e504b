"""Make golden.npz: everything, or only the cases whose names contain one of the words given.

    python tests/golden/make.py ["hoist: simulate, leaky" ...]

Inputs that the file holds stay as they are, to the last bit; only without a file are they made.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from cases import AXES, CASES, Case, Inputs
from numpy.typing import NDArray
from store import FILE, Golden, kept, machine

Array = NDArray[np.float64]

CURRENTS = {"hoist": 0.78, "slew": 0.54, "luff": 0.54}
"""Largest current of each axis. [A]"""
COARSE = 2.0**-20
"""What most inputs are multiples of, so that they take less room; the main one is not."""


def shape(t: Array, noise: Array) -> Array:
    """A demanding command of six seconds, ±1: steps both ways, ramps, a sine, dither, rests."""
    corners = [
        *((0.0, 0.0), (0.1, 0.0), (0.1001, 0.97), (1.4, 0.97), (1.6, 0.03), (1.7, 0.3)),
        *((2.1, 0.3), (2.1001, -0.98), (3.7, -0.98), (3.7001, 0.0), (4.1, 0.0), (4.5, -0.06)),
        *((4.9, 0.1), (4.9001, 0.26), (5.1, 0.26), (5.1001, -0.25), (5.3, -0.25), (5.3001, 0.4)),
        *((5.5, 0.4), (5.5001, 0.0), (9.0, 0.0)),
    ]
    x, y = np.array(corners).T
    command = np.interp(t, x, y)
    sine = 0.2 * np.sin(2.0 * np.pi * 5.0 * (t - 1.7)) * ((t > 1.7) & (t < 2.1))
    busy = np.where(command != 0.0, 1.0, 0.0)
    dither = busy * (0.004 * np.sin(2.0 * np.pi * 47.0 * t) + 0.002 * noise)
    return np.asarray(np.clip(command + sine + dither, -1.0, 1.0))


def make_inputs() -> dict[str, Array]:
    """Records, stamps, noise and weights."""
    random = np.random.default_rng(20010)

    def record(seconds: float, rate: float) -> Array:
        t = np.arange(round(seconds * rate) + 1) / rate
        return shape(t, random.standard_normal(t.size))

    def coarse(values: Array) -> Array:
        return np.round(values / COARSE) * COARSE

    stamps = np.cumsum(random.uniform(0.0005, 0.012, 560)) + 0.25
    stamps[100:] += 0.15
    stamped = coarse(shape(1.5 * (stamps - 0.2), random.standard_normal(stamps.size)))
    t = np.arange(1400) / 512.0
    away = np.interp(t, [0.0, 0.1, 0.9, 1.0, 1.8, 1.9, 2.5], [0.0, 0.0, 1.0, -2.2, -2.1, 0.0, 0.3])
    away += np.where(t > 0.0, 0.01 * random.standard_normal(t.size), 0.0)
    observed = np.sort(random.uniform(-0.05, 6.1, 900))
    weight = random.uniform(0.3, 1.5, 1300) * (random.uniform(size=1300) > 0.1)
    inputs = {
        "voltage": 10.0 * record(6.0, 512.0),
        "slow voltage": coarse(10.0 * record(5.8, 200.0)),
        "fast voltage": coarse(10.0 * record(2.6, 1000.0)),
        "full voltage": coarse(10.0 * shape(np.arange(750) / 512.0 * 3.0, np.zeros(750))),
        "stamps": coarse(stamps),
        "stamped voltage": 10.0 * stamped,
        "from 4 V": coarse(4.0 + 4.0 * away),
        "from -6 V": coarse(-6.0 - 3.0 * away[::2]),
        "beyond 10 V": coarse(11.5 * record(2.0, 512.0)[::2]),
        "observed": coarse(observed),
        "noise": coarse(random.standard_normal(1300)),
        "weight": coarse(weight),
        "offsets": np.array([0.01, 0.002, 0.0, 0.0, 0.0, 0.0, 0.001, 0.0, 0.0]),
        "clock offsets": np.array([0.0017, 0.0, -0.0021, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        "steady volts": np.array(
            [*(-10.0, -9.99, -7.3, -4.0, -2.0, -1.0, -0.3, -0.097857, -0.088321, -0.05, -0.0),
             *(0.0, 0.05, 0.090948, 0.12663, 0.1266300001, 0.2, 0.5, 1.0, 2.5, 4.0, 6.5, 9.0, 10.0)]
        ),
        "frequencies": np.array([0.0, 0.05, 0.3, 1.0, 2.7, 8.0, 21.0]),
    }  # fmt: skip
    for axis in AXES:
        largest = CURRENTS[axis]
        inputs[f"current of {axis}"] = coarse(largest * record(6.0, 512.0))
        inputs[f"stamped current of {axis}"] = coarse(largest * stamped)
        inputs[f"current from 0.4 A of {axis}"] = coarse(0.4 + 0.35 * away)
    return inputs


def stored(case: Case, inputs: Inputs) -> dict[str, dict]:
    """All arrays of a case as the file keeps them."""
    outputs = case.compute(inputs)
    return {name: kept(each, case.kind, case.count(name)) for name, each in outputs.items()}


def main(words: list[str]) -> None:
    """Make the cases that are asked for, and write the file."""
    golden = Golden.read() if FILE.exists() else Golden(make_inputs())
    if not words:
        golden.cases = {}
    golden.made_on = machine()
    for name, case in CASES.items():
        if name in golden.cases and not any(word in name for word in words):
            continue
        begun = time.perf_counter()
        golden.cases[name] = stored(case, golden.inputs)
        print(f"{time.perf_counter() - begun:7.2f} s  {name}", flush=True)
    golden.cases = {name: golden.cases[name] for name in CASES}
    golden.write()
    print(f"{len(golden.cases)} cases, {FILE.stat().st_size / 1e6:.3f} MB")


if __name__ == "__main__":
    main(sys.argv[1:])
