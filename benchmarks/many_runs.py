"""Fits of many runs and of long logs, as whole processes: processor time and memory.

    .venv/bin/python benchmarks/many_runs.py [--sets 1 3 10 30] [--minutes 10 60 360]

A set is Kruse's 13 tests of the hoist, 110,605 samples, of one virtual machine and other noise; ten
of them are fitted. A log of some minutes is one file of the same tests in any order, with rest
between them. Each fit writes its folder and report, then `report` writes the report again. One
process at a time; run it twice and take the second, as the first one compiles.
"""

import argparse
import shutil
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
from campaign_file import campaign_text
from command_line import Program

from swashplate import Drive, rig
from swashplate.identification import drawn_drive, whole_drive
from swashplate.maneuvers import source_tests

COUNTS_PER_TURN = 2526.315789473684
RATE = 512.0
AMMETER = 0.003
"""Standard deviation of its noise. [A]"""
LONGEST = 7200.0
"""After which a command is ended. [s]"""
CHANNELS = {
    "current": '{ kind = "rectified_current", column = "current", unit = "A" }',
    "counts": (
        f'{{ kind = "encoder_counts", column = "counts", counts_per_turn = {COUNTS_PER_TURN} }}'
    ),
}


def machine() -> Drive:
    """The virtual hoist, a few per cent off the published one."""
    hoist = Drive.preset("hoist")
    truth = drawn_drive(hoist, whole_drive(hoist.parameters), 1)
    return Drive(replace(truth.parameters, card_switch="split"))


def write_sets(count: int, folder: Path) -> Path:
    """A campaign of so many sets of Kruse's tests."""
    truth, head, runs = machine(), "", list[str]()
    for number in range(count):
        part = folder / "part"
        tests = rig.run("hoist", seed=1 + number, truth=truth)
        text = rig.write(tests, part).read_text("utf-8")
        head = text.partition("[[runs]]")[0]
        for run in tests.runs.values():
            name = f"{run.stem}_{number:03d}.csv"
            (part / f"{run.stem}.csv").rename(folder / name)
            runs.append(f'[[runs]]\nfile = "{name}"\nrole = "{run.role}"\n')
        shutil.rmtree(part)
    (folder / "campaign.toml").write_text(head + "\n".join(runs), "utf-8")
    return folder / "campaign.toml"


def write_log(minutes: float, folder: Path) -> Path:
    """A campaign of one log."""
    rng, size = np.random.default_rng(0), round(60.0 * minutes * RATE)
    tests = [test.sample(RATE) for test in source_tests("hoist").values()]
    parts, rows = list[np.ndarray](), 0
    while rows < size:
        test = tests[rng.integers(len(tests))] * rng.choice([0.5, 0.8, 1.0, 1.0])
        rest = np.zeros(int(RATE * rng.uniform(2.0, 6.0)))
        parts += [test, rest]
        rows += test.size + rest.size
    voltage = np.round(np.concatenate(parts)[:size] * 4096.0 / 20.0) / 4096.0 * 20.0
    run = machine().simulate(voltage)
    current = run.current_positive + run.current_negative
    turned = np.floor(run.shaft_position * COUNTS_PER_TURN / (2.0 * np.pi)).astype(int)
    pl.DataFrame(
        {
            "time": np.round(np.arange(size) / RATE, 6),
            "voltage": np.round(voltage, 5),
            "current": np.round(current + AMMETER * rng.normal(size=size), 5),
            "counts": turned,
        }
    ).write_csv(folder / "log.csv")
    text = campaign_text(
        "One log",
        axis="hoist",
        drive="hoist",
        command="voltage",
        interpolation="linear",
        channels=CHANNELS,
        runs={"log.csv": "fit"},
    )
    (folder / "campaign.toml").write_text(text, "utf-8")
    return folder / "campaign.toml"


def command(folder: Path, *words: str) -> tuple[float, float]:
    """Processor time [s] and largest memory [MB] of a command, which may say "not usable"."""
    program = Program(sys.executable, one_thread=False, longest=LONGEST)
    code, output, seconds, megabytes = program.run(*words, folder=folder)
    if code not in (0, 1):
        raise SystemExit(f"swashplate {' '.join(words)} ended with {code}:\n{output}")
    return seconds, megabytes


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, nargs="*", default=[1, 3, 10, 30])
    parser.add_argument("--minutes", type=float, nargs="*", default=[10.0, 60.0, 360.0])
    arguments = parser.parse_args()
    cases = [(f"{13 * count} runs", write_sets, count) for count in arguments.sets]
    cases += [(f"one log of {each:g} min", write_log, each) for each in arguments.minutes]
    print("| campaign | `fit`, CPU | memory | `report`, CPU | memory |")
    print("|---|--:|--:|--:|--:|")
    for words, write, size in cases:
        with tempfile.TemporaryDirectory() as folder:
            # elsewhere: a process begins with the memory of the one that starts it
            with ProcessPoolExecutor(1) as writer:
                path = writer.submit(write, size, Path(folder)).result()
            fitted, of_fit = command(path.parent, "fit", path.name, "--out", "fitted")
            reported, of_report = command(path.parent, "report", "fitted")
        row = f"{fitted:.1f} s | {of_fit:.0f} MB | {reported:.1f} s | {of_report:.0f} MB"
        print(f"| {words} | {row} |", flush=True)


if __name__ == "__main__":
    main()
