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
import re
import sys
from collections import Counter, defaultdict
from pathlib import Path
from statistics import median

from command_line import (
    Program,
    draft,
    fit,
    new_names,
    predicted,
)
from records import (
    coverage_cell,
    half_width,
    holds,
    miss,
    missing,
    number,
    print_table,
    read,
    run_missing,
    with_interval,
)
from scipy.stats import binom
from second_machine import draws, logger

FOLDER = Path(__file__).parent
CYLINDER = FOLDER / "cylinder.py"
SEEDS = {512.0: "at_512", 102.0: "at_102", 50.0: "at_50"}
"""Ranges of seeds in levels.toml by the logger's rate."""
CHANCE = 1e-3
"""Probability of a coverage of one parameter, or a lower one, that is called more than chance."""


# --- one campaign ---------------------------------------------------------------------------------


def campaign(program, axis, rate, seed, folder, oracle=False):
    """Record of a campaign: what a user gets of it, beside the machine's numbers.

    With `oracle` the command goes straight between samples, is logged exactly, and the file says
    so: what a fit would be worth that knew all of the command. Of the other instruments it assumes
    what every fit assumes.
    """
    equipment = draws.drawn_equipment(axis, seed, rate)
    truth = logger.write_campaign(equipment, folder, exact_command=oracle)
    record = {"cpu_init": draft(program, truth, folder)}
    file = folder / "campaign.toml"
    text = file.read_text("utf-8")
    if oracle:
        exact = 'interpolation = "linear"\naccuracy = { gain = 0, zero = 0, time = 0 }'
        text = re.sub(r'(# )?interpolation = "\w+".*', exact, text)
        file.write_text(text, "utf-8")
    # a comment in drafts that leave it to the fit
    drafted = re.search(r'^interpolation\s*=\s*"(\w+)"', text, re.MULTILINE)
    record["interpolation"] = drafted[1] if drafted else "left to the fit"
    model = ["--model", CYLINDER] if axis == "cylinder" else []
    record |= fit(program, truth, folder, *model)
    record["new"] = predicted(program, folder, truth, *model)
    return record


# --- tables ---------------------------------------------------------------------------------------


def groups(records):
    """Records by axis and rate, those that failed left out."""
    split = defaultdict(list)
    for record in records:
        if "error" not in record:
            split[record["axis"], record["rate"]].append(record)
    return split


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
    """What verdicts state of the speed, and the errors in new maneuvers: median, largest."""
    columns = [[record["stated"] for record in records]]
    columns += [[record["new"].get(name) for record in records] for name in new_names()]
    return axis, f"{rate:g}", *(f"{number(values)}, {number(values, max)}" for values in columns)


def print_report(records):
    """All tables of a file's records."""
    split = groups(records)
    print_table(OVERVIEW, [overview_row(*key, some) for key, some in split.items()])
    print("\nError of the speed, RMS in % of its range: median, largest of the campaigns.")
    head = ("axis", "rate, Hz", "stated, worst class", *new_names())
    print_table(head, [error_row(*key, some) for key, some in split.items()])
    for (axis, rate), some in split.items():
        print_parameters(f"{axis}, {rate:g} Hz", with_interval(some))
        left_out = sorted({name for record in some for name in record["without_counterpart"]})
        codes = Counter(record["exit"] for record in some)
        drafts = Counter(record["interpolation"] for record in some)
        print(f"\nWithout a counterpart in the machine: {', '.join(left_out) or 'none'}.")
        print(f"Exit codes: {', '.join(f'{n} times {code}' for code, n in codes.items())}.")
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
        program = Program(arguments.python)
        items = [
            {"axis": axis, "rate": arguments.rate, "seed": seed}
            for seed in range(first, first + count)
            for axis in arguments.axis
        ]

        def work(item, folder):
            return campaign(program, **item, folder=folder, oracle=arguments.oracle)

        run_missing(work, missing(items, read(path)), arguments.jobs, path, arguments.keep)
    records = read(path)
    print_report(records)
    if arguments.beside is not None:
        print_beside(records, read(arguments.beside))


if __name__ == "__main__":
    main()
