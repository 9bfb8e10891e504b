"""How well each method finds a known speed behind encoder counts, and how long it takes.

python benchmarks/speed_from_counts.py [--write]
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from swashplate.campaign import (
    interpolate_counts,
    matched_speed,
    path_delay,
    radians_per_count,
    savitzky_golay_speed,
    speed_from_counts,
    unwrap_counts,
)

PAGE = Path(__file__).parent.parent / "docs" / "speed-from-counts.md"
RATE = 512
PERIOD = 1.0 / RATE
TURN = 2526.3
"""Counts a turn of the hoist winch."""
TIME = np.arange(10 * RATE + 1) * PERIOD
BEGIN = 1.0
"""Every motion begins from rest at this instant. [s]"""
SPEEDS_DEG_S = (0.1, 1.0, 10.0, 100.0)
STARTS = 10
"""Every motion is counted from so many positions between two counts."""

Array = np.ndarray


class Motion(NamedTuple):
    """Speed and position at any instants, for a speed of 1, and where errors are looked at."""

    speed: Callable[[Array], Array]
    position: Callable[[Array], Array]
    window: tuple[float, float]


def _since(time: Array) -> Array:
    return np.maximum(time - BEGIN, 0.0)


OMEGA = 2.0 * np.pi * 0.3
MOTIONS = {
    "step, once settled": Motion(lambda t: 1.0 * (t > BEGIN), _since, (2.0, 9.0)),
    "step, 0.5 s around it": Motion(lambda t: 1.0 * (t > BEGIN), _since, (0.75, 1.25)),
    "ramp of 8 s": Motion(
        lambda t: np.minimum(_since(t) / 8.0, 1.0),
        lambda t: np.where(t < 9.0, _since(t) ** 2 / 16.0, 4.0 + t - 9.0),
        (1.5, 8.5),
    ),
    "sine of 0.3 Hz": Motion(
        lambda t: np.sin(OMEGA * _since(t)),
        lambda t: (1.0 - np.cos(OMEGA * _since(t))) / OMEGA,
        (2.0, 9.0),
    ),
}


def differences(counts: Array) -> Array:
    """Change of the angle over the sample before each instant [rad/s]."""
    return np.diff(radians_per_count(TURN) * counts, prepend=0.0) / PERIOD


def source(counts: Array) -> Array:
    """Kruse's path [rad/s]."""
    return speed_from_counts(TIME, counts, counts_per_turn=TURN)


def savitzky_golay(counts: Array) -> Array:
    """Parabolas through 0.1 s of interpolated counts [rad/s]."""
    angle = radians_per_count(TURN) * interpolate_counts(TIME, counts)
    return savitzky_golay_speed(TIME, angle)


class Method(NamedTuple):
    """A way to the speed and the delay it is known to have [s]."""

    speed: Callable[[Array], Array]
    delay: float


METHODS = {
    "differences": Method(differences, 0.5 * PERIOD),
    "source": Method(source, path_delay(PERIOD)),
    "Savitzky-Golay": Method(savitzky_golay, 0.0),
}
MATCHED = "source, to its match"


class Errors(NamedTuple):
    """Speed found less the true one over a motion's window [deg/s]."""

    bias: float
    """Mean."""
    noise: float
    """Standard deviation."""

    @property
    def rms(self) -> float:
        """Both together."""
        return float(np.hypot(self.bias, self.noise))


def errors(motion: str, method: str, speed_deg_s: float, *, aligned: bool = True) -> Errors:
    """Errors of a method, over all starts; aligned, the truth is delayed as the method is."""
    true, way = MOTIONS[motion], METHODS["source" if method == MATCHED else method]
    inside = (true.window[0] <= TIME) & (true.window[1] >= TIME)
    if method == MATCHED:
        expected = matched_speed(TIME, true.speed(TIME))
    else:
        expected = true.speed(TIME - way.delay if aligned else TIME)
    found = []
    for start in np.random.default_rng(0).uniform(0.0, 1.0, STARTS):
        counts = np.floor(start + speed_deg_s * TURN / 360.0 * true.position(TIME))
        found.append(np.rad2deg(way.speed(counts)) - speed_deg_s * expected)
    wrong = np.array(found)[:, inside]
    return Errors(float(wrong.mean()), float(wrong.std()))


def rise_time(method: str) -> float:
    """Time from 10 to 90 % of a step of 100 deg/s, whose own is none [s]."""
    counts = np.floor(0.5 + 100.0 * TURN / 360.0 * MOTIONS["step, once settled"].position(TIME))
    found = np.rad2deg(METHODS[method].speed(counts)) / 100.0
    # the last crossing of 10 %, then the first of 90 % after it
    high = int(np.argmax(found > 0.9))
    low = int(np.flatnonzero(found[:high] <= 0.1)[-1]) if np.any(found[:high] <= 0.1) else 0
    first, last = (
        k + (level - found[k]) / (found[k + 1] - found[k])
        for k, level in ((low, 0.1), (high - 1, 0.9))
    )
    return float(last - first) * PERIOD


def _cells(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def error_table() -> list[str]:
    """Noise and bias, a line for each motion and method."""
    lines = [
        _cells("motion", "method", *(f"{each:g} deg/s" for each in SPEEDS_DEG_S)),
        "|---|---|" + "--:|" * len(SPEEDS_DEG_S),
    ]
    for motion in MOTIONS:
        for method in (*METHODS, MATCHED):
            found = [errors(motion, method, each) for each in SPEEDS_DEG_S]
            lines.append(
                _cells(motion, method, *(f"{each.noise:.2g} ({each.bias:+.1g})" for each in found))
            )
    return lines


def delay_table() -> list[str]:
    """Delay, what it costs, and how sharp a step can be."""
    lines = [
        _cells(
            "method",
            "delay",
            "sine, RMS error as it is",
            "RMS error aligned",
            "rise of a sharp step",
        ),
        "|---|--:|--:|--:|--:|",
    ]
    for name, method in METHODS.items():
        raw, aligned = (
            errors("sine of 0.3 Hz", name, 100.0, aligned=each).rms for each in (False, True)
        )
        rise = "" if name == "differences" else f"{1e3 * rise_time(name):.0f} ms"
        lines.append(
            _cells(
                name,
                f"{1e3 * method.delay:.2f} ms",
                f"{raw:.2g} deg/s",
                f"{aligned:.2g} deg/s",
                rise,
            )
        )
    return lines


def time_table() -> list[str]:
    """How long the work takes."""
    import table
    import timing

    def hour() -> None:
        speed_from_counts(long_time, unwrap_counts(readings, 2**16).counts, counts_per_turn=TURN)

    long_time = np.arange(3600 * RATE + 1) * PERIOD
    readings = np.floor(20000.0 * np.sin(0.1 * long_time)) % 2**16
    runs = {
        "one hour at 512 Hz: roll-overs, interpolation, source's filters": hour,
    }
    lines = [f"Measured on: {table.machine()}.", "", "| what | median |", "|---|--:|"]
    for what, run in runs.items():
        run()
        lines.append(_cells(what, table.duration(timing.alone(run, 7))))
    return lines


def write(name: str, lines: list[str]) -> None:
    """Put a table between the page's markers of its name."""
    page = PAGE.read_text("utf-8")
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    before, rest = page.split(begin)
    _, after = rest.split(end)
    PAGE.write_text(before + begin + "\n" + "\n".join(lines) + "\n" + end + after, "utf-8")


def main() -> None:
    """Measure, print, and on request put the tables into docs/speed-from-counts.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help=f"update {PAGE.name}")
    arguments = parser.parse_args()
    tables = {"errors": error_table(), "delays": delay_table(), "times": time_table()}
    for name, lines in tables.items():
        print(*lines, "", sep="\n")
        if arguments.write:
            write(name, lines)


if __name__ == "__main__":
    main()
