"""Memory grows with the columns that are asked for, not with the file."""

import subprocess
import sys

import h5py
import numpy as np
import polars as pl
import pytest
from nptdms import ChannelObject, TdmsWriter

COLUMNS = 40
ROWS = 100_000

# high-water marks; that of the process in which formats are read apart counts, too
READ = """
import sys
from pathlib import Path
from swashplate.logs import apart, open_log

def peak():
    other = apart._Other.running
    processes = ["self"] + ([str(other._process.pid)] if other else [])
    status = [Path(f"/proc/{each}/status").read_text() for each in processes]
    return sum(int(each.split("VmHWM:")[1].split()[0]) for each in status) * 1024

small, large, column, count = sys.argv[1:]
open_log(small).read([column])  # what is imported needs memory as well
log = open_log(large)
before = peak()
assert log.read([column])[column].size == int(count)
print(peak() - before)
"""


def csv(path, table):
    pl.DataFrame(table).write_csv(path)


def parquet(path, table):
    pl.DataFrame(table).write_parquet(path)


def hdf5(path, table):
    with h5py.File(path, "w") as file:
        for name, column in table.items():
            file.create_dataset(name, data=column, chunks=(min(column.size, 10_000),))


def tdms(path, table):
    with TdmsWriter(path) as writer:
        for part in np.array_split(np.arange(next(iter(table.values())).size), 4):
            writer.write_segment(
                [ChannelObject("run", name, column[part]) for name, column in table.items()]
            )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("write", "suffix", "column"),
    [
        (csv, ".csv", "c7"),
        (parquet, ".parquet", "c7"),
        (hdf5, ".h5", "/c7"),
        (tdms, ".tdms", "c7"),
    ],
)
def test_one_column_of_many(tmp_path, write, suffix, column):
    random = np.random.default_rng(1)
    small, large = tmp_path / f"small{suffix}", tmp_path / f"large{suffix}"
    write(small, {f"c{i}": random.normal(size=30) for i in range(COLUMNS)})
    write(large, {f"c{i}": random.normal(size=ROWS) for i in range(COLUMNS)})
    words = [sys.executable, "-c", READ, str(small), str(large), column, str(ROWS)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert int(done.stdout) < 0.5 * large.stat().st_size
