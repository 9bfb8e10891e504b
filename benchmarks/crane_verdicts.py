"""How far the answers on the packaged crane depend on what they should not depend on.

    .venv/bin/python benchmarks/crane_verdicts.py stability [--sets 10] [--hours 3]
    .venv/bin/python benchmarks/crane_verdicts.py borders [--cells 10]
    .venv/bin/python benchmarks/crane_verdicts.py spectrum
    .venv/bin/python benchmarks/crane_verdicts.py controllers [--seaways 80]
    .venv/bin/python benchmarks/crane_verdicts.py crews [--seaways 80]

stability: the verdicts of sets of other seaways, which count for 10 min, 20 min and hours.
borders: cells of the made-up year near a limit, drawn at random, against the verdict in other
seaways.
spectrum: swing without control by simulation over that by its spectrum, for ships, headings and
damping ratios; small waves, so that the crane is linear.
controllers: those that the package has, on the packaged crane's own drives in sea state 3 abeam.
crews: operators who damp by hand, there and in a calm sea of the load's own period.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np

from swashplate.cli.crane_options import control_of
from swashplate.crane import (
    Assessment,
    Crane,
    Hull,
    Scatter,
    Seaway,
    Spectrum,
    Study,
    assess,
    control,
    linear_response,
    operability,
    read_ship,
)
from swashplate.crane.sea import rms_of

IDEAL_DESIGN = (
    control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation() | control.PositionLoop(1.5)
)
CLIPPED = control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation() | control.Clip()
S175 = Path(__file__).parents[2] / "shared" / "data" / "s175" / "input.re1"


def stability(sets: int, hours: float) -> None:
    """Print the verdicts of other seaways and other lengths."""
    lengths = ((600.0, 160), (1200.0, 120), (3600.0 * hours, 72))
    controllers = {"for ideal drives": IDEAL_DESIGN, "clipped": CLIPPED}
    print("control, time that counts, seaways, harmless, sufficient, half widths of the RMS")
    for length, seaways in lengths:
        for first in range(sets):
            seeds = range(1000 * first, 1000 * first + seaways)
            for name, assessed in zip(
                controllers, verdicts(controllers, seeds, length), strict=True
            ):
                widths = ", ".join(
                    f"{half_width(assessed.swing(case)):.1%}" for case in assessed.names
                )
                answers = f"{assessed.harmless}, {assessed.sufficient}"
                print(f"{name}, {length:g} s, {seaways}, {answers}, {widths}", flush=True)


def verdicts(
    controllers: dict[str, control.Control], seeds: range, length: float
) -> list[Assessment]:
    """The verdict on each controller with the packaged crane's own drives; what is without control
    is simulated once.
    """
    crane = Crane.preset("tg3637")
    study = Study.of(crane, controllers, seeds=seeds, drives=("identified",), length=length)
    names = list(study.cases)
    outcomes = study.outcomes(list(study.cases.values()))
    assessments = []
    for index, name in enumerate(names[1:], start=1):
        cases = {names[0]: study.cases[names[0]], name: study.cases[name]}
        pairs = tuple((of_seed[0], of_seed[index]) for of_seed in outcomes)
        assessments.append(
            Assessment(replace(study, cases=cases), pairs, 0.05, ("harm", "sufficiency"), None)
        )
    return assessments


def half_width(swing: np.ndarray) -> float:
    """Half of the 95 % interval of a root mean square, over it."""
    known = swing[np.isfinite(swing)]
    if known.size < 2:
        return float("nan")
    squares = known**2
    return 0.99 * float(squares.std(ddof=1)) / sqrt(known.size) / float(squares.mean())


def borders(count: int) -> None:
    """Print simulated cells between 0.7 and 1.3 of a limit, and the verdict by other seaways."""
    crane, scatter = Crane.preset("tg3637"), Scatter.packaged()
    begin = time.perf_counter()
    year = operability(crane, CLIPPED, scatter)
    undecided = ", ".join(f"{name} {year.undecided(name):.1%}" for name in year.names)
    print(f"Year in {time.perf_counter() - begin:.0f} s; undecided: {undecided}")
    near = [
        (name, key)
        for name in ("identified", "ideal")
        for key, cell in year.cells[name].items()
        if cell.simulated and 0.7 <= cell.ratio <= 1.3
    ]
    print(f"{len(near)} cells between 0.7 and 1.3 of a limit")
    for index in np.random.default_rng(0).permutation(len(near))[:count]:
        name, (row, heading) = near[index]
        cell = year.cells[name][row, heading]
        height, period = float(scatter.height[row]), float(scatter.period[row])
        assessed = assess(
            crane,
            CLIPPED,
            seeds=range(1000, 1120),
            sea=Seaway(Spectrum(height, period), heading_deg=heading),
            drives=(name,),
            remedies=False,
            tipping_points=False,
        )
        print(
            f"| {name} | {height:g} m, {period:g} s, {heading:g}° | {cell.ratio:.2f} | "
            f"{cell.limited_by or 'workable'} | {assessed.sufficient} | {assessed.harmless} |",
            flush=True,
        )


def spectrum() -> None:
    """Print simulated swing over that of the spectrum."""
    crane = Crane.preset("tg3637")
    ships = {"hull, roll 13 s": Hull(203.8, 23.2, 9.75)}
    if S175.exists():
        ships["S175"] = read_ship(S175)
    for name, ship in ships.items():
        for heading in (60.0, 90.0, 135.0):
            row = []
            for damping in (0.002, 0.005, 0.01, 0.02, 0.05):
                sea = Seaway(Spectrum(0.2, 8.0), heading_deg=heading, ship=ship)
                study = Study.of(
                    crane, CLIPPED, sea=sea, seeds=range(48), swing_damping=damping, run_in=0.0
                )
                found = study.outcomes([study.cases["no control"]])
                squares = np.array([outcome.rms_swing for (outcome,) in found]) ** 2
                expected = linear_response(crane, sea, swing_damping=damping).values["swing"].rms
                half = 2.01 * squares.std(ddof=1) / sqrt(squares.size) / squares.mean() / 2.0
                ratio = sqrt(squares.mean()) / expected
                row.append(f"{ratio:.3f} ± {half:.3f}")
            print(f"{name:16s} {heading:4.0f}°  " + "  ".join(row), flush=True)


CONTROLLERS = (
    "feedback=0.2/0.2+loop=1.5",
    "feedback=0.2/0.2+ship+loop=1.5",
    "ship+clip",
    "feedback=0.2/0.2+clip",
    "feedback=0.2/0.2+ship+clip",
    "feedback=0.2/0.2+ship+clip+sensors=0.1/0.05/50",
    "feedback=0.2/0.2+ship+clip+sensors=0.5/0.2/10",
    "feedback=0.2/0.2+ship+clip+sensors=1/0.5/5",
    "feedback=0.1/0.25+clip",
    "feedback=0.3/0.25+clip",
)
"""As the command line takes them."""


CREWS = (
    "crew",
    "crew=0.2",
    "crew=0.5",
    "crew=1",
    "crew=0.3/0.25",
    "crew=0.3/1",
    "crew=0.3/0.5/0.15",
    "crew=0.3/0.5/0.6",
    "crew=0.3/0.5/0.3/0.5",
    "crew=0.3/0.5/0.3/10",
)
CALM = Spectrum(0.1, 10.4)
CREWS_IN_CALM = ("crew", "crew=0.5", "crew=1", "crew=0.3/1", "crew=0.3/0.5/0.3/10")


def controllers(seaways: int, words_of_laws: tuple[str, ...], sea: str | Spectrum) -> None:
    """Print a row for each controller, as a table of Markdown."""
    laws = {words: control_of(words) for words in words_of_laws}
    assessed = assess(
        Crane.preset("tg3637"),
        laws,
        seeds=range(seaways),
        sea=sea,
        drives=("identified",),
        remedies=False,
        tipping_points=False,
    )
    print(f"{sea}\n")
    print(
        "| `--control` | swing, RMS | worse than none | largest swing in 3 h | place | saturation |"
    )
    print("|---|--:|--:|--:|--:|--:|")
    for name in assessed.names:
        words = name.partition(", ")[0]
        swing = np.degrees(rms_of(assessed.swing(name)))
        left = sum(assessed.departures(name).values())
        worse = "" if name == "no control" else f"{assessed.share_worse(name).value:.0%}"
        limited = {each.name: each.largest.value for each in assessed.limited(name)}
        largest = f"{np.degrees(limited['swing']):.1f}° | {limited['placement']:.2f} m"
        if np.isnan(limited["swing"]):
            largest = "– | –"
        rms = "–" if np.isnan(swing[0]) else f"{swing[0]:.2f}°"
        gone = f" ({left} left)" if left else ""
        print(
            f"| {words} | {rms}{gone} | {worse} | {largest} | {limited['saturation']:.0%} |",
            flush=True,
        )


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    kinds = ("stability", "borders", "spectrum", "controllers", "crews")
    parser.add_argument("what", choices=kinds)
    parser.add_argument("--seaways", type=int, default=80)
    parser.add_argument("--sets", type=int, default=10)
    parser.add_argument("--hours", type=float, default=3.0)
    parser.add_argument("--cells", type=int, default=10)
    given = parser.parse_args()
    if given.what == "stability":
        stability(given.sets, given.hours)
    elif given.what == "borders":
        borders(given.cells)
    elif given.what == "controllers":
        controllers(given.seaways, CONTROLLERS, "ss3")
    elif given.what == "crews":
        controllers(given.seaways, CREWS, "ss3")
        controllers(given.seaways, CREWS_IN_CALM, CALM)
    else:
        spectrum()


if __name__ == "__main__":
    main()
