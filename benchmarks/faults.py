"""What the verdict says of campaigns with a fault, and of fewer instruments, as a user works.

    .venv/bin/python benchmarks/faults.py [--campaigns 2] [--sound 10] [--axis hoist slew]
    .venv/bin/python benchmarks/faults.py --fewer [--campaigns 2]
    .venv/bin/python benchmarks/faults.py --report FILE.jsonl [--judged JUDGED.jsonl]

Each campaign is logged by the machine of `second_machine`, which shares no line with swashplate,
with one fault in the machine, its instruments or its logs. `swashplate campaign init` drafts the
file, the runs that are held out get their role, nothing else is corrected; `campaign check` and
`fit` say what they say. The fitted drive's speed is compared with the faulty machine's in maneuvers
that no campaign has, by class of motion with what the verdict states, and its values with the
machine's.

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
from statistics import median

from command_line import CampaignError, Program, draft, fit, new_names, predicted
from records import (
    half_width,
    has_own_hysteresis,
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
from second_machine.faults import FAULTS, FEWER, applies, unseen
from statements import in_new_maneuvers

FOLDER = Path(__file__).parent
RATE = 512.0
FEWER_RATES = {512.0: "at_512", 50.0: "at_50"}
"""Rates of the campaigns with fewer instruments, and their seeds in levels.toml. [Hz]"""
LATE = r"^(time stamps of \w+|lag of the command|tau)$"
"""What all instruments see alike: a late command, or a machine that answers late."""
RESISTED = r"^loss of speed under a load that resists"
ONE_RUN = r"sine_4_V_0.1_Hz"
NAMES = {
    "run of another axis": r"ramp_\+1_V",
    "spool friction": r"^solenoid_hysteresis$",
    "leakage under load, 10 % of the top speed": RESISTED,
    "leakage under load, 2 % of the top speed": RESISTED,
    "drift of 8 % over the campaign": r"^drift of (encoder_counts|shaft_speed)",
    "encoder 20 ms late": r"^time stamps of encoder_counts$",
    "ammeter clipped": r"rectified_current.* clipped",
    "delay 20 ms longer than stated": LATE,
    "encoder reads 3 % too much": r"scale of encoder_counts",
    "ammeter reads 3 % too much": r"scale of rectified_current",
    "command's stamps 20 ms late": LATE,
    "supply pressure 20 % low": r"\bZ9\b",
    "one run late by 0.2 s": ONE_RUN,
    "one run of an encoder that slips by 5 %": ONE_RUN,
    "one run reversed": ONE_RUN,
    "one run without counts": ONE_RUN,
    "weak dither": r"^solenoid_hysteresis$",
    "cold oil, orifices 20 % less at first": r"^drift of (encoder_counts|shaft_speed)",
    "load in every second run": RESISTED,
    "ammeter of 5 Hz": r"^(lag|time stamps) of rectified_current$",
    "command reads 2 % too much": r"^scale of the command$",
}
"""Words by which a verdict names a fault, as cause, as unsound data or as assumed; of others it has
none."""
UNSOUND = (
    "run of another axis",
    "ammeter clipped",
    "one run late by 0.2 s",
    "one run of an encoder that slips by 5 %",
    "one run reversed",
    "one run without counts",
)
"""Faults after which the data are not sound."""


# --- one campaign ---------------------------------------------------------------------------------


def findings(program, folder):
    """Sentences that `campaign check` marks."""
    code, output, _, _ = program.run("campaign", "check", "campaign.toml", folder=folder)
    if code:
        raise CampaignError(output)
    return [line[2:] for line in output.splitlines() if line.startswith("! ")]


def run_name(axis, run):
    """Name of a run in a drafted campaign."""
    return Path(logger.file_name(axis, run)).stem


def campaign(program, fault, axis, rate, seed, folder):
    """Record of a campaign with a fault or fewer instruments: what a user gets of it."""
    change = FAULTS.get(fault) or FEWER[fault]
    sound = draws.drawn_equipment(axis, seed, rate)
    equipment = change(sound)
    truth = logger.write_campaign(equipment, folder)
    record = {"unseen": unseen(change, sound), "cpu_init": draft(program, truth, folder)}
    record["check"] = findings(program, folder)
    record["guilty"] = [run_name(axis, run) for run in equipment.elsewhere]
    try:
        record |= fit(program, truth, folder)
    except CampaignError as error:
        said = " ".join(str(error).split())
        refused = {"usable": False, "exit": error.code, "headline": said, "unsound": [said]}
        runs = [run_name(axis, run) for run in equipment.conditions]
        blamed = [run for run in runs if re.search(rf"{re.escape(run)}\b", said)]
        return record | refused | {"blamed": blamed, "causes": []}
    widths = [condition.hysteresis for condition in equipment.conditions.values()]
    record["own_hysteresis"] = 0.5 * max(widths)
    record["statements"] = in_new_maneuvers(folder, equipment, record)
    record["new"] = predicted(program, folder, truth, condition=equipment.steady)
    return record


def fault_items(faults, axes, campaigns, sound, first, rate=RATE):
    """Campaigns of faults from a first seed on; the first seeds of all faults first."""
    return [
        {"fault": fault, "axis": axis, "rate": rate, "seed": first + n}
        for n in range(max(campaigns, sound))
        for fault in faults
        for axis in axes
        if n < (sound if fault == "none" else campaigns) and applies(fault, axis)
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


def is_right(record):
    """Whether a cause is the fault, or the hysteresis that the machine has, to half of it."""
    return named(record) == "cause" or has_own_hysteresis(record)


def named(record):
    """Where a fault is named: as a "cause", as "unsound", among what is "assumed", or ""."""
    words = NAMES.get(record["fault"])
    if words is None:
        return ""
    places = {
        "cause": record["causes"],
        "unsound": record["unsound"],
        "assumed": record.get("assumed", ()),
    }
    return next(
        (place for place, texts in places.items() if any(re.search(words, each) for each in texts)),
        "",
    )


# --- tables ---------------------------------------------------------------------------------------

VERDICTS = (
    "campaigns",
    "exit code",
    "unsound",
    "cause named",
    "right",
    "wrong",
    "statements",
    "hold, %",
    "stated over true, median",
    "below half, %",
)
HEAD = (
    *("fault", "axis", "class", "check, findings", *VERDICTS),
    *("error on new, %", "worst value, half widths", "named", "sound runs blamed"),
)


def verdict_cells(rows):
    """Cells of `VERDICTS` for some campaigns."""
    causes = [row for row in rows if row["causes"]]
    right = sum(map(is_right, causes))
    ratios = [
        each["stated"] / each["true"]
        for row in rows
        for each in row.get("statements", ())
        if each["stated"] is not None
    ]
    return (
        len(rows),
        shares(str(row["exit"]) for row in rows),
        sum(bool(row["unsound"]) for row in rows),
        len(causes),
        right,
        len(causes) - right,
        len(ratios),
        percent(ratio >= 1.0 for ratio in ratios),
        f"{median(ratios):.2f}" if ratios else "-",
        percent(ratio < 0.5 for ratio in ratios),
    )


def percent(held):
    """Part of some that is true, in %."""
    held = list(held)
    return f"{100.0 * sum(held) / len(held):.1f}" if held else "-"


def shares(values):
    """Values with how often each is there, if they differ."""
    counts = Counter(value or "-" for value in values)
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{value} ({count})" for value, count in counts.most_common())


def fault_row(fault, axis, rows):
    """Cells of `HEAD` for the campaigns of a fault and an axis; numbers are medians."""
    done = [row for row in rows if "new" in row]
    return (
        fault,
        axis,
        shares(row["class"] for row in rows),
        number([len(row["check"]) for row in rows]),
        *verdict_cells(rows),
        number([max(row["new"].values()) for row in done]),
        number([max(map(miss_or_zero, row["estimates"]), default=0.0) for row in done]),
        shares(row["named"] for row in rows),
        ", ".join(run for row in rows for run in wrongly_blamed(row)) or "-",
    )


def wrongly_blamed(row):
    """Runs that a verdict calls unsound beside the guilty ones; none if a fault is in all runs."""
    one_by_one = row["fault"] == "none" or row["guilty"]
    return [run for run in row["blamed"] if one_by_one and run not in row["guilty"]]


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


def print_verdicts(rows):
    """What the verdicts say of sound campaigns, of unsound data, and of the other classes."""
    groups = {"sound": [row for row in rows if row["fault"] == "none"]}
    groups["data not sound"] = [row for row in rows if row["fault"] in UNSOUND]
    for name in "ABC-":
        groups[f"other faults of class {name}"] = [
            row for row in rows if row["class"] == name and row["fault"] not in {"none", *UNSOUND}
        ]
    table = [(name, *verdict_cells(some)) for name, some in groups.items() if some]
    print_table(("campaigns of", *VERDICTS), table)


FEWER_HEAD = (
    "axis",
    "rate, Hz",
    "instruments",
    *VERDICTS,
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
        intervals = with_interval(done)
        errors = [max(record["new"].values()) for record in done]
        missed = Counter(row["name"] for row in intervals if not holds(row))
        often = [name for name, count in missed.items() if 2 * count > len(done)]
        table.append((
            axis, f"{rate:g}", fewer, *verdict_cells(some),
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
    axes = ("hoist", "slew", "luff")
    parser.add_argument("--axis", nargs="+", choices=axes, default=axes)
    parser.add_argument("--fault", nargs="+", choices=FAULTS, default=list(FAULTS))
    parser.add_argument("--campaigns", type=int, default=2, help="of each fault")
    parser.add_argument("--sound", type=int, default=10, help="without a fault")
    parser.add_argument("--fewer", action="store_true", help="fewer instruments instead of faults")
    parser.add_argument(
        "--rate", type=float, choices=FEWER_RATES, default=RATE, help="of the logger, with faults"
    )
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
            first = seeds[FEWER_RATES[arguments.rate]][0]
            if arguments.development:
                first = seeds["development_from"]
            items = fault_items(
                arguments.fault,
                arguments.axis,
                arguments.campaigns,
                arguments.sound,
                first,
                arguments.rate,
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
