"""Winches that share no line with swashplate, fitted the owner's way, and counted.

    .venv/bin/python benchmarks/foreign_winches.py --out found.jsonl [--seeds 0 9]
    .venv/bin/python benchmarks/foreign_winches.py --report found.jsonl

A truck crane's winch, drawn at random within the constants below: a stick of 0 to 10 V that rests
at 5 V, an amplifier with dead zone, jump and rate limits, and behind its current a delay, a lag of
second order, a top speed and a limited acceleration. It is written with NumPy alone, and its
structure is not that of the package's drive.

Of each winch an owner has a folder of logs, with or without the currents. `campaign init` drafts
the campaign, the offset of the stick's rest is entered as `campaign check` asks for, `guess` writes
the start, and `fit --from` it fits. Then the numbers that matter are compared with the winch's, and
the speed that the fitted drive simulates in a new recording of ordinary work with the true one.

Seeds 0 to 9 are for development, 100 to 139 for judgement. The ranges were committed before the
first winch was drawn. Every winch is a line of JSON, with and without the currents.
"""

import argparse
import csv
import json
import re
import sys
from pathlib import Path
from statistics import median

import numpy as np
from command_line import CampaignError, Program, stated_error, stored_verdict, write_table
from records import (
    coverage_cell,
    half_width,
    holds,
    missing,
    number,
    print_table,
    read,
    run_missing,
)

# --- the ranges of what is drawn ------------------------------------------------------------------

DEAD_ZONE = (0.2, 0.7)
"""Of the amplifier, from rest. [V]"""
FULL_STICK = 5.0
"""Largest command either way, from rest. [V]"""
JUMP_CURRENT = (300.0, 500.0)
"""Beyond the dead zone. [mA]"""
CURRENT_RISE = (350.0, 600.0)
"""From there to the full stick. [mA]"""
RATE_UP = (800.0, 3000.0)
RATE_DOWN = (1500.0, 6000.0)
"""Largest rates of the current. [mA/s]"""
CURRENT_LAG = (0.005, 0.03)
"""Of first order, of the current behind its rate limits. [s]"""
ONSET = (-30.0, 60.0)
"""Current from which the winch moves, less the jump's. [mA]"""
TOP_SPEED = (30.0, 90.0)
"""[rpm]"""
OVERDRIVE = (0.95, 1.3)
"""Speed that the full current would give without a limit, over the top speed. [1]"""
DELAY = (0.0, 0.06)
"""Behind the current. [s]"""
NATURAL_FREQUENCY = (8.0, 20.0)
DAMPING = (0.6, 1.0)
"""Of the lag of second order behind the current. [rad/s], [1]"""
TIME_TO_TOP = (0.5, 1.5)
"""Top speed over the largest acceleration. [s]"""
BETWEEN_WAYS = 0.15
"""Largest difference of a number between one way and the other, over the number; of the onset that
of its distance from the jump. [1]"""
COUNTS = (1024, 2048, 4096, 8192)
"""Of the encoder, a turn."""
AMMETER_NOISE = (1.0, 6.0)
"""Standard deviation. [mA]"""
STICK_NOISE = (0.001, 0.008)
"""Standard deviation. [V]"""
LOG_RATES = (125.0, 200.0, 250.0)
"""[Hz]"""
JITTER = 0.08
"""Standard deviation of a stamp, over the interval of the log. [1]"""

DEVELOPMENT, JUDGEMENT = range(10), range(100, 140)

# --- a winch --------------------------------------------------------------------------------------

STEP = 1.0 / 2000.0
"""Of the march. [s]"""


def drawn(seed):
    """Numbers of a winch; both ways of a pair, plus first."""
    random = np.random.default_rng(seed)

    def one(ends):
        return float(random.uniform(*ends))

    def both(ends):
        middle = one(ends)
        differ = random.uniform(-0.5 * BETWEEN_WAYS, 0.5 * BETWEEN_WAYS)
        return [middle * (1.0 - differ), middle * (1.0 + differ)]

    jump, rise, top = both(JUMP_CURRENT), both(CURRENT_RISE), both(TOP_SPEED)
    beyond = both(ONSET)
    onset = [jump[side] + beyond[side] for side in (0, 1)]
    overdrive = one(OVERDRIVE)
    full = [jump[side] + rise[side] for side in (0, 1)]
    slowest = max(top)
    return {
        "dead_zone": both(DEAD_ZONE),
        "jump": jump,
        "full": full,
        "rate_up": one(RATE_UP),
        "rate_down": one(RATE_DOWN),
        "current_lag": one(CURRENT_LAG),
        "onset": onset,
        "gain": [overdrive * top[side] / (full[side] - onset[side]) for side in (0, 1)],
        "top": top,
        "delay": one(DELAY),
        "omega": one(NATURAL_FREQUENCY),
        "damping": one(DAMPING),
        # of rising and of falling speed, whatever its sign
        "acceleration": [slowest / time for time in both(TIME_TO_TOP)],
        "counts": int(random.choice(COUNTS)),
        "ammeter_noise": one(AMMETER_NOISE),
        "stick_noise": one(STICK_NOISE),
        "rate": float(random.choice(LOG_RATES)),
    }


def marched(winch, command):
    """Current of each solenoid (2, n) [mA] and speed (n,) [rpm] under a command from rest (n,) [V].

    The command has a sample each `STEP`.
    """
    wanted = np.zeros((2, command.size))
    for side, sign in enumerate((1.0, -1.0)):
        beyond = sign * command - winch["dead_zone"][side]
        slope = (winch["full"][side] - winch["jump"][side]) / (
            FULL_STICK - winch["dead_zone"][side]
        )
        wanted[side] = np.where(beyond > 0.0, winch["jump"][side] + slope * beyond, 0.0)
    current = np.stack([_amplified(winch, side, wanted[side]) for side in (0, 1)])
    target = np.zeros(command.size)
    for side, sign in enumerate((1.0, -1.0)):
        speed = winch["gain"][side] * np.maximum(current[side] - winch["onset"][side], 0.0)
        target += sign * np.minimum(speed, winch["top"][side])
    late = round(winch["delay"] / STEP)
    target = np.concatenate([np.zeros(late), target])[: command.size]
    return current, _followed(winch, target)


def _amplified(winch, side, wanted):
    """Current of a solenoid, limited in rate above its jump, behind a lag of first order. [mA]

    Up to its jump it goes at once.
    """
    up, down = winch["rate_up"] * STEP, winch["rate_down"] * STEP
    keeps = float(np.exp(-STEP / winch["current_lag"]))
    jump, limited, out = winch["jump"][side], 0.0, 0.0
    course = np.zeros(wanted.size)
    for k, goal in enumerate(wanted.tolist()):
        if goal <= 0.0:
            limited = limited - down if limited - down > jump else 0.0
        else:
            limited = max(limited, jump)
            limited = min(max(goal, limited - down), limited + up)
        out = limited + (out - limited) * keeps
        course[k] = out
    return course


def _followed(winch, target):
    """Speed behind a lag of second order and a limited acceleration. [rpm]"""
    omega, damping = winch["omega"], winch["damping"]
    up, down = (limit * STEP for limit in winch["acceleration"])
    lagged = rate = speed = 0.0
    course = np.zeros(target.size)
    for k, goal in enumerate(target.tolist()):
        rate += STEP * (omega * omega * (goal - lagged) - 2.0 * damping * omega * rate)
        lagged += STEP * rate
        speed += min(max(lagged - speed, -down), up)
        course[k] = speed
    return course


# --- logs -----------------------------------------------------------------------------------------

DURATIONS = {
    "ramp_p": 16.0,
    "ramp_m": 16.0,
    "sine_01": 24.0,
    "sine_03": 24.0,
    "sine_05": 14.0,
    "stairs": 39.0,
    "step_p15": 10.0,
    "step_m15": 10.0,
    "step_p30": 10.0,
    "step_m30": 10.0,
    "step_p50": 10.0,
    "step_m50": 10.0,
    "work": 40.0,
}
"""Length of each maneuver. [s]"""


def commanded(name, seed):
    """Command from rest (n,) of a maneuver, a sample each `STEP`. [V]"""
    time = STEP * np.arange(round(DURATIONS[name] / STEP))
    kind, _, size = name.partition("_")
    if kind == "ramp":
        sign = 1.0 if size == "p" else -1.0
        return sign * np.where(time < 13.0, np.clip(0.5 * (time - 1.0), 0.0, FULL_STICK), 0.0)
    if kind == "step":
        sign = 1.0 if size[0] == "p" else -1.0
        volts = min(float(size[1:]) / 10.0, 4.9)
        return np.where((time >= 1.0) & (time < 6.0), sign * volts, 0.0)
    if kind == "sine":
        frequency, volts, last = {"01": (0.1, 3.5, 99.0), "03": (0.3, 2.5, 99.0)}.get(
            size, (0.5, 4.0, 3.0)
        )
        moving = (time >= 1.0) & (time < last)
        return np.where(moving, volts * np.sin(2.0 * np.pi * frequency * (time - 1.0)), 0.0)
    if kind == "stairs":
        levels = [0.0, 1.0, 2.0, 3.0, 4.0, 2.0, 0.0, -1.0, -2.0, -3.0, -4.0, -2.0, 0.0]
        return np.repeat(levels, round(3.0 / STEP))[: time.size]
    # ordinary work: an operator moves the stick from place to place
    random = np.random.default_rng([seed, 1])
    instants, places = [0.0, 1.2], [0.0, 0.0]
    while instants[-1] < DURATIONS["work"]:
        instants.append(instants[-1] + float(random.uniform(0.3, 2.2)))
        places.append(float(random.uniform(-4.7, 4.7)))
    return np.interp(time, instants, places)


PREAMBLE = "Logger;WL-2\nDate;2026-11-30\nCrane;winch 1\n\n"


def write_log(path, winch, name, seed, *, with_current):
    """Write a maneuver's log, and give its course: time [s], command [V], speed [rpm]."""
    order = list(DURATIONS).index(name)
    random = np.random.default_rng([seed, 2, order])
    command = commanded(name, seed)
    current, speed = marched(winch, command)
    exact = STEP * np.arange(command.size)
    count = int(DURATIONS[name] * winch["rate"])
    stamps = (np.arange(count) + random.normal(0.0, JITTER, count)) / winch["rate"]
    stamps = np.sort(np.clip(stamps, 0.0, exact[-1]))
    stick = 5.0 + np.interp(stamps, exact, command) + random.normal(0, winch["stick_noise"], count)
    turns = np.cumsum(speed) * STEP / 60.0
    encoder = 1234 + np.floor(winch["counts"] * np.interp(stamps, exact, turns) + 0.5)
    columns = {"Time": ("s", "{:.4f}", stamps), "Joystick": ("V", "{:.3f}", stick)}
    for side, label in enumerate("AB"):
        measured = np.interp(stamps, exact, current[side])
        measured = measured + random.normal(0.0, winch["ammeter_noise"], count)
        if with_current:
            columns[f"I_Solenoid_{label}"] = ("mA", "{:.1f}", measured)
    columns["Encoder"] = ("Imp", "{:.0f}", encoder)
    units, forms, values = zip(*columns.values(), strict=True)
    rows = zip(*(column.tolist() for column in values), strict=True)
    lines = [";".join(columns), ";".join(units)]
    lines += [";".join(form.format(x) for form, x in zip(forms, row, strict=True)) for row in rows]
    path.write_text(PREAMBLE + "\n".join(lines).replace(".", ",") + "\n", "latin-1")
    return exact, command, speed


# --- the numbers that matter ----------------------------------------------------------------------

RPM = 2.0 * np.pi / 60.0
"""An rpm in rad/s."""


def true_numbers(winch):
    """Numbers that matter by label, SI, with the sign of their direction but gain, delay, lag.

    Acceleration, delay to 2 % and lag from there to 63 % of a step from rest to the largest command
    of the tests, each read off its march.
    """
    numbers = {}
    for side, (way, sign) in enumerate((("plus", 1.0), ("minus", -1.0))):
        dead, jump = winch["dead_zone"][side], winch["jump"][side]
        slope = (winch["full"][side] - jump) / (FULL_STICK - dead)
        beyond = max(winch["onset"][side] - jump, 0.0) / slope
        top = min(
            winch["gain"][side] * (winch["full"][side] - winch["onset"][side]), winch["top"][side]
        )
        step = np.full(round(8.0 / STEP), sign * FULL_STICK)
        speed = sign * marched(winch, step)[1]
        # the jump of the acceleration at a single step of the march is none
        wide = round(0.01 / STEP)
        pull = float((speed[wide:] - speed[:-wide]).max()) / (wide * STEP)
        share = np.maximum.accumulate(speed) / top
        begins, ends = np.interp((0.02, 0.63), share, STEP * np.arange(1, speed.size + 1))
        numbers |= {
            f"dead_zone_{way}": sign * (dead + beyond),
            f"gain_{way}": winch["gain"][side] * slope * RPM,
            f"top_speed_{way}": sign * top * RPM,
            f"acceleration_{way}": sign * pull * RPM,
            f"delay_{way}": float(begins),
            f"lag_{way}": float(ends - begins),
        }
    return numbers


def compared(folder, winch):
    """Numbers that matter of the fit in a folder beside the winch's."""
    stored = json.loads((folder / "fitted" / "fit.json").read_text("utf-8"))
    found = {}
    for entry in ((stored["verdict"] or {}).get("key_numbers") or {}).get("numbers", []):
        name, direction, _, value, lower, upper = entry[:6]
        found[f"{name}_{direction}"] = (value, lower, upper)
    rows = []
    for label, truth in true_numbers(winch).items():
        value, lower, upper = found.get(label, (None, None, None))
        rows.append({"name": label, "truth": truth, "value": value, "lower": lower, "upper": upper})
    return rows


# --- the owner's way ------------------------------------------------------------------------------

HELD_OUT = "step_p50"


def run_winch(program, seed, with_current, folder):
    """Record of a winch: what its owner gets, beside the truth."""
    winch = drawn(seed)
    logs = folder / "logs"
    logs.mkdir(parents=True)
    for name in DURATIONS:
        if name != "work":
            write_log(logs / f"{name}.csv", winch, name, seed, with_current=with_current)
    record = {"winch": winch}
    names = sorted(str(path.relative_to(folder)) for path in logs.iterdir())
    words = {
        "init": ["campaign", "init", *names, "--counts-per-turn", winch["counts"]],
        "guess": ["guess", "logs/campaign.toml"],
        "fit": [
            *("fit", "logs/campaign.toml", "--from", "logs/start.toml"),
            *("--out", "fitted", "--jobs", 1, "--no-report"),
        ],
    }
    for step, command in words.items():
        code, output, seconds, _ = program.run(*command, folder=folder)
        record[f"cpu_{step}"] = seconds
        if code and not (step == "fit" and (folder / "fitted" / "fit.json").exists()):
            raise CampaignError(output, code)
        if step == "init":
            with_offset(logs / "campaign.toml")
    headline = re.search(r"^(Usable|Not usable)\b.*", output, re.MULTILINE)
    verdict = stored_verdict(folder / "fitted")
    record |= {
        "usable": code == 0,
        "headline": headline[0] if headline else "",
        "stated": stated_error(verdict.get("predictions", []), verdict.get("decisive", [])),
        "estimates": compared(folder, winch),
    }
    return record | new_work(program, winch, seed, folder)


def with_offset(path):
    """Enter the offset of a stick that rests at 5 V, unless the draft has it."""
    text = path.read_text("utf-8")
    if not re.search(r"^offset = -5", text, re.MULTILINE):
        text = re.sub(r'^(column = "Joystick".*)$', r"\1\noffset = -5.0", text, flags=re.MULTILINE)
        path.write_text(text, "utf-8")


def new_work(program, winch, seed, folder):
    """Error of the speed in a recording of ordinary work, % of its range, beside the band.

    The fitted drive gets the exact command. "off" is the RMS error, "band" the same of the band's
    half width, "inside" the share of the samples in it.
    """
    exact, command, speed = write_log(folder / "work.csv", winch, "work", seed, with_current=False)
    write_table(folder / "exact.csv", {"time": exact, "voltage": command})
    code, output, _, _ = program.run(
        *("simulate", "fitted", "exact.csv", "--interpolation", "linear", "--out", "new.csv"),
        folder=folder,
    )
    if code:
        raise CampaignError(output, code)
    with (folder / "new.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))

    def column(name):
        return np.array([float(row[name]) for row in rows])

    truth = RPM * np.interp(column("time"), exact, speed)
    full = 0.01 * float(np.ptp(truth))
    error = column("shaft_speed") - truth
    result = {"off": float(np.sqrt(np.mean(error**2))) / full}
    if "shaft_speed_lower" in rows[0]:
        low, high = column("shaft_speed_lower"), column("shaft_speed_upper")
        result["band"] = float(np.sqrt(np.mean((0.5 * (high - low)) ** 2))) / full
        result["inside"] = float(np.mean((truth >= low) & (truth <= high)))
    return result


# --- tables ---------------------------------------------------------------------------------------


def groups(records):
    """Records that did not fail, with the currents and without, by what is in the table."""
    for with_current, label in ((False, "without current"), (True, "with current")):
        chosen = [each for each in records if each["with_current"] == with_current]
        if chosen:
            yield label, chosen, [each for each in chosen if "error" not in each]


def overview_row(label, chosen, done):
    """Cells of a row of the overview."""
    rows = [row for record in done for row in record["estimates"]]
    bounded = [row for row in rows if row["lower"] is not None and row["upper"] is not None]
    widths = {
        name: number([half_width(row) for row in bounded if row["name"].startswith(name)])
        for name in ("gain", "top_speed", "delay")
    }
    errors = [record["off"] for record in done]
    cpu = [record["cpu_guess"] + record["cpu_fit"] for record in done]
    return (
        label,
        f"{len(done)} of {len(chosen)}",
        sum(not record["usable"] for record in done) + len(chosen) - len(done),
        coverage_cell(bounded),
        f"{len(bounded) / len(rows):.0%}" if rows else "-",
        widths["gain"],
        widths["top_speed"],
        widths["delay"],
        f"{number(errors)}, {number(errors, max)}",
        number([record.get("band") for record in done]),
        number([record.get("inside") for record in done]),
        f"{number(cpu)}, {number(cpu, max)}",
    )


OVERVIEW = (
    "logs",
    "fitted",
    "refused",
    "numbers in their intervals",
    "rows with an interval",
    "half width, median %: gain",
    "top speed",
    "delay",
    "error of new work, % of range: median, largest",
    "band, RMS, median",
    "samples in it, median",
    "CPU s, guess and fit: median, largest",
)


def print_report(records):
    """Overview, coverage by number, and the current's gain winch by winch."""
    print_table(OVERVIEW, [overview_row(*group) for group in groups(records)])
    names = sorted({row["name"] for each in records for row in each.get("estimates", [])})
    rows = []
    for name in names:
        cells = [name]
        for _, _, done in groups(records):
            found = [row for each in done for row in each["estimates"] if row["name"] == name]
            found = [row for row in found if row["lower"] is not None and row["upper"] is not None]
            widths = number([half_width(row) for row in found])
            cells.append(f"{sum(map(holds, found))} of {len(found)}, {widths}")
        rows.append(cells)
    print_table(("number: hold, half width %", *(label for label, *_ in groups(records))), rows)
    errors = {}
    for each in records:
        if "error" not in each:
            errors.setdefault(each["seed"], {})[each["with_current"]] = each["off"]
    pairs = [pair for pair in errors.values() if len(pair) == 2]
    if pairs:
        ratio = median(pair[True] / pair[False] for pair in pairs)
        print(
            f"\nError with the current over that without, {len(pairs)} winches: median {ratio:.3g}"
        )


def main():
    """Run what is missing, or print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, help="file of the records, a line of JSON each")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 9), metavar=("FIRST", "LAST"))
    parser.add_argument("--keep", type=Path, help="folder in which logs and fits stay")
    parser.add_argument("--report", type=Path, help="print the tables of such a file")
    options = parser.parse_args()
    if options.report:
        print_report(read(options.report))
        return
    if options.out is None:
        parser.error("--out or --report is needed")
    program = Program(sys.executable)
    first, last = options.seeds
    items = [
        {"seed": seed, "with_current": current}
        for seed in range(first, last + 1)
        for current in (False, True)
    ]

    def work(item, folder):
        return run_winch(program, item["seed"], item["with_current"], folder)

    run_missing(work, missing(items, read(options.out)), 1, options.out, options.keep)


if __name__ == "__main__":
    main()
