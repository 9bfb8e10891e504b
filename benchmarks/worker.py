"""What must be measured in a process of its own; prints one JSON object.

python benchmarks/worker.py batch SECONDS | hour FOLDER | first
"""

import json
import sys
from pathlib import Path

import numpy as np
from cases import CARD_SPREAD, PUMP_SPREAD, RATE, changes
from timing import alone, seconds

from swashplate import Drive, SquaredError, maneuvers
from swashplate.logs import read_series


def peak() -> float:
    """Largest memory that this process has had (Linux). [B]

    Not `ru_maxrss`: that is handed down through fork and exec, so that a small process which a
    large one has started would report the large one's peak.
    """
    status = Path("/proc/self/status").read_text("ascii")
    line = next(each for each in status.splitlines() if each.startswith("VmHWM"))
    return 1024.0 * float(line.split()[1])


def forget_peak() -> None:
    """Have `peak` count from now on, not from the process's beginning."""
    Path("/proc/self/clear_refs").write_text("5", "ascii")


def batch(length: float) -> dict[str, float]:
    """Growth of memory by a batch that keeps only costs, beyond the size of its record."""
    drive = Drive.preset("hoist")
    sets = changes(drive.parameters.numbers, PUMP_SPREAD + CARD_SPREAD)
    for each in (1.0, length):
        voltage = maneuvers.sine(6.5, 0.1, start=0.0, settle=None, length=each).sample(RATE)
        cost = SquaredError(np.zeros(voltage.size))
        forget_peak()
        before = peak()
        drive.simulate_many(sets, voltage=voltage, cost=cost)
    return {"growth": peak() - before, "record": float(voltage.nbytes)}


def hour(folder: Path) -> dict[str, float]:
    """One hour of hoist: read the log, simulate, write all signals."""
    drive, log, result = Drive.preset("hoist"), folder / "log.csv", folder / "result.csv"
    drive.simulate(np.zeros(2)).shaft_speed.sum()
    read = alone(lambda: read_series(log, "voltage", "V"), 3)
    voltage = read_series(log, "voltage", "V").values
    simulate = alone(lambda: drive.simulate(voltage).shaft_speed, 5)
    run = drive.simulate(voltage)
    write = seconds(lambda: run.write(result))
    return {"read": read, "simulate": simulate, "write": write, "peak": peak()}


def first() -> dict[str, float]:
    """A first simulation, with whatever the cache of compiled code holds."""
    voltage = maneuvers.sine(6.5, 0.1).sample(RATE)
    return {"first": seconds(lambda: Drive.preset("hoist").simulate(voltage).shaft_speed)}


def main(job: str, argument: str = "") -> None:
    """Do one job."""
    if job == "batch":
        found = batch(float(argument))
    elif job == "hour":
        found = hour(Path(argument))
    else:
        found = first()
    print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
