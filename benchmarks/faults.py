"""What the judgement says of campaigns with a fault: a row for each fault, on hoist and slew.

    .venv/bin/python benchmarks/faults.py [--campaigns 20] [--sound 100] [--axes hoist slew]

Each campaign draws a drive about the published one, puts one fault into the machine, its
instruments or its logs, is written to files, checked, fitted, judged and validated by the calls
that `swashplate campaign check`, `fit` and `validate` make. The true error is that of the fitted
drive on maneuvers that no campaign has, against the machine that was simulated.
"""

import argparse
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

# one core for each campaign: threads of the linear algebra would only wait for each other
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
from campaigns import read, run_missing

RATE = 512.0
NEW = {
    "hoist": ("stairs:-8:-5:-2:2:5:8", "multisine:6,0.05:0.6:5", "sine:5,0.5"),
    "slew": ("stairs:-5:-3:3:5", "multisine:5,0.03:0.4:5", "sine:5,0.5"),
}
"""Maneuvers that no campaign has; the true error is the largest of theirs."""
HELD_OUT = {
    "hoist": ("step +6.5 V", "step -6.5 V", "sine 6.5 V 0.1 Hz"),
    "slew": ("sine 4 V 0.1 Hz",),
}
COUNTS_PER_TURN = {"hoist": 400.0 * 120.0 / 19.0, "slew": 81_000.0 * 7.0}
LATE = 10
"""Samples by which stamps are shifted: 19.5 ms."""


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong with a campaign."""

    machine: dict | None = None
    """Refinements of the machine that was simulated."""
    scaled: dict | None = None
    """Factors on parameters of it."""
    instruments: dict | None = None
    """Errors of the instruments, beside the realistic ones."""
    drift: float = 0.0
    """Share by which the machine's speed changes over the campaign's runs."""
    logs: Callable | None = None
    """Changes the columns of a run, a dictionary, in place; given the run's name too."""
    missing: tuple[str, ...] = ()
    """Words that the names of runs contain which are not there."""
    edges: float = 1.0
    """Counts in a turn over those that the campaign file states."""
    foreign: str = ""
    """A run that is of another axis."""


def shifted(values, samples):
    """Values that come later by a number of samples; earlier, for a negative one."""
    place = np.clip(np.arange(values.size) - samples, 0, values.size - 1)
    return values[place]


def encoder_late(columns, name):
    columns["counts"] = shifted(columns["counts"], LATE)


def command_late(columns, name):
    columns["voltage"] = shifted(columns["voltage"], LATE)


def clipped_ammeter(columns, name):
    columns["current"] = np.minimum(columns["current"], 0.45)


def clipped_ammeter_of_slew(columns, name):
    columns["current"] = np.minimum(columns["current"], 0.2)


def slow_counter(share):
    """An encoder that loses edges above a part of the run's largest speed over all runs."""

    def change(columns, name):
        counts = columns["counts"]
        steps = np.diff(counts)
        apart = np.diff(columns["time"])
        # a mean over 32 samples: an encoder of few edges moves by 0 or 1 a sample
        speed = np.convolve(steps / apart, np.ones(32) / 32.0, "same")
        most = share * LARGEST[round(columns["time"].size > 0)]
        kept = np.clip(speed, -most, most)
        columns["counts"] = np.floor(counts[0] + np.concatenate([[0.0], np.cumsum(kept * apart)]))

    return change


LARGEST = {1: 0.0}
"""Largest speed of the encoder in the campaign at hand. [count/s]"""

FAULTS = {
    "none": Fault(),
    "run of another axis": Fault(foreign="ramp"),
    "spool friction": Fault(
        machine={"spool_friction": 0.115, "spool_presliding": 5e-5, "dither_time": 0.6}
    ),
    "leakage under load, 10 % of the speed": Fault(machine={"leakage": 0.10}),
    "load, 2 % of the speed": Fault(machine={"leakage": 0.02}),
    "drift of 8 % over the campaign": Fault(drift=0.08),
    "encoder 20 ms late": Fault(logs=encoder_late),
    "ammeter clipped": Fault(logs=clipped_ammeter),
    "delay 20 ms longer than held": Fault(machine={"tau": 0.020}),
    "runs missing": Fault(missing=("-",)),
    "encoder reads 3 % too much": Fault(edges=1.03),
    "ammeter reads 3 % too much": Fault(instruments={"current_gain_error": 0.03}),
    "command's stamps 20 ms late": Fault(logs=command_late),
    "encoder loses counts above 70 % of the top speed": Fault(logs=slow_counter(0.7)),
    "supply pressure 20 % low": Fault(scaled={"Z9": 0.8}),
    "command read back with 8 bits": Fault(instruments={"voltage_bits": 8}),
    "play of 0.2 degrees before the encoder": Fault(instruments={"backlash": 0.0035}),
}


def simulated_campaign(fault, axis, seed):
    """Logs of a campaign with a fault, and the machine that was simulated."""
    from swashplate import Drive
    from swashplate.campaign import rig
    from swashplate.identification.fitting import drawn
    from swashplate.identification.setup import load_setup
    from swashplate.maneuvers import source_tests

    nominal = Drive.preset(axis)
    machine = drawn(nominal, load_setup(axis), seed)
    if fault.scaled:
        machine = machine.scale(**fault.scaled)
    if fault.machine:
        change = dict(fault.machine)
        if "leakage" in change:
            lost = change.pop("leakage") * abs(machine.steady_speed(9.0))
            change |= {"load_torque": 30e3, "motor_leakage": lost / 30e3}
        if "tau" in change:
            change["tau"] += machine.parameters.numbers["tau"]
        machine = machine.replace(**change)
    tools = replace(rig.SEVERITIES["realistic"], **(fault.instruments or {}))
    tests = source_tests(axis)
    held = HELD_OUT[axis]
    kept = {n: m for n, m in tests.items() if not any(word in n for word in fault.missing)}
    held = [name for name in held if name in kept]

    def run(drive, some, turn=None):
        return rig.run(
            nominal, some, truth=drive, seed=seed, instruments=tools, axis=axis,
            validate=[name for name in held if name in some], counts_per_turn=turn,
        )  # fmt: skip

    stated = COUNTS_PER_TURN[axis]
    made = replace(run(machine, kept, stated * fault.edges), counts_per_turn=stated)
    runs = dict(made.runs)
    if fault.drift:
        for place, (name, maneuver) in enumerate(kept.items()):
            factor = 1.0 + fault.drift * (place / (len(kept) - 1) - 0.5)
            runs[name] = run(machine.scale(Z10=factor), {name: maneuver}).runs[name]
    if fault.foreign:
        other = Drive.preset("slew" if axis == "hoist" else "hoist")
        name = next(n for n in runs if n.startswith(fault.foreign) and n not in held)
        turn = COUNTS_PER_TURN[other.name]
        runs[name] = replace(run(other, {name: kept[name]}, turn).runs[name], role="fit")
    if fault.logs is not None:
        LARGEST[1] = max(
            float(np.abs(np.diff(each.columns["counts"][::32])).max()) * RATE / 32.0
            for each in runs.values()
        )
        for name, each in runs.items():
            columns = {key: values.copy() for key, values in each.columns.items()}
            change = fault.logs
            if change is clipped_ammeter and axis == "slew":
                change = clipped_ammeter_of_slew
            change(columns, name)
            runs[name] = replace(each, columns=columns)
    return replace(made, runs=runs), machine


def true_error(found, machine, axis):
    """Largest error of the shaft's speed on new maneuvers, in per cent of its range."""
    from swashplate import Drive
    from swashplate.maneuvers import parse

    worst = 0.0
    for words in NEW[axis]:
        command = parse(words).sample(RATE)
        true = machine.simulate(command, RATE).shaft_speed
        error = Drive(found).simulate(command, RATE).shaft_speed - true
        worst = max(worst, float(np.sqrt(np.mean(error**2)) / np.ptp(true)))
    return 100.0 * worst


HIDDEN = {
    "encoder reads 3 % too much": "scale of counts",
    "ammeter reads 3 % too much": "scale of current",
    "command's stamps 20 ms late": "time stamps of the command",
}
"""Faults of instruments, and how `lack_of_fit` calls them."""
FIELDS = (
    "fault",
    "axis",
    "seed",
    "check",
    "grade",
    "code",
    "ratio",
    "cause",
    "error",
    "worst",
    "class",
    "validate",
)


def campaign(_, item):
    """One row: what check, fit and validate say of a campaign, and how wrong the fit is."""
    name, axis, seed = item
    from swashplate import Campaign, Drive
    from swashplate.campaign import rig
    from swashplate.errors import SwashplateError
    from swashplate.identification.criteria import verdict
    from swashplate.identification.data_checks import check_runs
    from swashplate.identification.drive_model import true_value
    from swashplate.identification.fitting import fit, smooth
    from swashplate.identification.misfit import lack_of_fit
    from swashplate.identification.setup import load_setup
    from swashplate.identification.validation import predict

    fault, nominal = FAULTS[name], Drive.preset(axis)
    tests, machine = simulated_campaign(fault, axis, seed)
    with tempfile.TemporaryDirectory() as folder:
        read = Campaign.from_toml(rig.write(tests, Path(folder) / "virtual"))
        runs, held = read.select(role="fit"), read.select(role="validate")
    try:
        found = len(check_runs(runs, smooth(nominal.parameters)))
        result = fit(nominal.parameters, runs, load_setup(axis), threads=1)
    except SwashplateError as error:
        return [(name, axis, seed, "refused", "Not usable", 2, "", str(error), "", "", "B", "")]
    stages, drive = result.stages, result.parameters
    predicted = predict(drive, held)
    judged = verdict(stages, predicted, planned=[s.name for s in result.setup.stages])
    misfit = lack_of_fit(stages)
    worst = 0.0
    for each in stages:
        problem = each.problem
        for unknown, estimate in zip(problem.unknowns, each.uncertainty.estimates, strict=True):
            true = true_value(unknown, problem.model, machine.parameters)
            if true is not None and estimate.lower is not None and estimate.upper is not None:
                half = 0.5 * (estimate.upper - estimate.lower)
                worst = max(worst, abs(true - estimate.value) / half)
    error = true_error(drive, machine, axis)
    known = misfit.fault(HIDDEN.get(name, ""))
    fixed = any(symbol in misfit.units for symbol in fault.scaled or ())
    if fixed or (known is not None and known.hidden and known.outside < 0.01):
        kind = "A"
    else:
        kind = "B" if error > 3.0 or worst > 3.0 else "C"
    ratio = max(misfit.ratios.values(), default="")
    cause = misfit.causes[0].name if misfit.causes and ratio > 1.2 else ""
    code = 0 if judged.usable else 1
    alone = verdict((), predicted)
    validated = "predicts" if alone.usable else alone.grade
    row = (
        name, axis, seed, f"{found} findings" if found else "-", judged.grade, code, ratio, cause,
        error, worst, kind, validated,
    )  # fmt: skip
    return [row]


def most(rows, field):
    """The commonest entry of a column, and its share where it is not alone."""
    values = [row[field] for row in rows]
    common = max(set(values), key=values.count)
    share = values.count(common) / len(values)
    return f"{common or '-'}{'' if share == 1.0 else f' ({share:.0%})'}"


def report(rows):
    """A row for each fault and axis."""
    heads = (
        "fault", "axis", "campaigns", "class", "check", "verdict of fit", "exit code",
        "residual / known error", "likely cause named", "validate", "error on new, %",
        "worst value, half widths",
    )  # fmt: skip
    print(f"| {' | '.join(heads)} |")
    print("|---|---|--:|---|---|---|---|--:|---|---|--:|--:|")
    for name in FAULTS:
        for axis in NEW:
            some = [row for row in rows if row["fault"] == name and row["axis"] == axis]
            if not some:
                continue
            numbers = []
            for field in ("ratio", "error", "worst"):
                known = [float(row[field]) for row in some if row[field]]
                numbers.append(f"{median(known):.3g}" if known else "-")
            cells = (
                name, axis, f"{len(some)}", most(some, "class"), most(some, "check"),
                most(some, "grade"), most(some, "code"), numbers[0], most(some, "cause"),
                most(some, "validate"), numbers[1], numbers[2],
            )  # fmt: skip
            print(f"| {' | '.join(cells)} |")
    sound = [row for row in rows if row["fault"] == "none"]
    if sound:
        false = [row for row in sound if row["grade"] != "Usable"]
        wrong = [row for row in false if float(row["error"]) > 0.05]
        print(
            f"\nFalse alarms: {len(false)} of {len(sound)} sound campaigns, in {len(wrong)} of "
            "them the search ended in another optimum (error on new maneuvers above 0.05 %)."
        )


def main():
    """Run what is missing in the file, write it, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--axes", nargs="+", default=["hoist", "slew"])
    parser.add_argument("--campaigns", type=int, default=50, help="of each fault")
    parser.add_argument("--sound", type=int, default=1000, help="without a fault, on each axis")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("benchmarks/build/faults.csv"))
    wanted = parser.parse_args()
    wanted.out.parent.mkdir(parents=True, exist_ok=True)
    kept = read(wanted.out)
    done = {(row["fault"], row["axis"], int(row["seed"])) for row in kept}
    todo = [
        (name, axis, seed)
        for seed in range(max(wanted.campaigns, wanted.sound))
        for axis in wanted.axes
        for name in FAULTS
        if seed < (wanted.sound if name == "none" else wanted.campaigns)
        and (name, axis, seed) not in done
    ]
    run_missing(campaign, todo, wanted.jobs, wanted.out, FIELDS)
    report(read(wanted.out))


if __name__ == "__main__":
    main()
