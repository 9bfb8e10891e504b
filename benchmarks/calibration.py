"""How often 95 % intervals hold the truth, over many virtual campaigns.

    .venv/bin/python benchmarks/calibration.py [--campaigns 400] [--wrong 40] [--out FILE.csv]

Each campaign draws a drive about the published one, logs the source's tests of it through imperfect
instruments, is written to files, read, fitted from the published values, and judged, all by the
same calls as `swashplate rig` and `swashplate fit` make. Besides the right model with realistic
instruments stand cases in which the model is wrong: there nothing is promised.
"""

import argparse
import csv
import math
import os
import sys
import tempfile
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from statistics import median

# one core for each campaign: threads of the linear algebra would only wait for each other
os.environ["OPENBLAS_NUM_THREADS"] = "1"

STICTION = {"spool_friction": 0.115, "spool_presliding": 5e-5, "dither_time": 0.6}
CAM_RIPPLE = 0.02
BACKLASH = 0.002
"""Sizes of what the fitted model lacks: a hoist's overshoot of 4 % at 4 V; a share; rad."""
CASES = ("realistic", "harsh", "stiction", "cam ripple", "backlash")
FIELDS = ("case", "seed", "stage", "unknown", "truth", "estimate", "lower", "upper", "status")


def campaign(case, seed, axis):
    """Rows of one campaign: an unknown each, with its truth, its estimate and its interval."""
    from swashplate import Campaign, Drive
    from swashplate.campaign import rig
    from swashplate.identification.assessment import assess
    from swashplate.identification.fitting import fit
    from swashplate.identification.setup import load_setup
    from swashplate.identification.staging import drawn, true_value

    setup, nominal = load_setup(axis), Drive.preset(axis)
    truth = drawn(nominal, setup, seed)
    options = {
        "realistic": {},
        "harsh": {"severity": "harsh"},
        "stiction": {"truth": truth.replace(**STICTION)},
        "cam ripple": {"truth": truth.replace(cam_ripple=CAM_RIPPLE)},
        "backlash": {"instruments": replace(rig.SEVERITIES["realistic"], backlash=BACKLASH)},
    }[case]
    tests = rig.run(axis, **{"truth": truth, "seed": seed, **options})
    with tempfile.TemporaryDirectory() as folder:
        read = Campaign.from_toml(rig.write(tests, Path(folder) / "virtual"))
        runs = read.select(role="fit")
    rows = []
    for each in assess(fit(nominal.parameters, runs, setup, threads=1).stages):
        problem = each.stage.problem
        for unknown, estimate in zip(problem.unknowns, each.uncertainty.estimates, strict=True):
            true = true_value(unknown, problem.model, truth.parameters)
            if true is not None:
                numbers = (true, estimate.value, estimate.lower, estimate.upper, estimate.status)
                rows.append((case, seed, each.stage.stage.name, unknown.name, *numbers))
    return rows


def ends(row):
    """Both ends of an interval, infinite where there is none; None for no interval at all."""
    if not row["lower"] and not row["upper"]:
        return None
    return float(row["lower"] or -math.inf), float(row["upper"] or math.inf)


def summary(rows):
    """Unknowns with an interval, how many hold the truth, and those without one."""
    told = [(ends(row), float(row["truth"])) for row in rows if ends(row)]
    held = sum(low <= truth <= high for (low, high), truth in told)
    return len(told), held, len(rows) - len(told)


def table(rows, case):
    """Coverage of each unknown in one case, as Markdown."""
    heads = ("stage", "unknown", "intervals", "hold the truth", "median error, %", "half width, %")
    print(f"| {' | '.join(heads)} |")
    print("|---|---|--:|--:|--:|--:|")
    named = defaultdict(list)
    for row in rows:
        if row["case"] == case:
            named[row["stage"], row["unknown"]].append(row)
    for (stage, name), some in named.items():
        count, inside, _ = summary(some)
        both = [row for row in some if row["lower"] and row["upper"]]
        errors = [abs(100.0 * (float(r["estimate"]) / float(r["truth"]) - 1.0)) for r in some]
        widths = [
            50.0 * (float(r["upper"]) - float(r["lower"])) / abs(float(r["truth"])) for r in both
        ]
        share = 100.0 * inside / count if count else math.nan
        print(
            f"| {stage} | {name} | {count} | {share:.1f} % | {median(errors):.2g} | "
            f"{median(widths):.2g} |"
        )


def report(rows):
    """Pooled coverage of each case, then the unknowns of the right model."""
    print("| case | campaigns | intervals | hold the truth | without interval |")
    print("|---|--:|--:|--:|--:|")
    for case in CASES:
        some = [row for row in rows if row["case"] == case]
        if some:
            count, inside, without = summary(some)
            seeds = len({row["seed"] for row in some})
            share = 100.0 * inside / count if count else math.nan
            print(f"| {case} | {seeds} | {count} | {share:.1f} % | {without} |")
    print()
    table(rows, CASES[0])


def main():
    """Run what is missing in the file, write it, print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--axis", default="hoist")
    parser.add_argument("--campaigns", type=int, default=400, help="of the right model")
    parser.add_argument("--wrong", type=int, default=40, help="of each case with a wrong one")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("benchmarks/build/calibration.csv"))
    wanted = parser.parse_args()
    wanted.out.parent.mkdir(parents=True, exist_ok=True)
    kept = read(wanted.out)
    done = {(row["case"], int(row["seed"])) for row in kept}
    todo = [
        (case, seed)
        for case in CASES
        for seed in range(wanted.campaigns if case == CASES[0] else wanted.wrong)
        if (case, seed) not in done
    ]
    begun = time.perf_counter()
    with (
        wanted.out.open("a", newline="") as stream,
        ProcessPoolExecutor(wanted.jobs, mp_context=get_context("spawn")) as pool,
    ):
        writer = csv.writer(stream)
        if not kept:
            writer.writerow(FIELDS)
        futures = [pool.submit(campaign, case, seed, wanted.axis) for case, seed in todo]
        for number, future in enumerate(as_completed(futures), 1):
            writer.writerows(future.result())
            stream.flush()
            spent = time.perf_counter() - begun
            left = spent / number * (len(todo) - number)
            print(f"\r{number} of {len(todo)}, {left:.0f} s left ", end="", file=sys.stderr)
    print(file=sys.stderr)
    report(read(wanted.out))
    print(f"\n{len(todo)} campaigns in {time.perf_counter() - begun:.0f} s.")


def read(path):
    """Rows that were written before."""
    if not path.exists():
        return []
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


if __name__ == "__main__":
    main()
