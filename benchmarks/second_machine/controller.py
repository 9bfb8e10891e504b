"""Maneuvers, and the command as a controller holds it."""

from typing import NamedTuple

import numpy as np

from .draws import LEVELS

START = 1.0
"""Instant at which every maneuver of the tests begins. [s]"""
SETTLE = {"hoist": 2.5, "slew": 4.5, "luff": 2.5, "cylinder": 2.5}
"""Length of the cubic that brings a command to rest, by axis. [s]"""
SINE_LENGTHS = {0.05: 40.0, 0.1: 30.0, 0.3: 20.0, 0.5: 20.0}
"""Length of a sine's run by its frequency. [s by Hz]"""
LARGEST = 10.0
"""[V]"""
PARTS = 16
"""Stairs between two rows of a command that goes straight."""


class Held(NamedTuple):
    """A command that is constant between instants."""

    edges: np.ndarray
    """(m + 1,) instants. [s]"""
    volts: np.ndarray
    """(m,) command between them. [V]"""

    def at(self, time):
        """The command at instants. [V]"""
        index = np.searchsorted(self.edges, time, side="right") - 1
        return self.volts[np.clip(index, 0, self.volts.size - 1)]

    def delayed(self, delay, stop):
        """The same command, `delay` later and up to `stop`; 0 V before."""
        edges = np.concatenate([[0.0], self.edges[:-1] + delay])
        volts = np.concatenate([[0.0], self.volts])
        inside = edges < stop
        return Held(np.append(edges[inside], stop), volts[inside])


def settled(time, command, slope, length, settle):
    """A command and its slope at instants, brought to (0, 0) at `length` by a cubic Hermite."""
    begin = length - settle
    at = np.array([begin])
    value, rate = command(at)[0], slope(at)[0]
    s = np.clip((time - begin) / settle, 0.0, 1.0)
    cubic = value * (1.0 + 2.0 * s) * (1.0 - s) ** 2 + rate * settle * s * (1.0 - s) ** 2
    return np.where(time < begin, command(time), cubic)


def maneuver(name, axis):
    """Length [s] of a maneuver of the tests, and its command [V] as a function of instants [s].

    Parameters
    ----------
    name : str
        "ramp +1 V/s", "step -4 V" or "sine 4 V 0.1 Hz".
    axis : str
    """
    words = name.split()
    size = float(words[1])
    if words[0] == "step":
        return 10.0, lambda t: np.where((t >= START) & (t < 6.0), size, 0.0)
    if words[0] == "ramp":
        length = 13.0

        def command(t):
            return np.clip(size * np.maximum(t - START, 0.0), -LARGEST, LARGEST)

        def slope(t):
            return np.where(np.abs(t - START) * abs(size) < LARGEST, size, 0.0)
    else:
        frequency = float(words[3])
        length, w = SINE_LENGTHS[frequency], 2.0 * np.pi * frequency

        def command(t):
            return size * np.sin(w * np.maximum(t - START, 0.0))

        def slope(t):
            return size * w * np.cos(w * (t - START))

    return length, lambda t: settled(t, command, slope, length, SETTLE[axis])


def new_maneuver(name, axis):
    """Length and command of a maneuver for predictions."""
    entry = LEVELS["new"][name]
    factor = LEVELS["new"]["slew_factor"] if axis == "slew" and "step" not in name else 1.0
    if "levels" in entry:
        levels = factor * np.array([0.0, *entry["levels"], 0.0])
        edges = np.concatenate([[0.0], START + entry["dwell"] * np.arange(len(levels) - 1)])
        length = float(edges[-1]) + entry["dwell"]
        return length, lambda t: levels[np.searchsorted(edges, t, side="right") - 1]
    amplitude, length = factor * entry["amplitude"], entry["length"]
    # a sine is a chirp that stays where it begins
    first = entry.get("frequency", entry.get("from"))
    sweep = (entry.get("to", first) - first) / (length - START)

    def command(t):
        since = np.maximum(t - START, 0.0)
        return amplitude * np.sin(2.0 * np.pi * (first * since + 0.5 * sweep * since**2))

    return length, command


def held(command, length, controller):
    """A command as a controller computes, rounds and holds it, 0 V before its first task."""
    tasks = (controller.phase + np.arange(int(length * controller.rate) + 1)) / controller.rate
    tasks = tasks[tasks < length]
    step = 2.0 * LARGEST / 2**controller.bits
    volts = np.clip(np.round(command(tasks) / step) * step, -LARGEST, LARGEST)
    return Held(np.concatenate([[0.0], tasks, [length]]), np.concatenate([[0.0], volts]))


def held_exactly(command, length, rate):
    """A command held `rate` times a second from zero, not rounded."""
    edges = np.arange(round(length * rate) + 1) / rate
    return Held(edges, command(edges[:-1]))


def straight(time, volts):
    """A command that goes straight between its rows, as stairs that are `PARTS` times as fine."""
    edges = np.interp(np.arange((time.size - 1) * PARTS + 1) / PARTS, np.arange(time.size), time)
    return Held(edges, np.interp(0.5 * (edges[:-1] + edges[1:]), time, volts))
