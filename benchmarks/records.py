"""Records of campaigns: lines of JSON that a bench goes on with, and what tables count in them."""

import json
import math
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
from threading import Lock

from command_line import CampaignError
from scipy.stats import binomtest


def read(path):
    """Records that a file holds; none if there is no file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text("utf-8").splitlines() if line]


def missing(items, records):
    """The items, dictionaries, that no record has the entries of."""
    return [
        item
        for item in items
        if not any(all(record.get(key) == item[key] for key in item) for record in records)
    ]


def run_missing(work, items, jobs, path, keep=None):
    """Run campaigns and append a line of each to a file.

    Parameters
    ----------
    work : function of (item, folder)
        Gives the record of a campaign as a dictionary; a `CampaignError` becomes its "error".
    items : list of dict
        What is to be run; a record has the entries of its item.
    jobs : int
        Campaigns at a time.
    path : Path
    keep : Path, optional
        Folder in which logs and fits stay.
    """
    lock, begun, count = Lock(), time.perf_counter(), 0

    def one(item):
        nonlocal count
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary) / "campaign"
            if keep is not None:
                folder = keep.absolute() / "-".join(map(str, item.values()))
            try:
                record = item | work(item, folder)
            except CampaignError as error:
                record = item | {"error": str(error)[-2000:]}
        with lock:
            with path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(record) + "\n")
            count += 1
            left = (time.perf_counter() - begun) / count * (len(items) - count)
            print(f"\r{count} of {len(items)}, {left:.0f} s left ", end="", file=sys.stderr)

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(one, items))
    print(file=sys.stderr)


def holds(row, what="truth"):
    """Whether an interval holds the truth; an end that is missing lies at infinity."""
    low = -math.inf if row["lower"] is None else row["lower"]
    high = math.inf if row["upper"] is None else row["upper"]
    return low <= row[what] <= high


def half_width(row):
    """Half width of an interval, % of the truth; None where an end is missing."""
    if row["lower"] is None or row["upper"] is None or not row["truth"]:
        return None
    return 50.0 * (row["upper"] - row["lower"]) / abs(row["truth"])


def miss(row):
    """Distance of the estimate from the truth, in half widths; None where an end is missing."""
    if row["lower"] is None or row["upper"] is None or row["lower"] == row["upper"]:
        return None
    middle, half = 0.5 * (row["upper"] + row["lower"]), 0.5 * (row["upper"] - row["lower"])
    return abs(row["truth"] - middle) / half


def has_own_hysteresis(record):
    """Whether a cause is the hysteresis that the machine has, to half of it."""
    found, own = record.get("hysteresis"), record.get("own_hysteresis", 0.0)
    return found is not None and own / 1.5 < found < 1.5 * own


def has_own_causes(record):
    """Whether all causes are the machine's own: its hysteresis, or the drift of its warming oil."""
    other = [cause for cause in record["causes"] if not cause.startswith("drift of")]
    return not other or has_own_hysteresis(record)


def present(values):
    """The values that are there."""
    return [value for value in values if value is not None]


def number(values, of=median):
    """A statistic of the values that are there, as text."""
    values = present(values)
    return f"{of(values):.3g}" if values else "-"


def with_interval(records):
    """All estimates of records that have an interval, if with one end."""
    rows = [row for record in records for row in record["estimates"]]
    return [row for row in rows if row["lower"] is not None or row["upper"] is not None]


def coverage_cell(rows, what="truth"):
    """Share of intervals that hold, with the 95 % interval of as many independent ones."""
    if not rows:
        return "-"
    inside = sum(holds(row, what) for row in rows)
    ends = binomtest(inside, len(rows)).proportion_ci(0.95, method="wilson")
    return f"{inside / len(rows):.1%} ({ends.low:.1%} to {ends.high:.1%})"


def print_table(head, rows):
    """A table of Markdown."""
    print(f"\n| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for row in rows:
        print(f"| {' | '.join(map(str, row))} |")
