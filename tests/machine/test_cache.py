"""Machine code on disk: kept as long as what it follows from is unchanged."""

import os
import subprocess
import sys
from pathlib import Path
from time import time

import pytest
from tests.machine.test_machine_code import MACHINE

from swashplate.machine import equation, source
from swashplate.machine.cache import DAY, MOST_BYTES
from swashplate.machine.declaration import closure, closure_hash

SLOPE = 2.0


def python(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """A process of its own."""
    return subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "SWASHPLATE_COMPILE": "1", **environment},
    )


# --- closures -------------------------------------------------------------------------------------


@equation
def line(x: float) -> float:
    return SLOPE * x


@equation
def bend(x: float) -> float:
    return line(x) * line(x + 1.0)


def test_closure_names_what_is_reached() -> None:
    reached = closure(bend)
    assert list(reached) == ["bend", "line", "SLOPE"]
    assert reached["SLOPE"] == 2.0
    assert closure_hash(bend) == closure_hash(bend) != closure_hash(line)


def test_source_of_an_equation() -> None:
    assert source(bend).startswith("@equation\ndef bend(")


# --- machine code of models -----------------------------------------------------------------------

MARCH = """
import sys
sys.path.insert(0, sys.argv[1])
import lag
from swashplate.machine import Machine, simulate
run = simulate(Machine(lag.rod, lag.Lag(0.5)), {"command": [1.0, 1.0, 1.0]}, 100.0)
print(run["position"].tolist())
"""


def march(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    (folder / "lag.py").write_text(MACHINE)
    return python("-c", MARCH, str(folder), **environment)


def files(folder: Path, *names: str, age: float = 0.0, size: int = 10) -> None:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_bytes(b"x" * size)
        os.utime(folder / name, (time() - age, time() - age))


@pytest.mark.slow
def test_the_folder_is_tidied_once_a_day_and_use_counts(tmp_path: Path) -> None:
    kept = tmp_path / "cache" / "swashplate_generated"
    environment = {"SWASHPLATE_CACHE_DIR": str(tmp_path / "cache")}
    march(tmp_path, **environment)
    files(kept, "old_1.pickle", age=1000.0 * DAY)
    files(kept, "old_1.march_code", age=1000.0 * DAY)
    (own,) = kept.glob("rod_march_code_*")
    os.utime(own, (0.0, 0.0))
    march(tmp_path, **environment)  # nothing new
    assert time() - own.stat().st_mtime < DAY
    assert (kept / "old_1.pickle").exists()
    own.unlink()
    march(tmp_path, **environment)  # tidied already today
    assert (kept / "old_1.pickle").exists()
    own.unlink()
    os.utime(kept / "tidied", (0.0, 0.0))
    march(tmp_path, **environment)
    assert not [*(tmp_path / "cache").rglob("old_1.*")]
    assert own.exists()


@pytest.mark.slow
def test_the_oldest_beyond_the_bound_are_removed(tmp_path: Path) -> None:
    kept = tmp_path / "cache" / "swashplate_generated"
    environment = {"SWASHPLATE_CACHE_DIR": str(tmp_path / "cache")}
    march(tmp_path, **environment)
    files(kept, "new.kept", age=2.0 * DAY)
    files(kept, "old.kept", age=3.0 * DAY)
    for name in ("new.kept", "old.kept"):  # without taking the room
        with (kept / name).open("r+b") as file:
            file.truncate(MOST_BYTES - 1_000_000)
        os.utime(kept / name, (0.0, time() - (2.0 if name[0] == "n" else 3.0) * DAY))
    os.utime(kept / "tidied", (0.0, 0.0))
    for own in kept.glob("rod_march_code_*"):
        own.unlink()
    march(tmp_path, **environment)
    assert (kept / "new.kept").exists()
    assert not (kept / "old.kept").exists()


@pytest.mark.slow
def test_nothing_is_compiled_if_told_so(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    done = march(tmp_path, SWASHPLATE_CACHE_DIR=str(cache), SWASHPLATE_COMPILE="0")
    assert done.stdout == "[0.0, 0.5, 0.75]\n"
    assert not [*cache.rglob("*_code_*")]


@pytest.mark.slow
def test_code_is_for_the_processor_that_is_told(tmp_path: Path) -> None:
    cache = {"SWASHPLATE_CACHE_DIR": str(tmp_path / "cache")}
    for processor in ("", "generic"):
        assert march(tmp_path, **cache, SWASHPLATE_CPU=processor).returncode == 0
    assert len([*(tmp_path / "cache").rglob("rod_march_code_*")]) == 2
