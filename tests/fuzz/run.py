"""Fuzzing of all readers for some minutes: damaged files must end in one sentence, or be read.

    python tests/fuzz/run.py [--minutes 3] [--kind hdf5] [--seed 1]

Each kind is read in processes of its own, in turn until the time is over; every file is on disk
before it is read, so that it is there still if the process is not. Anything but numbers or one
sentence is a failure: another exception, a crash, gigabytes of memory for a file of kilobytes, a
file that takes too long. Hypothesis then looks for the smallest damage that does it; what fails is
kept in .hypothesis/fuzz and printed.
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

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from seeds import KINDS, valid

from swashplate import SwashplateError
from swashplate.logs import open_log

KEPT = Path(__file__).parents[2] / ".hypothesis" / "fuzz"
SLICE = 20.0  # seconds that a process fuzzes
PATIENCE = 80.0  # seconds that all of its files may take beyond that
GIGABYTE = 1 << 30
SHARE = 10**6  # positions are drawn as millionths of the file
BOUNDARIES = [0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63]

positions = st.one_of(st.integers(0, SHARE), st.integers(0, SHARE // 20))
changes = st.lists(
    st.one_of(
        st.tuples(st.just("flip"), positions, st.integers(1, 255)),
        st.tuples(st.just("set"), positions, st.binary(min_size=1, max_size=8)),
        st.tuples(
            st.just("number"),
            positions,
            st.tuples(
                st.sampled_from(BOUNDARIES),
                st.sampled_from([2, 4, 8]),
                st.sampled_from(["little", "big"]),
            ),
        ),
        st.tuples(st.just("cut"), positions, st.none()),
        st.tuples(st.just("remove"), positions, st.integers(1, 64)),
        st.tuples(st.just("insert"), positions, st.binary(min_size=1, max_size=64)),
        st.tuples(st.just("splice"), positions, positions),
    ),
    min_size=1,
    max_size=6,
)
cells = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.sampled_from(
        ["", " ", "NaN", "n/a", "-inf", "x", '"', '"1,5"', "1,5", "1.234,5", "#", "\0", "µ"]
    ),
    st.text(max_size=5),
)
delimiters = st.sampled_from([",", ";", "\t", " ", "  ", "|", ", "])
texts = st.builds(
    lambda rows, delimiter, end, encoding: end.join(delimiter.join(row) for row in rows).encode(
        encoding, "replace"
    ),
    st.lists(st.lists(cells, max_size=5), max_size=12),
    delimiters,
    st.sampled_from(["\n", "\r\n", "\r", "\n\n", "\n# comment\n"]),
    st.sampled_from(["utf-8", "utf-8-sig", "latin-1", "utf-16"]),
)


def damaged(content: bytes, others: list[bytes], steps: list[tuple]) -> bytes:
    """A file's content after these changes."""
    content = bytearray(content)
    for what, where, how in steps:
        place = where * len(content) // (SHARE + 1)
        if what == "flip" and content:
            content[place] ^= how
        elif what == "set":
            content[place : place + len(how)] = how
        elif what == "number":
            value, width, order = how
            content[place : place + width] = (value % 256**width).to_bytes(width, order)
        elif what == "cut":
            del content[place:]
        elif what == "remove":
            del content[place : place + how]
        elif what == "insert":
            content[place:place] = how
        elif what == "splice":
            other = others[where % len(others)]
            content[place:] = other[how * len(other) // (SHARE + 1) :]
    return bytes(content)


def read(path: Path, limited: bool) -> None:
    """Read all columns of a file, together and one by one."""
    try:
        log = open_log(path)
    except SwashplateError as error:
        check(path, error, limited)
        return
    names = [column.name for column in log.columns]
    for some in (names, *([name] for name in names[:5])):
        try:
            arrays = log.read(some)
        except SwashplateError as error:
            check(path, error, limited)
            continue
        for array in arrays.values():
            assert array.dtype == np.float64
            assert array.ndim == 1


def check(path: Path, error: SwashplateError, limited: bool) -> None:
    """One sentence that names the file, and did not ask for memory without bounds."""
    sentence = str(error)
    assert path.name in sentence, sentence
    assert sentence.endswith("."), sentence
    assert sentence.isprintable(), sentence
    if limited:
        assert "more memory than there is" not in sentence, sentence
    assert len(sentence) < 2000, len(sentence)


def work(kind: str, number: int, seconds: float, folder: Path) -> None:
    """Damage and read files of a kind for so many seconds."""
    # the others are read in a process that has a limit of its own
    limited = kind == "text"
    sources = list(valid(kind, folder / "valid"))
    for path in sources:
        assert open_log(path).columns, path  # warms up, too: what is imported needs memory as well
        read(path, limited)
    contents = [path.read_bytes() for path in sources]
    suffix = sources[0].suffix
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + 4 * GIGABYTE, used + 4 * GIGABYTE))
    made = st.tuples(st.sampled_from(contents), changes).map(
        lambda chosen: damaged(chosen[0], contents, chosen[1])
    )
    if kind == "text":
        made = st.one_of(made, texts)
    count = 0

    @settings(
        database=None,
        deadline=None,
        max_examples=100,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(made)
    def fuzz(content: bytes) -> None:
        nonlocal count
        count += 1
        path = folder / f"log{suffix}"
        path.unlink(missing_ok=True)
        path.write_bytes(content)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        read(path, limited)
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        assert grown * 1024 < GIGABYTE, f"{grown >> 10} MB for a file of {len(content)} bytes"

    end = time.monotonic() + seconds
    rounds = 0
    while time.monotonic() < end:
        try:
            seed(number * 1000 + rounds)(fuzz)()
        except Exception as error:
            error.__notes__ = []  # the file is kept: its bytes need not be printed
            raise
        rounds += 1
    print(f"{count} files")


# --- the process that starts the others -----------------------------------------------------------


def fuzz(kind: str, number: int, seconds: float, folder: Path) -> str:
    """Run one process; return what it said of its failure, empty if there was none."""
    words = [sys.executable, __file__, "--work", kind, str(number), str(seconds), str(folder)]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=seconds + PATIENCE)
    except subprocess.TimeoutExpired:
        return f"a file takes more than {PATIENCE:g} s"
    if done.returncode == 0:
        print(f"{kind:9} seed {number:4}: {done.stdout.strip()}", flush=True)
        return ""
    return f"exit code {done.returncode}\n{done.stderr[-4000:]}"


def main() -> int:
    """Fuzz until the time is over; the exit code is 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--kind", choices=KINDS, action="append")
    parser.add_argument("--seed", type=int, default=int(time.time()) % 100_000)
    options = parser.parse_args()
    end = time.monotonic() + 60.0 * options.minutes
    failures, number = 0, options.seed
    while time.monotonic() < end:
        for kind in options.kind or KINDS:
            left = end - time.monotonic()
            if left <= 0.0:
                break
            with tempfile.TemporaryDirectory() as made:
                said = fuzz(kind, number, min(SLICE, left), Path(made))
                for path in Path(made).glob("log.*") if said else ():
                    KEPT.mkdir(parents=True, exist_ok=True)
                    kept = shutil.copy(path, KEPT / f"{kind}-{number}{path.suffix}")
                    print(f"{kind} failed, the file is kept as {kept}:")
            if said:
                failures += 1
                print(said, flush=True)
        number += 1
    print(f"{failures} failures." if failures else "Nothing failed.")
    return int(failures > 0)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--work"]:
        work(sys.argv[2], int(sys.argv[3]), float(sys.argv[4]), Path(sys.argv[5]))
    else:
        sys.exit(main())
