"""How often 95 % intervals hold the truth of a second machine, as a user works.

    .venv/bin/python benchmarks/calibration.py [--axis hoist slew] [--rate 102] [--campaigns 20]
    .venv/bin/python benchmarks/calibration.py --stated-spread 0.06 [--without-current]
    .venv/bin/python benchmarks/calibration.py --python OLD/bin/python --label old
    .venv/bin/python benchmarks/calibration.py --oracle
    .venv/bin/python benchmarks/calibration.py --report FILE.jsonl [--beside OTHER.jsonl]

Each campaign is logged by the machine of `second_machine`, which shares no line with swashplate.
`swashplate campaign init` drafts the file from the folder of logs, the runs that are held out get
their role, nothing else is corrected, and `swashplate fit` fits it. Counted are the intervals that
hold the machine's numbers; the fitted drive's speed is compared with the machine's in maneuvers
that no campaign has. All goes through the command line, so that `--python` can run an older
installation over the same campaigns.

A fit knows every number beforehand to within a prior. Of what the tests hardly narrow, the
interval is the prior's: whether it holds says more of how the truth was drawn. So intervals that
are narrower than half of the prior's are counted apart. With `--stated-spread` the numbers that no
test determines are drawn too, by a normal factor: a standard deviation of 0.06 is about that of a
factor between 0.9 and 1.1.

An ammeter's gain cannot be told from the machine's numbers. So the share of intervals that hold
them is given twice: as they are, and in the amperes of the campaign's ammeter.

Every campaign is a line of JSON in `--out`, written as soon as it ends: what stands there already
is not run again.
"""

import argparse
import math
import re
import sys
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import NamedTuple

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
    has_own_causes,
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
from statements import bands_in_new_maneuvers, in_new_maneuvers

from swashplate import Drive
from swashplate.identification.estimation.fit_problem import LIKE_NAMED, whole_drive
from swashplate.identification.estimation.setup import setup_text

FOLDER = Path(__file__).parent
CYLINDER = FOLDER / "cylinder.py"
SEEDS = {512.0: "at_512", 102.0: "at_102", 50.0: "at_50"}
"""Ranges of seeds in levels.toml by the logger's rate."""
CHANCE = 1e-3
"""Probability of a coverage of one parameter, or a lower one, that is called more than chance."""


# --- one campaign ---------------------------------------------------------------------------------


def campaign(program, item, folder, oracle=False):
    """Record of a campaign: what a user gets of it, beside the machine's numbers.

    With `oracle` the command goes straight between samples, is logged exactly, and the file says
    so: what a fit would be worth that knew all of the command. Of the other instruments it assumes
    what every fit assumes.
    """
    equipment = draws.drawn_equipment(
        item["axis"], item["seed"], item["rate"], item["stated_spread"]
    )
    if not item["current"]:
        equipment = replace(equipment, ammeter=None)
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
    cylinder = item["axis"] == "cylinder"
    model = ["--model", CYLINDER] if cylinder else []
    words = [*model]
    if item["prior"] != LIKE_NAMED:
        drive = Drive.preset(item["axis"]).parameters
        setup = setup_text(whole_drive(drive, item["prior"]))
        (folder / "prior.toml").write_text(setup, "utf-8")
        words += ["--setup", "prior.toml"]
    record |= fit(program, truth, folder, *words)
    if not cylinder:
        record["statements"] = in_new_maneuvers(folder, equipment, record)
        record["bands"] = bands_in_new_maneuvers(folder, equipment)
        record["own_hysteresis"] = 0.5 * max(
            condition.hysteresis for condition in equipment.conditions.values()
        )
    record["new"] = predicted(program, folder, truth, *model)
    return record


# --- tables ---------------------------------------------------------------------------------------

GROUP = ("axis", "ammeter", "prior", "others drawn by", "rate, Hz")
"""Of what a table counts the campaigns together."""


class Group(NamedTuple):
    """What campaigns have in common that are counted together."""

    axis: str
    current: bool
    prior: float
    stated_spread: float
    rate: float

    @property
    def cells(self):
        """Cells of `GROUP`."""
        ammeter = "with" if self.current and self.axis != "cylinder" else "without"
        prior = "bounds" if self.axis == "cylinder" else f"{100.0 * self.prior:g} %"
        spread = f"{100.0 * self.stated_spread:g} %"
        return self.axis, ammeter, prior, spread, f"{self.rate:g}"


def groups(records):
    """Records by what they have in common, those that failed left out."""
    split = defaultdict(list)
    for record in records:
        if "error" not in record:
            split[Group(*(record[name] for name in Group._fields))].append(record)
    return dict(sorted(split.items(), key=lambda item: draws.AXES.index(item[0].axis)))


OVERVIEW = (
    *GROUP,
    "campaigns (seeds)",
    "exit codes",
    "intervals",
    "hold the truth",
    "that the tests tell",
    "of these hold",
    "hold as the ammeter reads",
    "by campaign",
    "half width, median %",
    "worst miss, half widths",
    "without interval",
    "CPU s, init",
    "CPU s, fit, median",
    "largest",
    "memory, MB, largest",
)


def told(rows):
    """Of intervals those that are narrower than half of what was known beforehand."""
    return [row for row in rows if row["told"] is not False]


def overview_row(group, records):
    """Cells of `OVERVIEW` for the campaigns of a group; widths are of what the tests tell."""
    intervals = with_interval(records)
    narrow = told(intervals)
    seeds = [record["seed"] for record in records]
    shares = []
    for record in records:
        rows = told(with_interval([record]))
        if rows:
            shares.append(sum(map(holds, rows)) / len(rows))
    codes = Counter(record["exit"] for record in records)
    return (
        *group.cells,
        f"{len(records)} ({min(seeds)} to {max(seeds)})",
        ", ".join(f"{code} ({n})" for code, n in sorted(codes.items())),
        len(intervals),
        coverage_cell(intervals),
        len(narrow),
        coverage_cell(narrow),
        coverage_cell(narrow, "as_read"),
        f"{min(shares):.0%} to {max(shares):.0%}" if shares else "-",
        number(map(half_width, narrow)),
        number(map(miss, narrow), max),
        sum(len(record["estimates"]) for record in records) - len(intervals),
        number([record["cpu_init"] for record in records]),
        number([record["cpu_fit"] for record in records]),
        number([record["cpu_fit"] for record in records], max),
        number([record["memory"] for record in records], max),
    )


def error_row(group, records):
    """What verdicts state of the speed, and the errors in new maneuvers: median, largest."""
    columns = [[record["stated"] for record in records]]
    columns += [[record["new"].get(name) for record in records] for name in new_names()]
    columns.append([max(record["new"].values()) for record in records])
    return *group.cells, *(f"{number(values)}, {number(values, max)}" for values in columns)


class Statement(NamedTuple):
    """The stated and the true error of one new maneuver, RMS in % of the speed's range."""

    maneuver: str
    seed: int
    stated: float
    true: float
    apart: bool
    """Whether it is a sine that is faster than any test, of which a sentence of its own speaks."""


def statements(record):
    """The statements of a campaign: of each maneuver the classes of its motion together."""
    rows = [row for row in record.get("statements", ()) if row["printed"] is not None]
    for name in new_names():
        some = [row for row in rows if row["maneuver"] == name]
        if not some:
            continue
        faster = some[0]["faster"]
        samples = sum(row["samples"] for row in some)
        printed, true = (
            math.sqrt(sum(row["samples"] * row[key] ** 2 for row in some) / samples)
            for key in ("printed", "true")
        )
        stated = printed if faster is None else max(faster, printed)
        yield Statement(name, record["seed"], stated, true, faster is not None)


def held_cell(some):
    """Of statements those that hold, and how large they are beside the true error."""
    if not some:
        return "-"
    ratios = [each.stated / each.true for each in some]
    held = sum(ratio >= 1.0 for ratio in ratios)
    return f"{held} of {len(some)}, {median(ratios):.2g}"


def statement_row(group, records):
    """How many statements hold, and the median of stated over true, by maneuver."""
    all_statements = [each for record in records for each in statements(record)]
    by_name = [[each for each in all_statements if each.maneuver == n] for n in new_names()]
    short = [each for each in all_statements if each.stated < 0.5 * each.true]
    return (
        *group.cells,
        *map(held_cell, by_name),
        held_cell([each for each in all_statements if not each.apart]),
        held_cell([each for each in all_statements if each.apart]),
        len(short),
    )


def band_row(group, records):
    """By maneuver how many bands are as wide as the error, how much wider, and what is in them."""
    cells = []
    for name in new_names():
        rows = [
            row for record in records for row in record.get("bands", ()) if row["maneuver"] == name
        ]
        wide = sum(row["band"] >= row["true"] for row in rows)
        ratio = number([row["band"] / row["true"] for row in rows])
        inside = number([100.0 * row["inside"] for row in rows])
        cells.append(f"{wide} of {len(rows)}, {ratio}, {inside} %" if rows else "-")
    return *group.cells, *cells


def alarm_row(group, records):
    """Sound campaigns of which the verdict names a cause, or blames a run."""
    named = [record for record in records if record["causes"]]
    wrong = [record for record in named if not has_own_causes(record)]
    texts = [f"{', '.join(record['causes'])} ({record['seed']})" for record in wrong]
    blamed = [
        f"{', '.join(record['blamed']) or record['unsound'][0]} ({record['seed']})"
        for record in records
        if record["unsound"]
    ]
    cells = (len(named), len(wrong), "; ".join(texts) or "-", "; ".join(blamed) or "-")
    return *group.cells, len(records), *cells


def instrument_rows(split):
    """Errors with and without an ammeter, of the campaigns that have both."""
    for group, records in split.items():
        others = split.get(group._replace(current=False))
        if not group.current or not others:
            continue
        pairs = [
            (max(one["new"].values()), max(other["new"].values()))
            for one in records
            for other in others
            if one["seed"] == other["seed"]
        ]
        if pairs:
            with_one, without = (median(values) for values in zip(*pairs, strict=True))
            ratio = median(other / one for one, other in pairs)
            yield (
                group.axis, *group.cells[2:], len(pairs), f"{with_one:.3g}", f"{without:.3g}",
                f"{without / with_one:.2g}", f"{ratio:.2g}",
            )  # fmt: skip


def print_report(records):
    """All tables of a file's records."""
    split = groups(records)
    print_table(OVERVIEW, [overview_row(*item) for item in split.items()])
    print("\nError of the speed, RMS in % of its range: median, largest of the campaigns.")
    head = (*GROUP, "stated, worst class", *new_names(), "largest of these")
    print_table(head, [error_row(*item) for item in split.items()])
    print("\nStated errors that hold, and stated over true in the median.")
    head = (*GROUP, *new_names(), "all that tests are as fast as", "a faster sine", "below half")
    print_table(head, [statement_row(*item) for item in split.items()])
    print("\nBands about new maneuvers that are as wide as the error, both RMS; half width over")
    print("error, and share of samples inside, in the median.")
    print_table((*GROUP, *new_names()), [band_row(*item) for item in split.items()])
    print("\nSound campaigns with a cause, and with blamed runs (seeds).")
    head = (*GROUP, "campaigns", "with a cause", "that is not there", "which", "blamed runs")
    print_table(head, [alarm_row(*item) for item in split.items()])
    if rows := list(instrument_rows(split)):
        print("\nLargest error of the new maneuvers, median %, with and without an ammeter.")
        head = (GROUP[0], *GROUP[2:], "campaigns", "with", "without", "ratio", "ratio, median")
        print_table(head, rows)
    for group, some in split.items():
        print_parameters(", ".join(group.cells), with_interval(some))
        left_out = sorted({name for record in some for name in record["without_counterpart"]})
        drafts = Counter(record["interpolation"] for record in some)
        print(f"\nWithout a counterpart in the machine: {', '.join(left_out) or 'none'}.")
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
    for group, some in split.items():
        shared = {one["seed"] for one in some} & {one["seed"] for one in beside.get(group, ())}
        for words, of_file in (("this", some), ("beside", beside.get(group, ()))):
            common = [record for record in of_file if record["seed"] in shared]
            if not common:
                continue
            intervals = with_interval(common)
            new = [max(record["new"].values()) for record in common]
            rows.append((
                ", ".join(group.cells), words, len(common), len(intervals),
                coverage_cell(intervals), coverage_cell(intervals, "as_read"),
                number(map(half_width, intervals)),
                number(map(miss, intervals), max), number(new), number(new, max),
                number([record["cpu_fit"] for record in common]),
            ))  # fmt: skip
    print_table(
        (", ".join(GROUP), "file", "campaigns", "intervals", "hold the truth",
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
    parser.add_argument("--skipped", type=int, default=0, help="of these, the first so many")
    parser.add_argument(
        "--stated-spread", type=float, default=0.0, help="of what no test determines; 0.06 is 6 %%"
    )
    parser.add_argument(
        "--prior",
        type=float,
        default=LIKE_NAMED,
        help="how near the numbers are taken to be to the named drive's",
    )
    parser.add_argument("--without-current", action="store_true", help="no ammeter")
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
            {
                "axis": axis,
                "rate": arguments.rate,
                "stated_spread": arguments.stated_spread,
                "current": not arguments.without_current,
                "prior": arguments.prior,
                "seed": seed,
            }
            for seed in range(first + arguments.skipped, first + count)
            for axis in arguments.axis
        ]

        def work(item, folder):
            return campaign(program, item, folder, arguments.oracle)

        run_missing(work, missing(items, read(path)), arguments.jobs, path, arguments.keep)
    records = read(path)
    print_report(records)
    if arguments.beside is not None:
        print_beside(records, read(arguments.beside))


if __name__ == "__main__":
    main()
