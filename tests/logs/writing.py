"""Logs of every format, written by the libraries that others use."""

from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import polars as pl
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter

Columns = Mapping[str, np.ndarray]


def write_log(
    path: Path,
    groups: Mapping[str, Columns],
    units: Mapping[str, str] | None = None,
    segments: int = 1,
) -> None:
    """Columns of one or more groups as a file of its ending: HDF5, TDMS, MDF, Parquet or CSV.

    The time of an MDF's group is its column "time".
    """
    units = units or {}
    if path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            for group, columns in groups.items():
                for name, each in columns.items():
                    chunks = (min(each.size, 10_000),)
                    made = file.create_dataset(f"{group}/{name}", data=each, chunks=chunks)
                    made.attrs.update({"unit": units[name]} if name in units else {})
    elif path.suffix == ".tdms":
        with TdmsWriter(path) as writer:
            for group, columns in groups.items():
                given = {name: {"unit_string": units[name]} for name in columns if name in units}
                rows = np.arange(next(iter(columns.values())).size)
                for part in np.array_split(rows, segments):
                    writer.write_segment(
                        [
                            ChannelObject(group, name, each[part], given.get(name))
                            for name, each in columns.items()
                        ]
                    )
    elif path.suffix == ".mf4":
        with MDF(version="4.10") as mdf:
            for group, columns in groups.items():
                signals = [
                    Signal(each, columns["time"], units.get(name, ""), name)
                    for name, each in columns.items()
                    if name != "time"
                ]
                mdf.append(signals, acq_name=group)
            mdf.save(path, overwrite=True)
    else:
        (columns,) = groups.values()
        frame = pl.DataFrame(dict(columns))
        frame.write_parquet(path) if path.suffix == ".parquet" else frame.write_csv(path)
