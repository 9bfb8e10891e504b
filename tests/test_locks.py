"""A folder that one process writes into at a time."""

import os
import platform
import signal
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from swashplate import FileError, locks
from swashplate.locks import NAME, locked

HOLD = """
import sys
from pathlib import Path
from swashplate.locks import locked
with locked(Path(sys.argv[1])):
    print("locked", flush=True)
    sys.stdin.read()
"""


def holder(folder: Path) -> subprocess.Popen[str]:
    """A process that has locked a folder until its input ends."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "locked\n"
    return process


def test_the_second_is_told_who_the_first_is(tmp_path: Path) -> None:
    folder = tmp_path / "results" / "fitted"
    process = holder(folder)
    with pytest.raises(FileError) as refused, locked(folder):
        pass
    sentence = str(refused.value)
    for words in (str(folder), f"process {process.pid}", platform.node(), "since 2", "--out"):
        assert words in sentence
    process.communicate("")
    with locked(folder):
        assert (folder / NAME).is_file()
    assert not [*tmp_path.iterdir()]  # made for the lock, and nothing was written


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_a_process_that_was_killed_keeps_nobody_out(tmp_path: Path) -> None:
    process = holder(tmp_path)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert (tmp_path / NAME).is_file()
    with locked(tmp_path):
        pass
    assert not [*tmp_path.iterdir()]


def in_a_thread(folder: Path) -> str:
    """The sentence that another thread meets which locks a folder; empty if it can."""

    def lock() -> str:
        try:
            with locked(folder):
                return ""
        except FileError as error:
            return str(error)

    with ThreadPoolExecutor(1) as threads:
        return threads.submit(lock).result()


def test_within_a_process_and_whatever_the_file_says(tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(b"\x1b[31m\xff")
    with locked(tmp_path):
        (tmp_path / NAME).write_bytes(b"\x1b[31m\xff")
        sentence = in_a_thread(tmp_path)
        assert "another process is writing" in sentence
        assert sentence.isprintable()
        # the thread that has the lock may lock again, which leaves the first lock
        with locked(tmp_path / "." / ".." / tmp_path.name):
            pass
        assert in_a_thread(tmp_path)
    assert not in_a_thread(tmp_path)
    (tmp_path / "kept.txt").write_text("")
    with pytest.raises(KeyError), locked(tmp_path):
        raise KeyError
    with locked(tmp_path):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["kept.txt"]


def test_a_file_system_without_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(handle: int) -> None:
        raise OSError(37, "No locks available")

    monkeypatch.setattr(locks, "_lock", refuse)
    with pytest.warns(RuntimeWarning, match="No locks available"), locked(tmp_path):
        pass
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with locked(tmp_path), locked(tmp_path):
            pass


def test_a_place_that_cannot_be_locked(tmp_path: Path) -> None:
    (tmp_path / NAME).mkdir()
    with pytest.raises(FileError, match=f"{tmp_path.name}.* locked"), locked(tmp_path):
        pass
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match=r"file.fitted"), locked(tmp_path / "file" / "fitted"):
        pass
