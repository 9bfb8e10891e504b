"""The crane beside an independent one, and extremes beside known ones, as docs/crane-checks.md has.

python benchmarks/crane_tables.py

The other crane is a prototype that shares no code with this one; its numbers are copied here.
"""

from collections.abc import Iterator
from math import pi

import numpy as np
from numpy.typing import NDArray

from swashplate.crane import Crane, OperatorCommand, control, simulate
from swashplate.crane.closed_loop.stepper import Actuation
from swashplate.crane.control import Control
from swashplate.crane.sea import extremes
from swashplate.crane.sea.extremes import (
    THREE_HOURS,
    largest_of_gaussian,
    largest_of_peaks,
    peaks_of,
)

Array = NDArray[np.float64]

# --- residual swing -------------------------------------------------------------------------------

SLEWS = {  # residual swing [deg]: ideal drives, volts, inverse maps
    0.1: (0.831, 2.17, 0.842),
    0.2: (1.258, 4.44, 1.243),
    0.5: (7.03, 10.23, 6.95),
    0.8: (12.51, 14.89, 12.38),
    1.0: (7.88, 8.95, 7.75),
}
PATHS = {  # ideal tip ZV, drives tip ZV and ZVD with a position loop of 1 /s [deg]
    0.2: (0.0001, 0.051, 0.070),
    0.5: (0.0031, 0.169, 0.087),
    0.8: (0.0171, 0.097, 0.182),
    1.0: (0.0327, 1.144, 0.368),
}
TIP = control.TipShaper("zv")
PLAIN: tuple[tuple[Actuation, Control | None], ...] = (
    ("ideal", None),
    ("volts", None),
    ("inverse", None),
)
TIPS: tuple[tuple[Actuation, Control | None], ...] = (
    ("ideal", TIP),
    ("inverse", TIP | control.PositionLoop(1.0)),
    ("inverse", control.TipShaper("zvd") | control.PositionLoop(1.0)),
)
UNDAMPED = 0.0
"""Damping ratio of the other crane's load."""


def slew_tables(crane: Crane) -> Iterator[str]:
    """Residual swing after a slew of 45 degrees, this crane's and the other's."""
    for title, heads, variants, others in (
        ("Slew of 45 deg, rope 20 m, boom 45 deg [deg]", "ideal | volts | inverse", PLAIN, SLEWS),
        (
            "The same slew, path of the tip shaped [deg]",
            "ideal, tip ZV | drives, tip ZV | drives, tip ZVD",
            TIPS,
            PATHS,
        ),
    ):
        yield f"\n### {title}\n\n| stick | {heads} |\n|--:|{'--:|' * len(variants)}"
        for part, numbers in others.items():
            command = OperatorCommand.trapezoid(slew=part, until={"slew_deg": 45.0}, length=160.0)
            cells = []
            for (actuation, law), other in zip(variants, numbers, strict=True):
                run = simulate(
                    crane, command, control=law, actuation=actuation, swing_damping=UNDAMPED
                )
                cells.append(f"{run.residual_deg:.3g} / {other:g}")
            yield f"| {part:g} | {' | '.join(cells)} |"


# --- extremes -------------------------------------------------------------------------------------

RATE, FREQUENCY = 8.0, 0.6
"""Samples a second [Hz], and natural frequency of what is driven by white noise [rad/s]."""
RUNS, RUN = 80, 600.0
"""Runs of an assessment, and the time for which each counts. [s]"""
SETS = 20
PARTS = (0.499, 0.1)
"""Parts of the peaks that the tail is fitted to; a whole half would have too few below it."""


def extreme_table() -> Iterator[str]:
    """Most probable largest value in three hours from peaks, over that of the Gaussian process."""
    yield "\n### Largest value in 3 h from peaks, over the known one"
    yield f"\n{SETS} sets of {RUNS} runs of {RUN:g} s.\n"
    heads = [f"upper {part:.0%}, mean | spread | intervals that hold it" for part in PARTS]
    yield f"| damping ratio | components | {' | '.join(heads)} |"
    yield "|--:|--:|" + "--:|--:|--:|" * len(PARTS)
    random = np.random.default_rng(1)
    for damping in (0.005, 0.05, 0.2):
        for components in (1, 2):
            signal = gaussian(60.0 * THREE_HOURS, damping, components, random)
            known = extreme_of(signal)
            size = np.sqrt((signal**2).sum(axis=0))
            sets = [sampled(size, random) for _ in range(SETS)]
            cells = [cell for part in PARTS for cell in part_cells(sets, part, known)]
            yield f"| {damping:g} | {components} | {' | '.join(cells)} |"


def gaussian(
    duration: float, damping: float, components: int, random: np.random.Generator
) -> Array:
    """(components, n) of an oscillator with a damping ratio under white noise."""
    count = round(RATE * duration)
    omega = 2.0 * pi * np.fft.rfftfreq(count, 1.0 / RATE)
    response = np.abs(1.0 / (FREQUENCY**2 - omega**2 + 2j * damping * FREQUENCY * omega))
    response[(omega < 0.2) | (omega > 3.0)] = 0.0
    drawn = random.standard_normal((2, components, omega.size))
    return np.fft.irfft(response * (drawn[0] + 1j * drawn[1]), count, axis=1)


def extreme_of(signal: Array) -> float:
    """Most probable largest magnitude in three hours, by Rice's crossings."""
    rates = (RATE * np.gradient(signal, axis=1)).var(axis=1)
    return float(largest_of_gaussian(signal.var(axis=1)[None], rates[None])[0])


def sampled(size: Array, random: np.random.Generator) -> list[Array]:
    """Peaks of the runs of a set, each from somewhere in the long signal."""
    samples = round(RATE * RUN)
    starts = random.integers(0, size.size - samples, RUNS)
    return [peaks_of(size[start : start + samples]) for start in starts]


def part_cells(sets: list[list[Array]], part: float, known: float) -> Iterator[str]:
    """Mean and spread of what the sets give, and the share of intervals that hold the extreme."""
    usual, extremes.UPPER = extremes.UPPER, part
    try:
        found = [largest_of_peaks(peaks, RUNS * RUN) for peaks in sets]
    finally:
        extremes.UPPER = usual
    values = np.array([estimate.value for estimate in found]) / known
    held = np.sum([estimate.low <= known <= estimate.high for estimate in found])
    yield f"{values.mean():.3f}"
    yield f"{values.std(ddof=1):.3f}"
    yield f"{held:.0f} of {len(sets)}"


def main() -> None:
    """Compute and print all tables."""
    for line in (*slew_tables(Crane.preset("tg3637")), *extreme_table()):
        print(line, flush=True)


if __name__ == "__main__":
    main()
