"""Damages valid files of one kind and reads them: a process of its own, which may die of it.

    python tests/fuzz/worker.py KIND SEED SECONDS FOLDER

Every file is on disk before it is read, so that it is there still if the process is not. Anything
but numbers or one sentence is a failure: another exception, a sentence in several lines, gigabytes
of memory for a file of kilobytes. Hypothesis then looks for the smallest damage that does it.
"""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from seeds import valid

from swashplate import SwashplateError
from swashplate.logs import open_log

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


def main(kind: str, number: int, seconds: float, folder: Path) -> None:
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


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), Path(sys.argv[4]))
