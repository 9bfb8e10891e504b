"""How long Sobol's indices of a 10 s manoeuvre take, and how much memory.

    .venv/bin/python benchmarks/sobol.py [--samples 1024] [--threads 2]

Eight levers and five outcomes of the hoist's step: 10,240 simulations of 5,121 samples. Wall time,
processor time and the growth of the largest resident memory, for a quarter of the runs and all.
"""

import argparse
import resource
import time

from swashplate import Drive, maneuvers
from swashplate.analysis.sensitivity import ranges_of
from swashplate.analysis.sobol import sobol
from swashplate.analysis.trial import trial

LEVERS = (
    "orifice",
    "pump",
    "supply_pressure",
    "rate_limits",
    "dead_zone",
    "spool_stroke",
    "relief",
    "plussing",
)
OUTCOMES = ("final_speed", "rise_time", "largest_acceleration", "tracking_error", "creep")


def largest_memory() -> float:
    """Largest resident memory of this process so far. [MB]"""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("--threads", type=int, default=2)
    wanted = parser.parse_args()
    hoist = Drive.preset("hoist")
    command = trial(hoist, maneuvers.step(9.0).sample())
    ranges = ranges_of(LEVERS, 0.2)
    print("| runs | wall s | processor s | largest memory grows by MB |")
    print("|--:|--:|--:|--:|")
    for samples in (16, wanted.samples // 4, wanted.samples):
        memory, wall, processor = largest_memory(), time.perf_counter(), time.process_time()
        found = sobol(
            hoist, ranges, command, outcomes=OUTCOMES, samples=samples, threads=wanted.threads
        )
        seconds = (time.perf_counter() - wall, time.process_time() - processor)
        words = "first use " if samples == 16 else ""
        print(
            f"| {words}{found.runs} | {seconds[0]:.2f} | {seconds[1]:.2f} | "
            f"{largest_memory() - memory:.0f} |"
        )


if __name__ == "__main__":
    main()
