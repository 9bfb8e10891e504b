"""Valid files of every format, from which the fuzzer makes damaged ones."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from pathlib import Path

import numpy as np

COUNT = 40
TIME = np.arange(COUNT) / 8.0
VALUES = np.random.default_rng(1).normal(size=(COUNT, 3))


def valid(kind: str, folder: Path) -> Iterator[Path]:
    """Write the valid files of a kind and yield them."""
    folder.mkdir(parents=True, exist_ok=True)
    yield from KINDS[kind](folder)


def _text(folder: Path) -> Iterator[Path]:
    rows = [(t, *row) for t, row in zip(TIME.tolist(), VALUES.tolist(), strict=True)]
    plain = "time,voltage [mV],note,counts\n" + "".join(
        f"{t!r},{v!r},x,{i}\n" for i, (t, v, *_) in enumerate(rows)
    )
    comma = "time;voltage;current\n[s];[V];[mA]\n" + "".join(
        ";".join(str(each).replace(".", ",") for each in row[:3]) + "\n" for row in rows
    )
    spaced = "# written by hand\n  t    u\n" + "".join(
        f" {t:8.3f} {u:10.6f}\n" for t, u, *_ in rows
    )
    quoted = '"time","a, b"\r\n' + "".join(f'"{t}","{u}"\r\n' for t, u, *_ in rows)
    tabbed = "Hoist\nDate\t2008/10/06\nX\tY\n" + "".join(f"{t}\t{u}\n" for t, u, *_ in rows)
    for number, text in enumerate((plain, comma, spaced, quoted, tabbed)):
        path = folder / f"{number}.csv"
        path.write_bytes(text.encode())
        yield path
    path = folder / "wide.csv"
    path.write_bytes(comma.encode("utf-16"))
    yield path


def _parquet(folder: Path) -> Iterator[Path]:
    import polars as pl

    table = pl.DataFrame(
        {
            "time": TIME,
            "voltage": [None, *VALUES[1:, 0].tolist()],
            "counts": np.arange(COUNT),
            "note": ["1.5"] * COUNT,
            "on": [True, False] * (COUNT // 2),
            "date": [datetime.datetime(2024, 1, 1)] * COUNT,
        }
    )
    for form in ("uncompressed", "zstd", "snappy", "lz4", "gzip"):
        path = folder / f"{form}.parquet"
        table.write_parquet(path, compression=form, row_group_size=16)
        yield path


def _matlab4(folder: Path) -> Iterator[Path]:
    import scipy.io

    path = folder / "four.mat"
    scipy.io.savemat(path, {"t": TIME, "x": VALUES}, format="4")
    yield path


def _matlab5(folder: Path) -> Iterator[Path]:
    import scipy.io

    contents = {
        "t": TIME,
        "x": VALUES.T,
        "i": np.arange(COUNT, dtype=np.int16),
        "s": {"t": TIME, "inner": {"y": VALUES}},
        "note": "text",
        "cell": np.array([1.0, "a"], dtype=object),
    }
    for packed in (False, True):
        path = folder / f"five-{packed}.mat"
        scipy.io.savemat(path, contents, do_compression=packed)
        yield path


def _matlab73(folder: Path) -> Iterator[Path]:
    import h5py

    path = folder / "seven.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in {"t": TIME[:, None], "x": VALUES.T, "s/y": VALUES}.items():
            file[name] = array
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["note"] = np.frombuffer(b"text", np.uint8)
        file["note"].attrs["MATLAB_class"] = np.bytes_("char")
    content = bytearray(path.read_bytes())
    content[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(content)
    yield path


def _hdf5(folder: Path) -> Iterator[Path]:
    import h5py

    for number, options in enumerate(
        ({}, {"chunks": True, "compression": "gzip", "shuffle": True, "fletcher32": True})
    ):
        path = folder / f"{number}.h5"
        with h5py.File(path, "w", libver="latest" if number else "earliest") as file:
            file.attrs["operator"] = "me"
            file.create_dataset("run/time", data=TIME, **options).attrs["unit"] = "s"
            file.create_dataset("run/values", data=VALUES, **options)
            file.create_dataset("counts", data=np.arange(COUNT, dtype=np.int32), **options)
            file["table"] = np.rec.fromarrays([TIME, TIME], names="t,u")
            file["text"] = ["a", "b"]
        yield path


def _tdms(folder: Path) -> Iterator[Path]:
    from nptdms import ChannelObject, RootObject, TdmsWriter

    path = folder / "log.tdms"
    waveform = {"wf_increment": 0.125, "wf_start_offset": 0.0, "unit_string": "V"}
    with TdmsWriter(path) as writer:
        for _ in range(2):
            writer.write_segment(
                [
                    RootObject({"operator": "me"}),
                    ChannelObject("run", "voltage", VALUES[:, 0], waveform),
                    ChannelObject("run", "counts", np.arange(COUNT, dtype=np.int16)),
                    ChannelObject("other", "note", ["a", "b"]),
                    ChannelObject("other", "stamp", np.array(["2024-01-01"] * 2, "M8[us]")),
                ]
            )
    yield path


def _mdf(folder: Path) -> Iterator[Path]:
    from asammdf import MDF, Signal

    for compression in (0, 1, 2):
        path = folder / f"{compression}.mf4"
        with MDF(version="4.10") as file:
            file.append(
                [
                    Signal(VALUES[:, 0], TIME, name="voltage", unit="V"),
                    Signal(np.arange(COUNT, dtype=np.uint16), TIME, name="counts"),
                    Signal(
                        np.arange(COUNT, dtype=np.uint8),
                        TIME,
                        name="scaled",
                        conversion={"a": 2.0, "b": 1.0},
                    ),
                ]
            )
            file.append([Signal(VALUES[:9, 1], TIME[:9], name="pressure", unit="bar")])
            file.save(path, overwrite=True, compression=compression)
        yield path


KINDS = {
    "text": _text,
    "parquet": _parquet,
    "matlab4": _matlab4,
    "matlab5": _matlab5,
    "matlab73": _matlab73,
    "hdf5": _hdf5,
    "tdms": _tdms,
    "mdf": _mdf,
}
