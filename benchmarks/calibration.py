"""How often 95 % intervals hold the truth of a second machine, as a user works.

    .venv/bin/python benchmarks/calibration.py [--axis hoist slew] [--rate 102] [--campaigns 20]
    .venv/bin/python benchmarks/calibration.py --python OLD/bin/python --label old
    .venv/bin/python benchmarks/calibration.py --oracle
    .venv/bin/python benchmarks/calibration.py --report FILE.jsonl [--beside OTHER.jsonl]

Each campaign is logged by the machine of `second_machine`, which shares no line with swashplate.
`swashplate campaign init` drafts the file from the folder of logs, the runs that are held out get
their role, nothing else is corrected, and `swashplate fit` fits it. Counted are the intervals that
hold the machine's numbers; the fitted drive's speed is compared with the machine's in maneuvers
that no campaign has. All goes through the command line, so that `--python` can run an older
installation over the same campaigns.

An ammeter's gain cannot be told from the machine's numbers. So the share of intervals that hold
them is given twice: as they are, and in the amperes of the campaign's ammeter.

Every campaign is a line of JSON in `--out`, written as soon as it ends: what stands there already
is not run again.
"""

import argparse
import csv
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
from threading import Lock, Timer

import numpy as np
from scipy.stats import binom, binomtest
from second_machine import draws, logger

FOLDER = Path(__file__).parent
CYLINDER = FOLDER / "cylinder.py"
LONGEST = 600.0
"""After which a command is ended, and the campaign counted as failed. [s]"""
SEEDS = {512.0: "at_512", 102.0: "at_102", 50.0: "at_50"}
"""Ranges of seeds in levels.toml by the logger's rate."""
CHANCE = 1e-3
"""Probability of a coverage of one parameter, or a lower one, that is called more than chance."""


# --- the installation under test ------------------------------------------------------------------


class Program:
    """The swashplate of a Python executable, by its command line."""

    def __init__(self, python):
        self.python = python
        self.environment = {
            **os.environ,
            "OPENBLAS_NUM_THREADS": "1",
            "OMP_NUM_THREADS": "1",
            "COLUMNS": "1000",  # no sentence is broken into lines
            "NO_COLOR": "1",
        }

    def run(self, *words, folder):
        """Exit code, output, CPU time [s] and largest memory [MB] of a command."""
        with tempfile.TemporaryFile("w+", encoding="utf-8") as stream:
            process = subprocess.Popen(
                [self.python, "-m", "swashplate", *map(str, words)],
                cwd=folder,
                stdout=stream,
                stderr=subprocess.STDOUT,
                env=self.environment,
            )
            watch = Timer(LONGEST, process.kill)
            watch.start()
            _, status, usage = os.wait4(process.pid, 0)
            watch.cancel()
            process.returncode = os.waitstatus_to_exitcode(status)
            stream.seek(0)
            output = stream.read()
        seconds = usage.ru_utime + usage.ru_stime
        return process.returncode, output, seconds, usage.ru_maxrss / 1024.0


class CampaignError(Exception):
    """A command of a campaign that ended with an error."""


# --- one campaign ---------------------------------------------------------------------------------


def set_roles(path, held_out):
    """Give the runs of a drafted campaign file their roles."""
    lines, role = [], "fit"
    for line in path.read_text("utf-8").splitlines():
        named = re.match(r'\s*file\s*=\s*"([^"]+)"', line)
        if named:
            role = "validate" if Path(named[1]).name in held_out else "fit"
        lines.append(re.sub(r'^(\s*role\s*=\s*)"\w+"', rf'\1"{role}"', line))
    path.write_text("\n".join(lines) + "\n", "utf-8")
    roles = [run.get("role", "fit") for run in tomllib.loads(path.read_text("utf-8"))["runs"]]
    if roles.count("validate") != len(held_out):
        raise CampaignError(
            f"{path.name}: {roles.count('validate')} runs are held out, not {held_out}"
        )


def with_forces(numbers, setup):
    """Parameters by name, and the forces at the currents of a fit configuration."""
    numbers = dict(numbers)
    for stage in setup.get("stages", ()):
        for direction, sign in (("plus", 1.0), ("minus", -1.0)):
            for n, e in enumerate(stage.get("forces", {}).get(direction, ()), 1):
                coefficients = [numbers[f"Z{k}_{direction}"] for k in (19, 20, 21, 22)]
                force = sum(c * (sign * e) ** k for k, c in enumerate(coefficients, 1))
                numbers[f"force_{direction}_{n}"] = sign * force
    return numbers


OLDER = {"value": "estimate", "lower": "lower 95 %", "upper": "upper 95 %"}
"""What older installations called the columns of estimates.csv."""


def number_in(row, column):
    """Number in a row of estimates.csv; None if the field is empty."""
    text = row[column] if column in row else row[OLDER[column]]
    return float(text) if text else None


def estimates(fitted, truth):
    """Estimates of what the machine has, and the names of those that it has not.

    "as_read" is the truth in the amperes of the campaign's ammeter.
    """
    file = fitted / "setup.toml"
    setup = tomllib.loads(file.read_text("utf-8")) if file.exists() else {}
    numbers = with_forces(truth["parameters"], setup)
    as_read = with_forces(draws.as_read(truth["parameters"], truth["ammeter_gain"]), setup)
    rows, without = [], set()
    with (fitted / "estimates.csv").open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            name = row["parameter"]
            if name not in numbers:
                without.add(name.partition(" (")[0])
                continue
            rows.append(
                {
                    "name": name,
                    "truth": numbers[name],
                    "as_read": as_read[name],
                    "value": number_in(row, "value"),
                    "lower": number_in(row, "lower"),
                    "upper": number_in(row, "upper"),
                }
            )
    return rows, sorted(without)


def predicted_drive(program, folder, drive, truth):
    """Errors of a fitted drive's speed in new maneuvers: RMS, % of the speed's range, by name."""
    errors = {}
    for name in new_names():
        time_, volts, speed = logger.new_run(truth["parameters"], truth["axis"], name).T
        write_table(folder / "new.csv", {"time": time_, "voltage": volts})
        code, output, _, _ = program.run(
            "simulate", drive, "new.csv", "--interpolation", "linear", "--rate", 512,
            "--out", "simulated.csv", "--force", folder=folder,
        )  # fmt: skip
        if code:
            raise CampaignError(output)
        with (folder / "simulated.csv").open(encoding="utf-8") as stream:
            simulated = {
                float(row["time"]): float(row["shaft_speed"]) for row in csv.DictReader(stream)
            }
        ours = np.interp(time_, list(simulated), list(simulated.values()))
        errors[name] = 100.0 * float(np.sqrt(np.mean((ours - speed) ** 2)) / np.ptp(speed))
    return errors


def predicted_cylinder(program, folder, truth):
    """The same of the fitted cylinder, by `validate` on logs without instruments."""
    lines = [
        'title = "new maneuvers"',
        "[axes.drive]",
        'time = { column = "time", unit = "s" }',
        'input = { kind = "voltage", column = "voltage", unit = "V", interpolation = "linear" }',
        'channels.speed = { kind = "shaft_speed", column = "speed", unit = "m/s" }',
    ]
    ranges = {}
    for name in new_names():
        cylinder = draws.drawn_cylinder(truth["seed"])
        time_, volts, speed = logger.new_cylinder_run(cylinder, name).T
        file = f"{name}.csv".replace(" ", "_")
        write_table(folder / file, {"time": time_, "voltage": volts, "speed": speed})
        lines += ["[[runs]]", f'file = "{file}"', 'role = "validate"']
        ranges[file.removesuffix(".csv")] = (name, float(np.ptp(speed)))
    (folder / "new.toml").write_text("\n".join(lines) + "\n", "utf-8")
    code, output, _, _ = program.run(
        "validate", "fitted", "new.toml", "--model", CYLINDER, "--out", "new", folder=folder
    )
    if code not in {0, 1}:
        raise CampaignError(output)
    errors = {}
    with (folder / "new" / "measures.csv").open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            if row["channel"] == "speed":
                name, size = ranges[row["run"]]
                errors[name] = 100.0 * float(row["rmse"]) / size
    return errors


def new_names():
    """Names of the new maneuvers."""
    return [name for name, entry in draws.LEVELS["new"].items() if isinstance(entry, dict)]


def write_table(path, columns):
    """Write columns of numbers to a CSV file, to the last digit."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))


def claims(headline):
    """Errors that a verdict claims of the held-out speed: mean and worst run, % of range."""
    speed = (
        r"speed(?: from)?[ \w]*? to ([\d.eE+-]+) % of its range(?: \(worst run ([\d.eE+-]+) %\))?"
    )
    said = re.search(speed, headline)
    if not said:
        return None, None
    return tuple(float(text) if text else None for text in said.groups())


def campaign(program, axis, rate, seed, folder, oracle=False):
    """Record of a campaign: what a user gets of it, beside the machine's numbers.

    With `oracle` the command goes straight between samples, is logged exactly, and the file says
    so: what a fit would be worth that knew all of the command. Of the other instruments it assumes
    what every fit assumes.
    """
    truth = logger.write_campaign(axis, seed, folder, rate, exact_command=oracle)
    record = {"axis": axis, "rate": rate, "seed": seed}
    logs = sorted(Path("logs") / path.name for path in (folder / "logs").iterdir())
    known = ["--drive", axis, "--counts-per-turn", repr(truth["counts_per_turn"])]
    words = known if axis != "cylinder" else []
    code, output, record["cpu_init"], _ = program.run(
        "campaign", "init", *logs, *words, "--out", "campaign.toml", folder=folder
    )
    if code:
        raise CampaignError(output)
    file = folder / "campaign.toml"
    set_roles(file, truth["held_out"])
    text = file.read_text("utf-8")
    if oracle:
        exact = 'interpolation = "linear"\naccuracy = { gain = 0, zero = 0, time = 0 }'
        text = re.sub(r'(# )?interpolation = "\w+".*', exact, text)
        file.write_text(text, "utf-8")
    # a comment in drafts that leave it to the fit
    drafted = re.search(r'^interpolation\s*=\s*"(\w+)"', text, re.MULTILINE)
    record["interpolation"] = drafted[1] if drafted else "left to the fit"
    model = ["--model", CYLINDER] if axis == "cylinder" else []
    code, output, record["cpu_fit"], record["memory"] = program.run(
        "fit", file.name, "--out", "fitted", "--jobs", 1, *model, folder=folder
    )
    record["exit"] = code
    if code not in {0, 1}:
        raise CampaignError(output)
    fitted = folder / "fitted"
    verdict = json.loads((fitted / "fit.json").read_text("utf-8")).get("verdict") or {}
    record["grade"] = verdict.get("grade", "")
    record["headline"] = verdict.get("headline", "")
    # an older installation stores no verdict, but prints it
    record["claim"], record["claim_worst"] = claims(record["headline"] or output)
    record["estimates"], record["without_counterpart"] = estimates(fitted, truth)
    if axis == "cylinder":
        record["new"] = predicted_cylinder(program, folder, truth)
    else:
        record["new"] = predicted_drive(program, folder, fitted / "drive.toml", truth)
    return record


# --- all campaigns --------------------------------------------------------------------------------


def read(path):
    """Records that a file holds; none if there is no file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text("utf-8").splitlines() if line]


def run_missing(program, items, jobs, path, keep, oracle):
    """Run campaigns, (axis, rate, seed), and append a line of each to a file."""
    lock, begun, count = Lock(), time.perf_counter(), 0

    def one(item):
        nonlocal count
        axis, rate, seed = item
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary) / "campaign"
            if keep is not None:
                folder = keep / f"{axis}-{rate:g}-{seed}"
            try:
                record = campaign(program, axis, rate, seed, folder, oracle)
            except CampaignError as error:
                record = {"axis": axis, "rate": rate, "seed": seed, "error": str(error)[-2000:]}
        with lock:
            with path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(record) + "\n")
            count += 1
            left = (time.perf_counter() - begun) / count * (len(items) - count)
            print(f"\r{count} of {len(items)}, {left:.0f} s left ", end="", file=sys.stderr)

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(one, items))
    print(file=sys.stderr)


# --- tables ---------------------------------------------------------------------------------------


def holds(row, what="truth"):
    """Whether an interval holds the truth; an end that is missing lies at infinity."""
    low = -math.inf if row["lower"] is None else row["lower"]
    high = math.inf if row["upper"] is None else row["upper"]
    return low <= row[what] <= high


def half_width(row):
    """Half width of an interval, % of the truth; None where an end is missing."""
    if row["lower"] is None or row["upper"] is None or not row["truth"]:
        return None
    return 50.0 * (row["upper"] - row["lower"]) / abs(row["truth"])


def miss(row):
    """Distance of the estimate from the truth, in half widths; None where an end is missing."""
    if row["lower"] is None or row["upper"] is None or row["lower"] == row["upper"]:
        return None
    middle, half = 0.5 * (row["upper"] + row["lower"]), 0.5 * (row["upper"] - row["lower"])
    return abs(row["truth"] - middle) / half


def present(values):
    """The values that are there."""
    return [value for value in values if value is not None]


def number(values, of=median):
    """A statistic of the values that are there, as text."""
    values = present(values)
    return f"{of(values):.3g}" if values else "-"


def with_interval(records):
    """All estimates of records that have an interval, if with one end."""
    rows = [row for record in records for row in record["estimates"]]
    return [row for row in rows if row["lower"] is not None or row["upper"] is not None]


def coverage_cell(rows, what="truth"):
    """Share of intervals that hold, with the 95 % interval of as many independent ones."""
    if not rows:
        return "-"
    inside = sum(holds(row, what) for row in rows)
    ends = binomtest(inside, len(rows)).proportion_ci(0.95, method="wilson")
    return f"{inside / len(rows):.1%} ({ends.low:.1%} to {ends.high:.1%})"


def groups(records):
    """Records by axis and rate, those that failed left out."""
    split = defaultdict(list)
    for record in records:
        if "error" not in record:
            split[record["axis"], record["rate"]].append(record)
    return split


def print_table(head, rows):
    """A table of Markdown."""
    print(f"\n| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for row in rows:
        print(f"| {' | '.join(map(str, row))} |")


OVERVIEW = (
    "axis",
    "rate, Hz",
    "campaigns (seeds)",
    "intervals",
    "hold the truth",
    "hold it as the ammeter reads",
    "by campaign",
    "half width, median %",
    "worst miss, half widths",
    "without interval",
    "CPU s, init",
    "CPU s, fit",
    "memory, MB, largest",
)


def overview_row(axis, rate, records):
    """Cells of `OVERVIEW` for the campaigns of an axis at a rate."""
    intervals = with_interval(records)
    seeds = [record["seed"] for record in records]
    shares = []
    for record in records:
        rows = with_interval([record])
        if rows:
            shares.append(sum(map(holds, rows)) / len(rows))
    return (
        axis,
        f"{rate:g}",
        f"{len(records)} ({min(seeds)} to {max(seeds)})",
        len(intervals),
        coverage_cell(intervals),
        coverage_cell(intervals, "as_read"),
        f"{min(shares):.0%} to {max(shares):.0%}" if shares else "-",
        number(map(half_width, intervals)),
        number(map(miss, intervals), max),
        sum(len(record["estimates"]) for record in records) - len(intervals),
        number([record["cpu_init"] for record in records]),
        number([record["cpu_fit"] for record in records]),
        number([record["memory"] for record in records], max),
    )


def error_row(axis, rate, records):
    """What headlines claim of held-out speed, and the errors in new maneuvers: median, largest."""
    columns = [[record["claim"] for record in records]]
    columns += [[record["new"].get(name) for record in records] for name in new_names()]
    return axis, f"{rate:g}", *(f"{number(values)}, {number(values, max)}" for values in columns)


def print_report(records):
    """All tables of a file's records."""
    split = groups(records)
    print_table(OVERVIEW, [overview_row(*key, some) for key, some in split.items()])
    print("\nError of the speed, RMS in % of its range: median, largest of the campaigns.")
    head = ("axis", "rate, Hz", "headline claims", *new_names())
    print_table(head, [error_row(*key, some) for key, some in split.items()])
    for (axis, rate), some in split.items():
        print_parameters(f"{axis}, {rate:g} Hz", with_interval(some))
        left_out = sorted({name for record in some for name in record["without_counterpart"]})
        grades = Counter(f"{record['grade']} (exit code {record['exit']})" for record in some)
        drafts = Counter(record["interpolation"] for record in some)
        print(f"\nWithout a counterpart in the machine: {', '.join(left_out) or 'none'}.")
        print(f"Verdicts: {', '.join(f'{n} {grade}' for grade, n in grades.items())}.")
        print(f"Drafted interpolation: {', '.join(f'{n} {name}' for name, n in drafts.items())}.")
    for record in records:
        if "error" in record:
            last = " ".join(record["error"].split())[-300:]
            print(f"\nFailed: {record['axis']}, {record['rate']:g} Hz, {record['seed']}: {last}")


def print_parameters(title, intervals):
    """Coverage and half width of each parameter, and which coverage chance does not allow."""
    named = defaultdict(list)
    for row in intervals:
        named[row["name"]].append(row)
    rows = []
    for name, some in named.items():
        inside = sum(map(holds, some))
        low = binom.cdf(inside, len(some), 0.95) < CHANCE
        bias = median(row["value"] / row["truth"] - 1.0 for row in some if row["truth"])
        rows.append((
            name, f"{inside} of {len(some)}", "below chance" if low else "",
            number(map(half_width, some)), f"{100.0 * bias:+.2f}", number(map(miss, some), max),
        ))  # fmt: skip
    print(f"\n{title}")
    head = ("parameter", "hold", f"at {1.0 - CHANCE:.1%}", "half width, median %")
    print_table((*head, "bias, median %", "worst miss, half widths"), rows)


def print_beside(records, others):
    """Coverage, widths and errors of two files on the campaigns that both have."""
    split, beside = groups(records), groups(others)
    rows = []
    for key, some in split.items():
        shared = {one["seed"] for one in some} & {one["seed"] for one in beside.get(key, ())}
        for words, group in (("this", some), ("beside", beside.get(key, ()))):
            common = [record for record in group if record["seed"] in shared]
            if not common:
                continue
            intervals = with_interval(common)
            new = [max(record["new"].values()) for record in common]
            rows.append((
                f"{key[0]}, {key[1]:g} Hz", words, len(common), len(intervals),
                coverage_cell(intervals), coverage_cell(intervals, "as_read"),
                number(map(half_width, intervals)),
                number(map(miss, intervals), max), number(new), number(new, max),
                number([record["cpu_fit"] for record in common]),
            ))  # fmt: skip
    print_table(
        ("axis", "file", "campaigns", "intervals", "hold the truth",
         "hold it as the ammeter reads", "half width, median %",
         "worst miss, half widths", "largest error on new, median %", "largest %", "CPU s, fit"),
        rows,
    )  # fmt: skip


def main():
    """Run what is missing in the file, print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--axis", nargs="+", choices=draws.AXES, default=draws.AXES)
    parser.add_argument("--rate", type=float, choices=SEEDS, default=512.0, help="of the logger")
    parser.add_argument("--campaigns", type=int, help="the first so many; by default all")
    parser.add_argument(
        "--development", action="store_true", help="seeds that nothing is quoted of"
    )
    parser.add_argument("--oracle", action="store_true", help="exact command, in a file of its own")
    parser.add_argument("--python", default=sys.executable, help="executable with swashplate")
    parser.add_argument("--label", default="tree", help="installation, in the file's name")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--out", type=Path, help="by default benchmarks/build/calibration-LABEL.jsonl"
    )
    parser.add_argument("--keep", type=Path, help="folder in which logs and fits stay")
    parser.add_argument("--report", type=Path, help="print the tables of this file; run nothing")
    parser.add_argument("--beside", type=Path, help="compare with this file on shared campaigns")
    arguments = parser.parse_args()
    path = arguments.report or arguments.out
    if path is None:
        name = f"{arguments.label}-oracle" if arguments.oracle else arguments.label
        path = FOLDER / "build" / f"calibration-{name}.jsonl"
    if arguments.report is None:
        path.parent.mkdir(parents=True, exist_ok=True)
        levels = draws.LEVELS["seeds"]
        first, last = levels[SEEDS[arguments.rate]]
        count = last - first + 1
        if arguments.campaigns is not None:
            count = min(count, arguments.campaigns)
        if arguments.development:
            first = levels["development_from"]
        done = {(one["axis"], one["rate"], one["seed"]) for one in read(path)}
        items = [
            (axis, arguments.rate, seed)
            for seed in range(first, first + count)
            for axis in arguments.axis
            if (axis, arguments.rate, seed) not in done
        ]
        keep = None if arguments.keep is None else arguments.keep.absolute()
        program = Program(arguments.python)
        run_missing(program, items, arguments.jobs, path, keep, arguments.oracle)
    records = read(path)
    print_report(records)
    if arguments.beside is not None:
        print_beside(records, read(arguments.beside))


if __name__ == "__main__":
    main()
