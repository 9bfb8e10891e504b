"""What the verdict says of campaigns with a fault, and of fewer instruments, as a user works.

    .venv/bin/python benchmarks/faults.py [--campaigns 2] [--sound 10] [--axis hoist slew]
    .venv/bin/python benchmarks/faults.py --fewer [--campaigns 2]
    .venv/bin/python benchmarks/faults.py --report FILE.jsonl [--judged JUDGED.jsonl]

Each campaign is logged by the machine of `second_machine`, which shares no line with swashplate,
with one fault in the machine, its instruments or its logs. `swashplate campaign init` drafts the
file, the runs that are held out get their role, nothing else is corrected; `campaign check` and
`fit` say what they say. The fitted drive's speed is compared with the faulty machine's in maneuvers
that no campaign has, and its values with the machine's.

Class A: no fit can see the fault, a sound machine with other numbers gives the same signals. Class
B: it matters, by new maneuvers or by a value, beyond the sound campaign of the same seed. Class C:
it does not. The limits are in levels.toml.

Every campaign is a line of JSON in `--out`, written as soon as it ends: what stands there already
is not run again.
"""

import argparse
import json
import re
import sys
from collections import Counter
from pathlib import Path

from command_line import CampaignError, Program, draft, fit, new_names, predicted
from records import (
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
from second_machine import draws, logger
from second_machine.faults import FAULTS, FEWER, unseen

FOLDER = Path(__file__).parent
RATE = 512.0
FEWER_RATES = {512.0: "at_512", 50.0: "at_50"}
"""Rates of the campaigns with fewer instruments, and their seeds in levels.toml. [Hz]"""
LATE = r"time stamps of (encoder_counts|the command)|\btau\b"
"""Which of them is late, logs hardly tell."""
NAMES = {
    "run of another axis": r"differ in scale|moves [\d.]+ times as",
    "spool friction": r"friction or hysteresis",
    "leakage under load, 10 % of the top speed": r"load or leakage",
    "leakage under load, 2 % of the top speed": r"load or leakage",
    "drift of 8 % over the campaign": r"drift of",
    "encoder 20 ms late": LATE,
    "ammeter clipped": r"clipped",
    "delay 20 ms longer than stated": LATE,
    "encoder reads 3 % too much": r"scale of encoder_counts",
    "ammeter reads 3 % too much": r"scale of rectified_current",
    "command's stamps 20 ms late": LATE,
    "encoder loses counts above 70 % of the top speed": r"loses counts|largest speeds",
    "supply pressure 20 % low": r"\bZ9\b",
    "play of 0.2 degrees before the encoder": r"friction or hysteresis",
}
"""Words by which a verdict or `campaign check` names a fault; of others they have none."""


# --- one campaign ---------------------------------------------------------------------------------


def causes(headline):
    """Causes that a headline calls likely, with their sizes."""
    likely = re.search(r"\(likely: (.*)\)", headline)
    if not likely:
        return []
    text = re.sub(r"^one of these, [^:]*: ", "", likely[1])
    return [cause.strip(" ;") for cause in re.findall(r"(.+?) explains \d+ %", text)]


def findings(program, folder):
    """Sentences that `campaign check` marks."""
    code, output, _, _ = program.run("campaign", "check", "campaign.toml", folder=folder)
    if code:
        raise CampaignError(output)
    return [line[2:] for line in output.splitlines() if line.startswith("! ")]


def guess(program, folder):
    """Read a start off the logs, which a fit without a current asks for; options of `fit`."""
    code, output, _, _ = program.run("guess", "campaign.toml", folder=folder)
    if code:
        raise CampaignError(output)
    return "--from", "start.toml", "--setup", "setup.toml"


def campaign(program, fault, axis, rate, seed, folder):
    """Record of a campaign with a fault or fewer instruments: what a user gets of it."""
    change = FAULTS.get(fault) or FEWER[fault]
    sound = draws.drawn_equipment(axis, seed, rate)
    equipment = change(sound)
    truth = logger.write_campaign(equipment, folder)
    record = {"unseen": unseen(change, sound), "cpu_init": draft(program, truth, folder)}
    record["check"] = findings(program, folder)
    try:
        record["guessed"] = equipment.ammeter is None
        words = guess(program, folder) if record["guessed"] else ()
        record |= fit(program, truth, folder, *words)
    except CampaignError as error:
        return record | {"grade": "refused", "exit": 2, "headline": " ".join(str(error).split())}
    record["causes"] = causes(record["headline"])
    record["new"] = predicted(program, folder, truth, condition=equipment.steady)
    return record


def fault_items(faults, axes, campaigns, sound, first):
    """Campaigns of faults from a first seed on; the first seeds of all faults first."""
    return [
        {"fault": fault, "axis": axis, "rate": RATE, "seed": first + n}
        for n in range(max(campaigns, sound))
        for fault in faults
        for axis in axes
        if n < (sound if fault == "none" else campaigns)
    ]


def fewer_items(axes, campaigns):
    """Campaigns with fewer instruments: of those that have a tacho, at two rates."""
    items = []
    for rate, key in FEWER_RATES.items():
        first, last = draws.LEVELS["seeds"][key]
        for axis in axes:
            seeds = [seed for seed in range(first, last + 1) if draws.drawn_tacho(axis, seed)]
            items += [
                {"fault": fewer, "axis": axis, "rate": rate, "seed": seed}
                for seed in seeds[:campaigns]
                for fewer in FEWER
            ]
    return items


# --- classes --------------------------------------------------------------------------------------


def beyond(record, sound):
    """Error in new maneuvers [% of range] and of a value [half widths] beyond a sound campaign's.

    Of each maneuver and each value the difference is taken, and the largest counts.
    """
    prediction = max(record["new"][name] - sound["new"][name] for name in new_names())
    misses = {row["name"]: miss(row) for row in sound["estimates"]}
    values = [
        value - misses[row["name"]]
        for row in record["estimates"]
        if (value := miss(row)) is not None and misses.get(row["name"]) is not None
    ]
    return prediction, max(values, default=None)


def judged(records):
    """Records with "class" and what it rests on, "beyond"; those without a sound one left out."""
    key = ("axis", "rate", "seed")
    sound = {
        tuple(record[name] for name in key): record
        for record in records
        if record["fault"] == "none" and "new" in record
    }
    rows = []
    for record in records:
        other = sound.get(tuple(record[name] for name in key))
        if record["fault"] not in FAULTS or other is None or "error" in record:
            continue
        row = dict(record)
        row["named"] = named(record)
        if "new" not in record:
            row["beyond"], row["class"] = (None, None), "-"
        else:
            row["beyond"] = beyond(record, other)
            row["class"] = class_of(row)
        rows.append(row)
    return rows


def class_of(row):
    """Class of a fault in a campaign."""
    if row["unseen"]:
        return "A"
    limits = draws.LEVELS["faults"]["matters"]
    prediction, value = row["beyond"]
    if prediction > limits["prediction"] or (value is not None and value > limits["value"]):
        return "B"
    return "C"


def named(record):
    """Where a fault is named: in the "verdict", by "check", among what is "assumed", or ""."""
    words = NAMES.get(record["fault"])
    if words is None:
        return ""
    texts = {
        "verdict": record["headline"],
        "check": " ".join(record["check"]),
        "assumed": " ".join(record.get("assumed", ())),
    }
    return next((place for place, text in texts.items() if re.search(words, text)), "")


# --- tables ---------------------------------------------------------------------------------------

HEAD = (
    "fault",
    "axis",
    "class",
    "check, findings",
    "verdict of fit",
    "exit code",
    "headline claims, %",
    "error on new, %",
    "worst value, half widths",
    "named",
    "likely cause",
)


def shares(values):
    """Values with how often each is there, if they differ."""
    counts = Counter(value or "-" for value in values)
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{value} ({count})" for value, count in counts.most_common())


def fault_row(fault, axis, rows):
    """Cells of `HEAD` for the campaigns of a fault and an axis; numbers are medians."""
    done = [row for row in rows if "new" in row]
    first = [re.sub(r" by [+-].*", "", row["causes"][0]) for row in done if row["causes"]]
    return (
        fault,
        axis,
        shares(row["class"] for row in rows),
        number([len(row["check"]) for row in rows]),
        shares(row["grade"] for row in rows),
        shares(str(row["exit"]) for row in rows),
        number([row["claim"] for row in done]),
        number([max(row["new"].values()) for row in done]),
        number([max(map(miss_or_zero, row["estimates"]), default=0.0) for row in done]),
        shares(row["named"] for row in rows),
        shares(first) if first else "-",
    )


def miss_or_zero(row):
    """Miss of an estimate; 0 where an end of its interval is missing."""
    return miss(row) or 0.0


def print_faults(records):
    """The table of the faults, and what it says as a whole."""
    rows = judged(records)
    groups = {}
    for row in rows:
        groups.setdefault((row["fault"], row["axis"]), []).append(row)
    table = [
        fault_row(*key, groups[key])
        for key in ((fault, axis) for fault in FAULTS for axis in draws.AXES)
        if key in groups
    ]
    print_table(HEAD, table)
    print_verdicts(rows)


GRADES = ("Usable", "Usable for prediction", "Not usable", "refused")


def print_verdicts(rows):
    """How many campaigns of each class have each verdict, and predict worse than it lets expect."""
    limit = draws.LEVELS["faults"]["matters"]["prediction"]
    table = []
    for name in ("sound", "A", "B", "C", "-"):
        some = [
            row
            for row in rows
            if (name == "sound") == (row["fault"] == "none") and name in {"sound", row["class"]}
        ]
        if some:
            counts = Counter(row["grade"] for row in some)
            far = [row for row in some if row["exit"] == 0 and max(row["new"].values()) > limit]
            table.append((name, len(some), *(counts[grade] for grade in GRADES), len(far)))
    print_table(
        ("class", "campaigns", *GRADES, f"exit code 0, but error on new above {limit:g} %"), table
    )


FEWER_HEAD = (
    "axis",
    "rate, Hz",
    "instruments",
    "campaigns",
    "verdict of fit",
    "error on new, median, largest, %",
    "intervals",
    "that hold the truth",
    "half width, median %",
    "not held in most campaigns",
)


def print_fewer(records):
    """The table of campaigns with fewer instruments."""
    groups = {}
    for record in records:
        if record["fault"] in FEWER and "error" not in record:
            key = record["axis"], record["rate"], record["fault"]
            groups.setdefault(key, []).append(record)
    table = []
    order = list(FEWER)
    for axis, rate, fewer in sorted(groups, key=lambda key: (key[0], -key[1], order.index(key[2]))):
        some = groups[axis, rate, fewer]
        done = [record for record in some if "new" in record]
        # values beside a guessed amplifier are in its units
        intervals = with_interval([record for record in done if not record["guessed"]])
        errors = [max(record["new"].values()) for record in done]
        missed = Counter(row["name"] for row in intervals if not holds(row))
        often = [name for name, count in missed.items() if 2 * count > len(done)]
        table.append((
            axis, f"{rate:g}", fewer, len(some), shares(record["grade"] for record in some),
            f"{number(errors)}, {number(errors, max)}", len(intervals),
            sum(map(holds, intervals)), number(map(half_width, intervals)),
            ", ".join(often) or "-",
        ))  # fmt: skip
    if table:
        print_table(FEWER_HEAD, table)


def main():
    """Run what is missing in the file, print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    axes = ("hoist", "slew")
    parser.add_argument("--axis", nargs="+", choices=axes, default=axes)
    parser.add_argument("--fault", nargs="+", choices=FAULTS, default=list(FAULTS))
    parser.add_argument("--campaigns", type=int, default=2, help="of each fault")
    parser.add_argument("--sound", type=int, default=10, help="without a fault")
    parser.add_argument("--fewer", action="store_true", help="fewer instruments instead of faults")
    parser.add_argument(
        "--development", action="store_true", help="seeds that nothing is quoted of"
    )
    parser.add_argument("--python", default=sys.executable, help="executable with swashplate")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=FOLDER / "build" / "faults.jsonl")
    parser.add_argument("--keep", type=Path, help="folder in which logs and fits stay")
    parser.add_argument("--report", type=Path, help="print the tables of this file; run nothing")
    parser.add_argument("--judged", type=Path, help="write the records with their classes here")
    arguments = parser.parse_args()
    path = arguments.report or arguments.out
    if arguments.report is None:
        path.parent.mkdir(parents=True, exist_ok=True)
        if arguments.fewer:
            items = fewer_items(arguments.axis, arguments.campaigns)
        else:
            seeds = draws.LEVELS["seeds"]
            first = seeds["development_from"] if arguments.development else seeds["at_512"][0]
            items = fault_items(
                arguments.fault, arguments.axis, arguments.campaigns, arguments.sound, first
            )
        program = Program(arguments.python)

        def work(item, folder):
            return campaign(program, **item, folder=folder)

        run_missing(work, missing(items, read(path)), arguments.jobs, path, arguments.keep)
    records = read(path)
    print_faults(records)
    print_fewer(records)
    if arguments.judged is not None:
        lines = [json.dumps(row) + "\n" for row in judged(records)]
        arguments.judged.write_text("".join(lines), "utf-8")
    for record in records:
        if "error" in record:
            last = " ".join(record["error"].split())[-300:]
            print(f"\nFailed: {record['fault']}, {record['axis']}, {record['seed']}: {last}")


if __name__ == "__main__":
    main()
