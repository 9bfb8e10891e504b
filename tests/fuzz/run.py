"""Fuzzing of all readers for some minutes: damaged files must end in one sentence, or be read.

Logs are damaged byte by byte; campaigns, drives, fit setups and cranes also by what nobody
writes, such as keys of 20,000 parts, with logs whose headers have units that are none.

    python tests/fuzz/run.py [--minutes 3] [--kind hdf5] [--seed 1]

Each kind is read in processes of its own, in turn until the time is over; every file is on disk
before it is read, so that it is there still if the process is not. Anything but numbers or one
sentence is a failure: another exception, a crash, gigabytes of memory for a file of kilobytes, a
file that takes too long. What fails is kept in .hypothesis/fuzz and printed.
"""

from __future__ import annotations

import argparse
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import documents
import numpy as np
from seeds import KINDS as LOGS
from seeds import SHIPS, valid

from swashplate import SwashplateError
from swashplate.crane import read_ship
from swashplate.logs import open_log

KINDS = (*LOGS, *documents.READERS)
KEPT = Path(__file__).parents[2] / ".hypothesis" / "fuzz"
SLICE = 20.0  # seconds that a process fuzzes
PATIENCE = 80.0  # seconds that all of its files may take beyond that
GIGABYTE = 1 << 30
BOUNDARIES = [0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63]
CELLS = ["", " ", "NaN", "n/a", "-inf", "x", '"', '"1,5"', "1,5", "1.234,5", "#", "\0", "µ", "12:0"]


def damaged(content: bytes, others: list[bytes], random: np.random.Generator) -> bytes:
    """A file's content after one to six changes, half of them near its beginning."""
    found = bytearray(content)
    for _ in range(random.integers(1, 7)):
        share = random.random() * random.choice([0.05, 1.0])
        place = int(share * len(found))
        some = random.bytes(int(random.integers(1, 64)))
        number, width = int(random.choice(BOUNDARIES)), int(random.choice([2, 4, 8]))
        what = random.integers(7)
        if what == 0 and found:
            found[place] ^= 1 + some[0] % 255
        elif what == 1:
            found[place : place + 8] = some[:8]
        elif what == 2:
            order = "little" if some[0] % 2 else "big"
            found[place : place + width] = (number % 256**width).to_bytes(width, order)
        elif what == 3:
            del found[place:]
        elif what == 4:
            del found[place : place + len(some)]
        elif what == 5:
            found[place:place] = some
        else:
            other = others[random.integers(len(others))]
            found[place:] = other[int(random.random() * len(other)) :]
    return bytes(found)


def written(random: np.random.Generator) -> bytes:
    """Text that looks like a log, in some dialect, with cells of all kinds."""
    cells = [*CELLS, *map(repr, random.normal(size=8).tolist()), "7", "-3"]
    delimiter = random.choice([",", ";", "\t", " ", "  ", "|", ", "])
    end = random.choice(["\n", "\r\n", "\r", "\n\n", "\n# comment\n"])
    rows = random.integers(12)
    text = end.join(delimiter.join(random.choice(cells, random.integers(5))) for _ in range(rows))
    return text.encode(str(random.choice(["utf-8", "utf-8-sig", "latin-1", "utf-16"])), "replace")


def read(path: Path, limited: bool) -> None:
    """Read a file's columns, together and one by one: numbers, or one sentence that names it."""
    try:
        log = open_log(path)
        names = [column.name for column in log.columns]
    except SwashplateError as error:
        check(path, error, limited)
        return
    for some in (names, *([name] for name in names[:5])):
        try:
            for array in log.read(some).values():
                assert (array.dtype, array.ndim) == (np.float64, 1)
        except SwashplateError as error:
            check(path, error, limited)


def read_of_ship(path: Path, limited: bool) -> None:
    """Read a ship's transfer functions: finite numbers, or one sentence that names the file."""
    try:
        ship = read_ship(path, 1.0 if path.suffix == ".4" else None)
    except SwashplateError as error:
        check(path, error, limited)
        return
    assert np.isfinite(ship.values).all()
    assert np.isfinite(ship.frequencies).all()


def check(path: Path, error: SwashplateError, limited: bool) -> None:
    """One sentence that names the file, and did not ask for memory without bounds."""
    sentence = str(error)
    assert path.name in sentence, sentence
    assert sentence.endswith("."), sentence
    assert sentence.isprintable(), sentence
    assert not (limited and "more memory than there is" in sentence), sentence
    assert len(sentence) < 2000, len(sentence)


def work(kind: str, number: int, seconds: float, folder: Path) -> None:
    """Damage and read files of a kind for so many seconds."""
    if kind in documents.READERS:
        work_on_documents(kind, number, seconds, folder)
        return
    # the others are read in a process that has a limit of its own
    limited = kind in ("text", "veres", "wamit", "ship table")
    sources, reader = list(valid(kind, folder / "valid")), read_of_ship if kind in SHIPS else read
    for path in sources:
        # warms up, too: what is imported needs memory as well
        assert kind in SHIPS or open_log(path).columns, path
        reader(path, limited)
    contents = [path.read_bytes() for path in sources]
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + 4 * GIGABYTE, used + 4 * GIGABYTE))
    random, count, end = np.random.default_rng(number), 0, time.monotonic() + seconds
    path = folder / f"log{sources[0].suffix}"
    while time.monotonic() < end:
        content = damaged(contents[random.integers(len(contents))], contents, random)
        if kind == "text" and random.random() < 0.5:
            content = written(random)
        path.unlink(missing_ok=True)
        path.write_bytes(content)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        reader(path, limited)
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        assert grown * 1024 < GIGABYTE, f"{grown >> 10} MB for a file of {len(content)} bytes"
        count += 1
    print(f"{count} files")


def work_on_documents(kind: str, number: int, seconds: float, folder: Path) -> None:
    """Spoil and read documents of a kind for so many seconds."""
    random, count = np.random.default_rng(number), 0
    text = documents.valid(kind, folder)
    documents.read_document(kind, folder, text, random)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        name = folder / f"log{Path(documents.READERS[kind][0]).suffix}"
        spoiled = documents.spoiled(text, random)
        name.write_text(spoiled, "utf-8")  # what is kept if it fails
        documents.read_document(kind, folder, spoiled, random)
        count += 1
    print(f"{count} files")


def main() -> int:
    """Fuzz until the time is over; the exit code is 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--kind", choices=KINDS, action="append")
    parser.add_argument("--seed", type=int, default=int(time.time()) % 100_000)
    options = parser.parse_args()
    end, failures, number = time.monotonic() + 60.0 * options.minutes, 0, options.seed
    while time.monotonic() < end:
        for kind in options.kind or KINDS:
            seconds = min(SLICE, end - time.monotonic())
            if seconds <= 0.0:
                break
            with tempfile.TemporaryDirectory() as made:
                words = [sys.executable, __file__, "--work", kind, str(number), str(seconds), made]
                try:
                    done = subprocess.run(
                        words, capture_output=True, text=True, timeout=seconds + PATIENCE
                    )
                    said = done.stderr[-4000:] if done.returncode else ""
                except subprocess.TimeoutExpired:
                    said = f"a file takes more than {PATIENCE:g} s"
                if not said:
                    print(f"{kind:9} seed {number:4}: {done.stdout.strip()}", flush=True)
                    continue
                failures += 1
                for path in Path(made).glob("log.*"):
                    KEPT.mkdir(parents=True, exist_ok=True)
                    kept = shutil.copy(path, KEPT / f"{kind}-{number}{path.suffix}")
                    print(f"{kind} failed, the file is kept as {kept}:")
                print(said, flush=True)
        number += 1
    print(f"{failures} failures." if failures else "Nothing failed.")
    return int(failures > 0)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--work"]:
        work(sys.argv[2], int(sys.argv[3]), float(sys.argv[4]), Path(sys.argv[5]))
    else:
        sys.exit(main())
