"""Whether the verdict names held-out runs whose logs are damaged, and no other.

    .venv/bin/python benchmarks/held_out.py [--axis hoist slew luff] [--first 11] [--campaigns 4]
    .venv/bin/python benchmarks/held_out.py --report FILE.jsonl

Each campaign is virtual tests of a machine whose parameters, fixed ones too, differ at random from
those that the fit begins with. It is fitted once, into `--keep`; the verdict is then reached again
on copies in which the log of one held-out run, or those of all, are damaged.

Every campaign is a line of JSON in `--out`, written as soon as it ends: what stands there already
is not run again.
"""

import argparse
import csv
import json
import shutil
import tempfile
from pathlib import Path

from records import missing, print_table, read

from swashplate import Campaign, Drive, Identification, identify, rig
from swashplate.identification import assess_fit, predict

AXES = ("hoist", "slew", "luff")
PERTURB = 0.1
"""Largest logarithm of the factors on what is simulated."""
SLOWER = 0.75
"""Z10 and J of another machine over those of the first."""
DROPOUT = 0.4
"""Time for which the counts read 0. [s]"""
COUNTS = "counts"
HEAD = (
    *("axis", "damage", "damaged runs", "campaigns", "named"),
    *("sound held-out runs named", "campaigns with a fitted run named", "usable"),
)


# --- one campaign ---------------------------------------------------------------------------------


def scaled(factor):
    """Damage: counts times a factor."""

    def damage(rows):
        for row in rows:
            row[COUNTS] = str(round(factor * float(row[COUNTS])))

    return damage


def dropped_out(rows):
    """Damage: counts of 0 for a while from where half of the way is done."""
    counts = [float(row[COUNTS]) for row in rows]
    half = 0.5 * max(map(abs, counts))
    first = next(k for k, value in enumerate(counts) if abs(value) > half)
    begin = float(rows[first]["time"])
    for row in rows:
        if begin <= float(row["time"]) < begin + DROPOUT:
            row[COUNTS] = "0"


DAMAGES = {
    "x 0.5": scaled(0.5),
    "x 0.7": scaled(0.7),
    "x 1.3": scaled(1.3),
    f"zeros for {DROPOUT:g} s": dropped_out,
}
OTHER = "log of another machine"


def spoil(path, damage):
    """Write a log again with its damage."""
    text = path.read_text("utf-8").splitlines()
    above = [line for line in text if line.startswith("#")]
    reader = csv.DictReader(line for line in text if not line.startswith("#"))
    rows = list(reader)
    damage(rows)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"{line}\n" for line in above)
        writer = csv.DictWriter(file, reader.fieldnames)
        writer.writeheader()
        writer.writerows(rows)


def fitted(axis, seed, folder):
    """The fit of a campaign, from its folder if it was done before."""
    if (folder / "fitted" / "fit.json").is_file():
        return Identification.load(folder / "fitted")
    shutil.rmtree(folder, ignore_errors=True)
    rig.write(rig.run(axis, seed=seed, perturb=PERTURB), folder)
    result = identify(folder / "campaign.toml", axis=axis)
    result.save(folder / "fitted")
    return result


def judged(result, held_out, damaged):
    """Who is named, and whether the fit is usable, after damage to some held-out runs."""
    predicted = predict(result.fit.parameters, held_out)
    verdict = assess_fit(result.fit, predicted)
    named = {finding.run for finding in verdict.unsound}
    names = {run.name for run in held_out}
    return {
        "held_out": len(names),
        "damaged": len(damaged),
        "named": len(named & set(damaged)),
        "others": sorted((named & names) - set(damaged)),
        "fitted": sorted(named - names),
        "usable": verdict.usable,
        "error": verdict.error.worst.error,
    }


def campaign(axis, seed, keep):
    """Judgements on a campaign, sound and with each damage of one and of all held-out runs."""
    folder = keep / f"{axis}-{seed}"
    result = fitted(axis, seed, folder)
    held_out = result.held_out
    names = [run.name for run in held_out]
    judgements = [{"damage": "none", "which": "-"} | judged(result, held_out, [])]
    with tempfile.TemporaryDirectory() as temporary:
        other = Path(temporary) / "other"
        slower = Drive.preset(axis).scale(Z10=SLOWER, J=SLOWER)
        rig.write(rig.run(axis, seed=seed + 1000, truth=slower), other)
        for damage in (*DAMAGES, OTHER):
            for which, damaged in {"one": names[:1], "all": names}.items():
                copy = Path(temporary) / "copy"
                shutil.rmtree(copy, ignore_errors=True)
                shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("fitted", "truth"))
                for name in damaged:
                    path = copy / f"{name}.csv"
                    if damage == OTHER:
                        shutil.copy(other / path.name, path)
                    else:
                        spoil(path, DAMAGES[damage])
                runs = Campaign.from_toml(copy / "campaign.toml")
                runs = runs.with_interpolation(axis, result.fit.runs[0].input.interpolation)
                of_role = runs.select(axis=axis, role="validate")
                judgement = judged(result, of_role, damaged)
                judgements.append({"damage": damage, "which": which} | judgement)
    return {"judgements": judgements}


# --- table ----------------------------------------------------------------------------------------


def print_judgements(records):
    """A row for each axis, damage, and one run or all: how often each damaged run was named."""
    groups = {}
    for record in records:
        for judgement in record["judgements"]:
            key = record["axis"], judgement["damage"], judgement["which"]
            groups.setdefault(key, []).append(judgement)
    rows = []
    for axis, damage, which in sorted(groups, key=lambda key: AXES.index(key[0])):
        some = groups[axis, damage, which]
        rows.append(
            (
                axis,
                damage,
                which,
                len(some),
                f"{sum(each['named'] for each in some)} of {sum(each['damaged'] for each in some)}",
                sum(len(each["others"]) for each in some),
                sum(bool(each["fitted"]) for each in some),
                sum(each["usable"] for each in some),
            )
        )
    print_table(HEAD, rows)


def main():
    """Run the campaigns that are missing, or print the table of a file."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--axis", nargs="+", choices=AXES, default=AXES)
    parser.add_argument("--first", type=int, default=11, help="first seed")
    parser.add_argument("--campaigns", type=int, default=4, help="of each axis")
    parser.add_argument("--keep", type=Path, default=Path("held_out"), help="folder of the fits")
    parser.add_argument("--out", type=Path, default=Path("held_out.jsonl"))
    parser.add_argument("--report", type=Path, help="print the table of this file, run nothing")
    options = parser.parse_args()
    if options.report is None:
        items = [
            {"axis": axis, "seed": options.first + number}
            for number in range(options.campaigns)
            for axis in options.axis
        ]
        for item in missing(items, read(options.out)):
            record = item | campaign(**item, keep=options.keep)
            with options.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(record) + "\n")
    print_judgements(read(options.report or options.out))


if __name__ == "__main__":
    main()
