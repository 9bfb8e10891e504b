"""Valid files of every format, which tests and the fuzzer damage."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from math import cos, pi, radians, sin
from pathlib import Path

import numpy as np

COUNT = 100
TIME = np.arange(COUNT) / 8.0
VALUES = np.random.default_rng(1).normal(size=(COUNT, 3))
VOLTS = VALUES[:, 0]


def texts() -> Iterator[bytes]:
    """Tables in several dialects."""
    rows = [(t, *row) for t, row in zip(TIME.tolist(), VALUES.tolist(), strict=True)]
    comma = "time;voltage;current\n[s];[V];[mA]\n" + "".join(
        ";".join(str(each).replace(".", ",") for each in row[:3]) + "\n" for row in rows
    )
    for head, line in (
        ("time,voltage [mV],note,counts\n", "{!r},{!r},x,7\n"),
        ("# written by hand\n  t    u\n", " {:8.3f} {:10.6f}\n"),
        ('"time","a, b"\r\n', '"{}","{}"\r\n'),
        ("Hoist\nDate\t2008/10/06\nX\tY\n", "{}\t{}\n"),
    ):
        yield (head + "".join(line.format(t, u) for t, u, *_ in rows)).encode()
    yield comma.encode()
    yield comma.encode("utf-16")


def parquet(path: Path, compression: str = "zstd") -> None:
    import polars as pl

    table = {
        "time": TIME,
        "voltage": [None, *VOLTS[1:].tolist()],
        "counts": np.arange(COUNT),
        "note": ["1.5"] * COUNT,
        "on": [True, False] * (COUNT // 2),
        "date": [datetime.datetime(2024, 1, 1)] * COUNT,
    }
    pl.DataFrame(table).write_parquet(path, compression=compression, row_group_size=16)


def matlab4(path: Path) -> None:
    import scipy.io

    scipy.io.savemat(path, {"time": TIME, "x": VALUES}, format="4")


def matlab5(path: Path, packed: bool = False) -> None:
    import scipy.io

    contents = {
        "time": TIME,
        "x": VALUES.T,
        "z": TIME * 1j,
        "i": np.arange(COUNT, dtype=np.int16),
        "s": {"t": TIME, "inner": {"y": VALUES}},
        "note": "text",
        "cell": np.array(["a"], dtype=object),
    }
    scipy.io.savemat(path, contents, do_compression=packed)


def matlab73(path: Path) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in {"t": TIME[:, None], "x": VALUES.T, "s/y": VALUES}.items():
            file[name] = array
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["note"] = np.frombuffer(b"text", np.uint8)
        file["note"].attrs["MATLAB_class"] = np.bytes_("char")
    content = bytearray(path.read_bytes())
    content[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(content)


def hdf5(path: Path, packed: bool = True) -> None:
    import h5py

    options = {"chunks": True, "compression": "gzip", "shuffle": True, "fletcher32": True}
    options = options if packed else {}
    with h5py.File(path, "w", libver="latest" if packed else "earliest") as file:
        file.attrs["operator"] = "me"
        file.create_dataset("time", data=TIME, **options).attrs["unit"] = "s"
        file.create_dataset("run/values", data=VALUES, **options)
        file.create_dataset("counts", data=np.arange(COUNT, dtype=np.int32), **options)
        file["table"] = np.rec.fromarrays([TIME, TIME], names="t,u")
        file["text"] = ["a", "b"]


def tdms(path: Path) -> None:
    from nptdms import ChannelObject, RootObject, TdmsWriter

    waveform = {"wf_increment": 0.125, "wf_start_offset": 0.0, "unit_string": "V"}
    with TdmsWriter(path) as writer:
        for _ in range(2):
            writer.write_segment(
                [
                    RootObject({"operator": "me"}),
                    ChannelObject("other", "note", ["a", "b"]),
                    ChannelObject("other", "stamp", np.array(["2024-01-01"] * 2, "M8[us]")),
                    ChannelObject("run", "counts", np.arange(COUNT, dtype=np.int16)),
                    ChannelObject("run", "voltage", VOLTS, waveform),
                ]
            )


def mdf(path: Path, compression: int = 0) -> None:
    from asammdf import MDF, Signal

    counts, scaled = np.arange(COUNT, dtype=np.uint16), {"a": 2.0, "b": 1.0}
    with MDF(version="4.10") as file:
        file.append(
            [
                Signal(VOLTS, TIME, name="voltage", unit="V"),
                Signal(counts, TIME, name="counts"),
                Signal(counts.astype(np.uint8), TIME, name="scaled", conversion=scaled),
            ]
        )
        file.append([Signal(VALUES[:9, 1], TIME[:9], name="pressure", unit="bar")])
        file.save(path, overwrite=True, compression=compression)


# --- transfer functions of ships ------------------------------------------------------------------

MOTIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
HEADINGS, OMEGAS = (0.0, 30.0, 90.0, 150.0, 180.0), (0.1, 0.2, 0.5)


def small_body(heading: float, omega: float) -> np.ndarray:
    """Motions of a body that goes with the water and along its slope, as any in a long wave."""
    k, c, s = omega**2 / 9.80665, cos(heading), sin(heading)
    return np.array([-1j * c, -1j * s, 1.0, -1j * k * s, 1j * k * c, 0.0])


def ship_table_lines(waves: Sequence[tuple[float, float]]) -> list[str]:
    """A table of the body's motions in waves of headings [deg] and frequencies."""
    parts = (f"{motion}_{part}" for motion in MOTIONS for part in ("re", "im"))
    lines = [",".join(["heading_deg", "omega", *parts])]
    for heading, omega in waves:
        motions = small_body(radians(heading), omega).tolist()
        numbers = [number for z in motions for number in (z.real, z.imag)]
        lines.append(",".join(map(repr, (heading, omega, *numbers))))
    return lines


def wamit_lines(waves: Sequence[tuple[float, float]]) -> list[str]:
    """The same as lines of WAMIT with a ULEN of 1 m."""
    lines = []
    for heading, omega in waves:
        for number, z in enumerate(small_body(radians(heading), omega).tolist(), 1):
            numbers = (2.0 * pi / omega, heading, number, abs(z), 0.0, z.real, z.imag)
            lines.append(" ".join(map(repr, numbers)))
    return lines


def capytaine(
    path: Path,
    headings: Sequence[float] = HEADINGS,
    omegas: Sequence[float] = OMEGAS,
    sign: float = -1.0,
) -> None:
    """The file that separate_complex_values and to_netcdf write, made by h5py."""
    import h5py

    table = np.array([[small_body(radians(h), w) for h in headings] for w in omegas])
    parts = np.stack([table.real, sign * table.imag])  # complex, omega, wave_direction, dof
    grids = {"omega": np.array(omegas), "wave_direction": np.radians(headings)}
    words = {"complex": ["re", "im"], "radiating_dof": [each.title() for each in MOTIONS]}
    with h5py.File(path, "w") as file:
        for name, values in (grids | words).items():
            text = h5py.string_dtype() if name in words else None
            file.create_dataset(name, data=values, dtype=text).make_scale(name)
        file["RAO"] = parts
        for n, axis in enumerate(("complex", "omega", "wave_direction", "radiating_dof")):
            file["RAO"].dims[n].attach_scale(file[axis])


def veres(path: Path) -> None:
    """The body at rest, as VERES writes motions."""
    lines = ["VERES", *["text"] * 8, f"1 {len(HEADINGS)} {len(OMEGAS)} 6", "0.0"]
    for heading in HEADINGS:
        lines.append(repr(heading))
        for omega in OMEGAS:
            lines.append(repr(omega))
            motions = small_body(radians(heading), omega).tolist()
            lines += [f"{n} {z.real!r} {z.imag!r}" for n, z in enumerate(motions, 1)]
    path.write_text("\n".join(lines), "utf-8")


def wamit(path: Path) -> None:
    path.write_text("\n".join(wamit_lines(list(product(HEADINGS, OMEGAS)))), "utf-8")


def ship_table(path: Path) -> None:
    path.write_text("\n".join(ship_table_lines(list(product(HEADINGS, OMEGAS)))), "utf-8")


# --- all of them ----------------------------------------------------------------------------------

COMPRESSIONS = ("uncompressed", "zstd", "snappy", "lz4", "gzip")
FORMATS: dict[str, tuple[str, Callable[..., None], list[tuple]]] = {
    "parquet": (".parquet", parquet, [(each,) for each in COMPRESSIONS]),
    "matlab4": (".mat", matlab4, [()]),
    "matlab5": (".mat", matlab5, [(False,), (True,)]),
    "matlab73": (".mat", matlab73, [()]),
    "hdf5": (".h5", hdf5, [(False,), (True,)]),
    "tdms": (".tdms", tdms, [()]),
    "mdf": (".mf4", mdf, list(product((0, 1, 2)))),
}
"""Ending, writer and its ways, by kind."""
SHIPS: dict[str, tuple[str, Callable[..., None], list[tuple]]] = {
    "capytaine": (".nc", capytaine, [()]),
    "veres": (".re1", veres, [()]),
    "wamit": (".4", wamit, [()]),
    "ship table": (".csv", ship_table, [()]),
}
"""The same of ships' transfer functions, which `read_ship` reads."""
KINDS = ("text", *FORMATS, *SHIPS)


def valid(kind: str, folder: Path) -> Iterator[Path]:
    """Write the valid files of a kind and yield them."""
    folder.mkdir(parents=True, exist_ok=True)
    if kind == "text":
        for number, content in enumerate(texts()):
            (folder / f"{number}.csv").write_bytes(content)
            yield folder / f"{number}.csv"
        return
    ending, write, ways = (FORMATS | SHIPS)[kind]
    for number, way in enumerate(ways):
        write(folder / f"{number}{ending}", *way)
        yield folder / f"{number}{ending}"
