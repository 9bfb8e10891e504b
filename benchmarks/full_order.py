"""The full-order model: how long 30 s take, how well its paths agree, how good the reduction is.

.venv/bin/python benchmarks/full_order.py            prints all tables
.venv/bin/python benchmarks/full_order.py --write    also puts them into docs/full-order.md
"""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np
import polars as pl
from numpy.typing import NDArray

from swashplate import maneuvers
from swashplate.full_order import FullOrderDrive, compare
from swashplate.full_order import validity as validity_of
from swashplate.machine.marching import (
    Observation,
    ObservedRecord,
    jacobian,
    record_of,
    residuals,
)

DOCUMENT = Path(__file__).parent.parent / "docs" / "full-order.md"
CASES = {
    "sine 6.5 V, 0.1 Hz": maneuvers.sine(6.5, 0.1, length=30.0),
    "sine 9 V, 0.1 Hz, at both stops": maneuvers.sine(9.0, 0.1, length=30.0),
}
AXES = ("hoist", "slew", "luff")
EPSILONS = tuple(4.0**-k for k in range(6))


def speeds() -> Iterator[str]:
    """30 s of the hoist: time, and difference in speed to sub-steps a sixteenth as long."""
    yield "| 30 s of the hoist | median | speed off with 16 times the sub-steps |"
    yield "|---|--:|--:|"
    hoist = FullOrderDrive.preset("hoist")
    fine = 16 * hoist.substeps(1.0 / 512.0)
    for title, maneuver in CASES.items():
        run = hoist.drive.simulate(maneuver.sample(512.0))
        exact, found = (hoist.follow(run, substeps=n).shaft_speed for n in (fine, None))
        spent = _best(lambda run=run: hoist.follow(run))
        off = np.degrees(np.abs(found - exact).max())
        yield f"| {title} | {_seconds(spent)} | {off:.1e} deg/s |"


def derivatives() -> Iterator[str]:
    """30 s of the hoist with exact derivatives of its speed, and with central differences."""
    yield "| parameters | exact | central differences | faster |"
    yield "|---|--:|--:|--:|"
    hoist = FullOrderDrive.preset("hoist")
    record = record_of(CASES["sine 6.5 V, 0.1 Hz"].sample(512.0), 512.0, what="voltage")
    speed = Observation("shaft_speed", record.time, np.zeros(record.time.size))
    observed = ObservedRecord(record, [speed])
    instance = hoist
    columns = tuple(f"plant.machine.{each}" for each in hoist.physical.numbers)
    plain = _best(lambda: residuals(instance, observed))
    for count in (2, 6, 12, len(columns)):
        exact = _best(lambda wanted=columns[:count]: jacobian(instance, observed, wanted))
        apart = (2 * count + 1) * plain
        yield (f"| {count} | {_seconds(exact)} | {_seconds(apart)} | {apart / exact:.1f} times |")


def _best(run: Callable[[], object]) -> float:
    run()
    times = []
    for _ in range(9):
        begin = perf_counter()
        run()
        times.append(perf_counter() - begin)
    return median(times)


def validity() -> Iterator[str]:
    """For which maneuvers the one-state model will do."""
    yield "| axis | maneuver | largest, % | rms, % | within 1 % |"
    yield "|---|---|--:|--:|---|"
    found = pl.concat([validity_of(FullOrderDrive.preset(name)).to_polars() for name in AXES])
    for row in found.iter_rows(named=True):
        within = "yes" if row["within_1_percent"] else "no"
        yield (
            f"| {row['axis']} | {row['maneuver']} | {row['largest_percent']:.2f} | "
            f"{row['rms_percent']:.2f} | {within} |"
        )


def limit() -> Iterator[str]:
    """How the difference shrinks with the inertias."""
    yield "| axis | " + " | ".join(f"ε = 1/{1.0 / e:.0f}" for e in EPSILONS) + " | exponent |"
    yield "|---|" + "--:|" * (len(EPSILONS) + 1)
    step = maneuvers.step(4.0, start=0.5, stop=2.0, length=3.0).sample(512.0)
    for name in AXES:
        drives = [_scaled(FullOrderDrive.preset(name), each) for each in EPSILONS]
        found = [compare(each, each.drive.simulate(step)).relative[1] for each in drives]
        sizes = 100.0 * np.array(found)
        yield f"| {name} | " + " | ".join(f"{e:.4f}" for e in sizes) + f" | {_slope(sizes):.2f} |"


def _scaled(full: FullOrderDrive, epsilon: float) -> FullOrderDrive:
    """The drive with inertias times ε and dampings times √ε."""
    inertias = ("spool_mass", "feedback_arm_inertia", "swash_inertia", "piston_mass")
    # the load's inertia acts on the plate's rate, as a damping does
    dampings = ("spool_damping", "piston_damping", "load_inertia")
    parts = dict.fromkeys(inertias, epsilon) | dict.fromkeys(dampings, epsilon**0.5)
    numbers = full.physical.numbers
    return full.replace(**{name: part * numbers[name] for name, part in parts.items()})


def _slope(sizes: NDArray[np.float64]) -> float:
    return float(np.polyfit(np.log(EPSILONS), np.log(sizes), 1)[0])


def _seconds(time: float) -> str:
    return f"{time:.2f} s" if time >= 1.0 else f"{1e3 * time:.0f} ms"


def main() -> None:
    """Print the tables, and on request write them into the documentation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="also write docs/full-order.md")
    write = parser.parse_args().write
    tables = {
        "limit": limit(),
        "validity": validity(),
        "speed": speeds(),
        "derivatives": derivatives(),
    }
    for name, lines in tables.items():
        table = "\n".join(lines)
        print(f"\n{table}", flush=True)
        if write:
            text = DOCUMENT.read_text("utf-8")
            head, rest = text.split(f"<!-- {name}: begin -->")
            tail = rest.split(f"<!-- {name}: end -->")[1]
            DOCUMENT.write_text(
                f"{head}<!-- {name}: begin -->\n{table}\n<!-- {name}: end -->{tail}", "utf-8"
            )


if __name__ == "__main__":
    main()
