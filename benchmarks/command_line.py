"""A campaign of the second machine by the command line of an installation, as a user works."""

import csv
import json
import math
import os
import re
import subprocess
import tempfile
import tomllib
from pathlib import Path
from threading import Timer

import numpy as np
from second_machine import draws, logger

HYSTERESIS = "solenoid_hysteresis"
"""Cause that every second machine has a little of."""
DEVIATIONS = 1.96
"""Half width of a 95 % interval, in standard deviations."""
LONGEST = 600.0
"""After which a command is ended by default, and the campaign counted as failed. [s]"""


class Program:
    """The swashplate of a Python executable, by its command line.

    With one thread of the linear algebra, or as many as that takes by itself. A command is ended
    after its longest time. [s]
    """

    def __init__(self, python, one_thread=True, longest=LONGEST):
        self.python, self.longest = python, longest
        self.environment = {
            **os.environ,
            "COLUMNS": "1000",  # no sentence is broken into lines
            "NO_COLOR": "1",
        }
        # without byte code every command compiles the package's modules from their source
        self.environment.pop("PYTHONDONTWRITEBYTECODE", None)
        if one_thread:
            self.environment["OPENBLAS_NUM_THREADS"] = "1"
            self.environment["OMP_NUM_THREADS"] = "1"

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
            watch = Timer(self.longest, process.kill)
            watch.start()
            _, status, usage = os.wait4(process.pid, 0)
            watch.cancel()
            process.returncode = os.waitstatus_to_exitcode(status)
            stream.seek(0)
            output = stream.read()
        seconds = usage.ru_utime + usage.ru_stime
        return process.returncode, output, seconds, usage.ru_maxrss / 1024.0


class CampaignError(Exception):
    """A command of a campaign that ended with an error, and its exit code."""

    def __init__(self, output, code=2):
        super().__init__(output)
        self.code = code


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


def draft(program, truth, folder):
    """Draft `campaign.toml` from the logs of a folder, give the held-out runs their role.

    Nothing else is corrected. Returns the CPU time. [s]
    """
    logs = sorted(Path("logs") / path.name for path in (folder / "logs").iterdir())
    known = ["--drive", truth["axis"], "--counts-per-turn", repr(truth["counts_per_turn"])]
    words = known if truth["axis"] != "cylinder" else []
    code, output, seconds, _ = program.run(
        "campaign", "init", *logs, *words, "--out", "campaign.toml", folder=folder
    )
    if code:
        raise CampaignError(output)
    set_roles(folder / "campaign.toml", truth["held_out"])
    return seconds


def number_in(row, column):
    """Number in a row of estimates.csv; None if the field is empty."""
    return float(row[column]) if row[column] else None


def estimates(fitted, truth):
    """Estimates of what the machine has, and the names of those that it has not.

    "as_read" is the truth in the amperes of the campaign's ammeter, "told" whether the tests tell
    something: whether the interval is narrower than half of what was known beforehand. None if no
    prior was given.
    """
    numbers = truth["parameters"]
    as_read = draws.as_read(numbers, truth["ammeter_gain"])
    spreads = prior_spreads(fitted / "setup.toml")
    rows, without = [], set()
    with (fitted / "estimates.csv").open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            name = row["parameter"]
            if name not in numbers:
                without.add(name.partition(" (")[0])
                continue
            lower, upper = number_in(row, "lower"), number_in(row, "upper")
            spread = spreads.get(name, spreads.get(name.rpartition("_")[0]))
            rows.append(
                {
                    "name": name,
                    "truth": numbers[name],
                    "as_read": as_read[name],
                    "value": number_in(row, "value"),
                    "lower": lower,
                    "upper": upper,
                    "told": None if spread is None else is_told(lower, upper, spread),
                }
            )
    return rows, sorted(without)


def prior_spreads(path):
    """Standard deviations of the logarithms that a fit setup gives, by free parameter. [1]"""
    if not path.exists():
        return {}
    setup = tomllib.loads(path.read_text("utf-8"))
    entries = setup["free"].items()
    return {name: entry["spread"] for name, entry in entries if "spread" in entry}


def is_told(lower, upper, spread):
    """Whether an interval is narrower than half of a log-normal prior's, in the logarithm."""
    if lower is None or upper is None or lower * upper <= 0.0:
        return False
    return abs(math.log(upper / lower)) < DEVIATIONS * spread


def predicted(program, folder, truth, *words, condition=draws.STEADY):
    """Errors of a fit's speed in new maneuvers: RMS, % of the speed's range, by name.

    By `validate` on logs without instruments. The range is that of the steady machine: one under
    load may stand still.

    Parameters
    ----------
    program : Program
    folder : Path
        Holds the fit in `fitted`.
    truth : dict
        As of `logger.write_campaign`.
    words : str or Path
        More options of `validate`.
    condition : Condition
        Of a drive's machine in these maneuvers.
    """
    cylinder = truth["axis"] == "cylinder"
    unit = "m/s" if cylinder else "rad/s"
    lines = [
        'title = "new maneuvers"',
        "[axes.machine]",
        'time = { column = "time", unit = "s" }',
        'input = { kind = "voltage", column = "voltage", unit = "V", interpolation = "linear" }',
        f'channels.speed = {{ kind = "shaft_speed", column = "speed", unit = "{unit}" }}',
    ]
    if not cylinder:
        lines.insert(2, f'drive = "{truth["axis"]}"')
    ranges = {}
    for name in new_names():
        if cylinder:
            run = steady = logger.new_cylinder_run(draws.drawn_cylinder(truth["seed"]), name)
        else:
            run = logger.new_run(truth["parameters"], truth["axis"], name, condition)
            steady = logger.new_run(truth["parameters"], truth["axis"], name)
        time, volts, speed = run.T
        file = f"{name}.csv".replace(" ", "_")
        write_table(folder / file, {"time": time, "voltage": volts, "speed": speed})
        lines += ["[[runs]]", f'file = "{file}"', 'role = "validate"']
        ranges[file.removesuffix(".csv")] = (name, float(np.ptp(steady[:, 2])))
    (folder / "new.toml").write_text("\n".join(lines) + "\n", "utf-8")
    code, output, _, _ = program.run(
        "validate", "fitted", "new.toml", "--out", "new", *words, folder=folder
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


def stored_verdict(fitted):
    """Entries of the verdict in a fit's folder; none of an older installation's."""
    stored = json.loads((fitted / "fit.json").read_text("utf-8")).get("verdict") or {}
    return stored.get("verdict", {})


def stated_error(predictions, decisive):
    """Error of the class that is predicted worst, % of range, of the first decisive channel.

    Of a drive that is its shaft's speed. None if nothing is stated.
    """
    errors = [
        100.0 * error
        for entry in predictions
        if entry["channel"] in decisive[:1]
        for _, error, *_ in entry["classes"]
    ]
    return max(errors, default=None)


def fit(program, truth, folder, *words):
    """Fit `campaign.toml` into `fitted`.

    Returns
    -------
    dict
        "cpu_fit" [s], "memory" [MB], "exit"; of the verdict "usable", "headline", "unsound"
        (sentences), "blamed" (runs that these name), "causes" (names, in order), "hysteresis" [A]
        (half its width, if it is one of these), "predictions" and "decisive" (as stored) and
        "assumed"; "stated" as of `stated_error`, "estimates" and "without_counterpart" as of
        `estimates`.
    """
    code, output, seconds, memory = program.run(
        "fit", "campaign.toml", "--out", "fitted", "--jobs", 1, *words, folder=folder
    )
    if not (folder / "fitted" / "fit.json").exists():
        raise CampaignError(output, code)
    verdict = stored_verdict(folder / "fitted")
    causes = verdict.get("causes") or []
    headline = re.search(r"^(Usable|Not usable)\b.*", output, re.MULTILINE)
    predictions, decisive = verdict.get("predictions", []), verdict.get("decisive", [])
    rows, without = estimates(folder / "fitted", truth)
    return {
        "cpu_fit": seconds,
        "memory": memory,
        "exit": code,
        "usable": code == 0,
        "headline": headline[0] if headline else "",
        "unsound": [sentence for *_, sentence in verdict.get("unsound", [])],
        "blamed": sorted({run for _, run, *_ in verdict.get("unsound", []) if run}),
        "causes": [name for name, *_ in causes],
        "hysteresis": next((size for name, size, *_ in causes if name == HYSTERESIS), None),
        "predictions": predictions,
        "decisive": decisive,
        "assumed": verdict.get("assumed", []),
        "stated": stated_error(predictions, decisive),
        "estimates": rows,
        "without_counterpart": without,
    }
