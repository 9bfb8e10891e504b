"""Campaigns in worker processes; their rows are kept as they are ready, so that one can go on."""

import csv
import sys
import time

from swashplate.executors import Processes


def run_missing(campaign, todo, jobs, path, fields):
    """Append the rows of each item, ``campaign(None, item)``, to a CSV file.

    The workers end with this process, however it ends.
    """
    begun, new = time.perf_counter(), not path.exists()
    with path.open("a", newline="") as stream:
        writer = csv.writer(stream)
        if new:
            writer.writerow(fields)
        found = Processes(jobs).run(campaign, None, todo)
        for number, (_, rows) in enumerate(found, 1):
            writer.writerows(rows)
            stream.flush()
            left = (time.perf_counter() - begun) / number * (len(todo) - number)
            print(f"\r{number} of {len(todo)}, {left:.0f} s left ", end="", file=sys.stderr)
    print(file=sys.stderr)


def read(path):
    """Rows that were written before, none if there is no file."""
    if not path.exists():
        return []
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))
