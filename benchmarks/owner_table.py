"""Whether the intervals of the numbers that matter hold, over 40 winches.

    .venv/bin/python benchmarks/owner_table.py [--winches 40] [--jobs 1] [--folder FOLDER]

Each winch is drawn at random (`draw`), tested in eight runs (`tests_of`) and logged by a tacho or
an encoder. Then an owner's way: guess, fit from the guess, table.
Truth and model are this package's simulator: what the simulator leaves out is not tested here. Logs
and fits stay in the folder, so that an interrupted series goes on and a changed table needs no new
fit; after a change of the guess or of the fit give another folder.

The levels of this draw were written down before anything was tuned to it.
"""

import argparse
import csv
import math
import os
import sys
import time
from pathlib import Path

# one core for each campaign: threads of the linear algebra would only wait for each other
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
from campaign_file import campaign_text

from swashplate.executors import Processes

# --- levels ---------------------------------------------------------------------------------------

SLOW, FAST = 128.0, 512.0
"""Rates of the log and of the simulated winch; the command is held between samples of the log. The
drive "neutral" has a filter as fast as 512 Hz can carry: at others it is 1 ms off. [Hz]"""
TOP_SPEED = (0.3, 30.0)
"""At the stop of the swash plate, log-uniform, the same both ways within ±10 %. [rad/s]"""
SATURATION = (6.0, 13.0)
"""Command that reaches the stop: below 10 V in four winches of seven. [V]"""
DEAD_ZONE = (0.2, 2.5)
"""Uniform, each way. [V]"""
JUMP = (0.03, 0.10)
"""Speed right beyond the dead zone over the top speed, in every second four of winches. [1]"""
BEND = 0.15
"""Quadratic part of the current at the largest command, at most, over the linear one. [1]"""
LAG, DELAY = (0.05, 0.4), (0.0, 0.1)
"""Log-uniform and uniform. [s]"""
ORIFICE = (0.2, 0.8)
"""Largest acceleration over the top speed per lag, log-uniform; of winches with an odd seed in one
direction only, chosen at random. [1]"""
LARGEST = (6.0, 9.5)
"""Largest command of the tests, each way. [V]"""
NOISE = (0.001, 0.01)
"""White noise of the tacho over its largest value, log-uniform, of winches in the first half of
each four. [1]"""
COUNTS = (300.0, 3000.0)
"""Counts a second of the encoder at the top speed, log-uniform, of the others. [1/s]"""

QUANTITIES = ("dead_zone", "gain", "jump", "top_speed", "acceleration", "delay", "lag", "creep")
FIELDS = (
    *("seed", "sensor", "orifice", "quantity", "way"),
    *("truth", "printed", "low", "high", "usable", "fit_cpu"),
)


def uniform(random, levels):
    """A number between two levels."""
    return float(random.uniform(*levels))


def log_uniform(random, levels):
    """A number whose logarithm is uniform between those of two levels."""
    return float(np.exp(random.uniform(*np.log(levels))))


def draw(seed):
    """Winch, largest commands [V] and sensor of a seed."""
    from swashplate import Drive

    random = np.random.default_rng([seed, 0x0317])
    numbers = Drive.preset("neutral").parameters.numbers
    top = log_uniform(random, TOP_SPEED)
    angle = 0.2
    per_angle = top / angle
    tops = top * np.exp(0.1 * random.uniform(-1.0, 1.0, 2))
    saturation = random.uniform(*SATURATION, 2)
    dead_zone = random.uniform(*DEAD_ZONE, 2)
    jump = random.uniform(*JUMP, 2) * tops * (seed // 4 % 2)
    # current to speed: linear to 0.4 % in the neutral drive
    per_ampere = per_angle * numbers["Z5"] * numbers["Z19_plus"]
    per_ampere /= math.sqrt(numbers["Z4"]) * numbers["Z3"]
    lag, delay = log_uniform(random, LAG), uniform(random, DELAY)
    reach = saturation - dead_zone
    # the line through the top speed at saturation, bent about it
    bend = BEND * random.uniform(-1.0, 1.0, 2)
    gain = (tops - jump) / (reach * (1.0 + bend))
    flow = numbers["Z1"] * math.sqrt(0.5 * numbers["Z9"])
    speed_of_flow = 1.0 / (lag * flow * numbers["Z3"] * numbers["Z5"])
    share = np.exp(random.uniform(*np.log(ORIFICE), 2))
    pulls = share * tops / lag / (per_angle * flow * speed_of_flow)
    without = int(random.integers(2))
    if seed % 2:
        pulls[without] = math.inf
    changes = {
        "V_dz": tuple(dead_zone),
        "J": tuple(jump / per_ampere),
        "G1": tuple(gain / per_ampere),
        "G2": tuple(bend * gain / reach / per_ampere),
        "tau": delay,
        "Z8": speed_of_flow,
        "Z10": per_angle,
        "Z13": tuple(tops / per_angle),
        "Z16": tuple(pulls),
    }
    orifice = "both" if seed % 2 == 0 else ("plus", "minus")[1 - without]
    drive = Drive.preset("neutral").replace(**changes).renamed("winch", f"Winch {seed}")
    largest = random.uniform(*LARGEST, 2)
    if seed % 4 < 2:
        sensor = ("tacho", log_uniform(random, NOISE))
    else:
        sensor = ("encoder", log_uniform(random, COUNTS) / top)
    return drive, largest, sensor, orifice


def tests_of(largest):
    """Commands of eight runs at the log's rate, by name. [V]"""
    from swashplate import maneuvers

    plus, minus = largest
    tests = {
        "step_plus": maneuvers.step(plus, length=8.0),
        "step_minus": maneuvers.step(-minus, length=8.0),
        "half_plus": maneuvers.step(0.6 * plus, stop=4.0, length=6.0),
        "half_minus": maneuvers.step(-0.6 * minus, stop=4.0, length=6.0),
        "ramp_plus": maneuvers.ramp(2.0, limit=plus, length=10.0),
        "ramp_minus": maneuvers.ramp(-2.0, limit=minus, length=10.0),
        "sine": maneuvers.sine(min(plus, minus), 0.25, length=10.0),
        "held_out": maneuvers.sine(0.7 * min(plus, minus), 0.4, length=8.0),
    }
    return {name: maneuver.sample(SLOW) for name, maneuver in tests.items()}


CHANNELS = {
    "tacho": '{ kind = "shaft_speed", column = "speed", unit = "rad/s" }',
    "encoder": '{{ kind = "encoder_counts", column = "counts", counts_per_turn = {} }}',
}


def write_logs(seed, folder):
    """Logs and campaign file of a winch."""
    drive, largest, (sensor, level), _ = draw(seed)
    random = np.random.default_rng([seed, 0x0106])
    repeats = round(FAST / SLOW)
    counts_per_turn = max(round(2.0 * math.pi * level), 1)
    channel = CHANNELS[sensor]
    if sensor == "encoder":
        channel = channel.format(float(counts_per_turn))
    roles = {}
    for name, command in tests_of(largest).items():
        # what a 12-bit converter puts out
        command = np.clip(np.rint(command * 204.8), -2048, 2047) / 204.8
        fast = np.append(np.repeat(command[:-1], repeats), command[-1])
        run = drive.simulate(fast, FAST, interpolation="previous")
        stamps = np.arange(command.size) / SLOW
        # a march joins its points by straight lines: what is held acts half a step too early
        seen = stamps - 0.5 / FAST
        if sensor == "tacho":
            speed = np.interp(seen, run.time, run.shaft_speed)
            noise = level * np.abs(speed).max() * random.standard_normal(speed.size)
            head, values = "speed", [f"{each:.6g}" for each in speed + noise]
        else:
            turns = np.interp(seen, run.time, run.shaft_position) / (2.0 * math.pi)
            counts = np.floor(counts_per_turn * turns + random.random())
            head, values = "counts", [f"{each:.0f}" for each in counts - counts[0]]
        rows = [f"time,command,{head}"]
        rows += [f"{t:.7f},{v:.6f},{x}" for t, v, x in zip(stamps, command, values, strict=True)]
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n", "utf-8")
        roles[f"{name}.csv"] = "validate" if name == "held_out" else "fit"
    text = campaign_text(
        f"Winch {seed}, simulated",
        axis="winch",
        drive="neutral",
        command="command",
        interpolation="previous",
        channels={sensor: channel},
        runs=roles,
    )
    (folder / "campaign.toml").write_text(text, "utf-8")


def fitted(seed, folder):
    """The fit of a winch, from its folder or made now."""
    from swashplate import Campaign
    from swashplate.drafting import guess_drive, guessed_set
    from swashplate.identification import Identification, identify

    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "campaign.toml").is_file():
        write_logs(seed, folder)
    campaign = Campaign.from_toml(folder / "campaign.toml")
    place = folder / "fitted"
    if not (place / "fit.json").is_file():
        begun = time.process_time()
        guess = guess_drive(campaign)
        start = guessed_set(guess, "campaign.toml")
        identify(campaign, start).save(place)
        seconds = time.process_time() - begun
        (folder / "seconds.txt").write_text(f"{seconds:.1f}\n", "utf-8")
    return Identification.load(place, campaign, threads=1)


def rows_of(folder, seed):
    """Rows of a winch's table: a quantity one way, with the truth, what is shown, its ends."""
    from dataclasses import replace

    from swashplate import Drive
    from swashplate.analysis import key_numbers

    drive, _, sensor, orifice = draw(seed)
    place = Path(folder) / f"{seed:02d}"
    judged = fitted(seed, place)
    numbers = judged.key_numbers
    tested = replace(drive.parameters, tested=numbers.commands)
    truth = key_numbers(Drive(tested))
    seconds = (place / "seconds.txt").read_text("utf-8").strip()
    usable = judged.verdict.usable
    rows = []
    for number in numbers.numbers:
        low, high = ("" if end is None else end for end in number.interval)
        words = (seed, sensor[0], orifice, number.name, number.direction)
        true = truth[number.label].value
        rows.append((*words, true, number.text(), low, high, usable, seconds))
    return rows


def holds(row):
    """Whether a truth lies within the ends of a row; None if nothing is promised."""
    truth, low, high = float(row["truth"]), row["low"], row["high"]
    if not low and not high:
        return None
    return (not low or float(low) <= truth) and (not high or truth <= float(high))


def report(rows):
    """Print shares: of all rows, of quantities, and of winches with one orifice or two."""
    print("| rows | with an interval | hold | one end | hold |\n|---|--:|--:|--:|--:|")
    groups = {"all": rows}
    for name in QUANTITIES:
        groups[name] = [row for row in rows if row["quantity"] == name]
    for name in ("both", "one"):
        groups[f"orifice: {name}"] = [
            row for row in rows if (row["orifice"] == "both") == (name == "both")
        ]
    for name in ("tacho", "encoder"):
        groups[name] = [row for row in rows if row["sensor"] == name]
    for name, some in groups.items():
        intervals = [holds(row) for row in some if row["low"] and row["high"]]
        bounds = [holds(row) for row in some if bool(row["low"]) != bool(row["high"])]
        print(f"| {name} | {len(some)} | {shares(intervals)} | {shares(bounds)} |")
    seconds = {row["seed"]: float(row["fit_cpu"]) for row in rows}
    print(f"\n{len(seconds)} winches, guess and fit {sum(seconds.values()):.0f} s of CPU.")
    for row in rows:
        if holds(row) is False:
            words = (row["seed"], row["sensor"], row["orifice"], row["quantity"], row["way"])
            print(f"missed: {', '.join(words)}: {row['printed']}, truth {float(row['truth']):.4g}")


def shares(held):
    """How many there are, and which part of them holds."""
    return f"{len(held)} | {100.0 * sum(held) / len(held):.1f} %" if held else "0 | -"


def main():
    """Run what is missing, write all rows, print the shares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--winches", type=int, default=40)
    parser.add_argument("--seeds", type=int, nargs="+", help="only these")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path("benchmarks/build/owner_table"))
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    seeds = chosen.seeds or range(chosen.winches)
    rows = []
    for _, some in Processes(chosen.jobs).run(rows_of, str(chosen.folder), list(seeds)):
        rows += [dict(zip(FIELDS, map(str, row), strict=True)) for row in some]
        print(f"\r{len(rows) // 15} of {len(seeds)} ", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    rows.sort(key=lambda row: int(row["seed"]))
    with (chosen.folder / "rows.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, FIELDS)
        writer.writeheader()
        writer.writerows(rows)
    report(rows)


if __name__ == "__main__":
    main()
