"""Machine code on disk: kept as long as what it follows from is unchanged."""

import json
import os
import subprocess
import sys
from pathlib import Path
from time import time
from typing import Any

import pytest
from tests.machine.test_machine_code import MACHINE

from swashplate.machine import equation, source
from swashplate.machine.cache import DAY, MOST_BYTES
from swashplate.machine.declaration import closure, closure_hash

SLOPE = 2.0

EQUATIONS = '''
"""Two kernels of three equations."""
from typing import NamedTuple

from swashplate.machine import equation, kernel

GAIN = 2.0


class Spring(NamedTuple):
    stiffness: float


@equation
def pull(x: float, s: Spring) -> float:
    """Docstring."""
    return GAIN * s.stiffness * x


@equation
def push(x: float) -> float:
    return x + 1.0


@equation
def both(x: float, s: Spring) -> float:
    return pull(x, s) + push(x)


@kernel
def inner(x, s):
    return both(x, s)


@kernel
def march(n, s):
    total = 0.0
    for i in range(n):
        total += inner(i * 1.0, s)
    return total


@kernel
def other(n):
    return push(n * 1.0)
'''

RUN = """
import json, sys
sys.path.insert(0, sys.argv[1])
import machine
from swashplate.machine.declaration import closure_hash
s = machine.Spring(3.0)
out = {"march": machine.march(4, s), "other": machine.other(4)}
for name in ("march", "other"):
    stats = getattr(machine, name).stats
    out[name + " hits"] = sum(stats.cache_hits.values())
    out[name + " hash"] = closure_hash(getattr(machine, name))
print(json.dumps(out))
"""


def python(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """A process of its own."""
    return subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "SWASHPLATE_COMPILE": "1", **environment},
    )


def run(folder: Path, text: str = EQUATIONS) -> dict[str, Any]:
    """Values and cache hits of the kernels in a process of their own."""
    (folder / "machine.py").write_text(text)
    os.utime(folder / "machine.py", (1e9, 1e9))  # the stamp that Numba itself would look at
    more = {"SWASHPLATE_CACHE_DIR": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    return json.loads(python("-c", RUN, str(folder), **more).stdout)


@pytest.mark.slow
def test_kernels_are_kept_until_what_they_reach_changes(tmp_path: Path) -> None:
    first = run(tmp_path)
    assert (first["march"], first["march hits"]) == (46.0, 0)
    again = run(tmp_path)
    assert (again["march"], again["march hits"], again["other hits"]) == (46.0, 1, 1)

    remarked = run(tmp_path, EQUATIONS.replace("Docstring", "Another docstring"))
    assert (remarked["march hits"], remarked["other hits"]) == (1, 1)

    changed = run(tmp_path, EQUATIONS.replace("GAIN * s", "4.0 * s"))
    assert (changed["march"], changed["march hits"], changed["other hits"]) == (82.0, 0, 1)
    assert changed["march hash"] != first["march hash"]
    assert changed["other hash"] == first["other hash"]

    constant = run(tmp_path, EQUATIONS.replace("GAIN = 2.0", "GAIN = 3.0"))
    assert (constant["march"], constant["march hits"], constant["other hits"]) == (64.0, 0, 1)


@pytest.mark.slow
def test_damaged_files_are_dropped(tmp_path: Path) -> None:
    run(tmp_path)
    for pattern, damaged in (
        ("*.nbi", lambda content: b""),
        ("*.nbc", lambda content: content[: len(content) // 2]),
        ("*.nbc", lambda content: b"\x80\x05" + bytes(range(256)) * 8),
        ("*.nbc", lambda content: content[:-9] + bytes([content[-9] ^ 1]) + content[-8:]),
    ):
        for path in (tmp_path / "cache").rglob(pattern):
            path.write_bytes(damaged(path.read_bytes()))
        after = run(tmp_path)
        assert (after["march"], after["march hits"]) == (46.0, 0)
    again = run(tmp_path)
    assert (again["march"], again["march hits"], again["other hits"]) == (46.0, 1, 1)


BYTEARRAY = b"\x80\x05\x96" + (1 << 20).to_bytes(8, "little") + b"x" * 64
"""The beginning of a pickle that Python's own reader stumbles over on its way out."""


@pytest.mark.slow
def test_a_garbled_index_is_not_unpickled(tmp_path: Path) -> None:
    run(tmp_path)
    environment = {"SWASHPLATE_CACHE_DIR": str(tmp_path / "cache")}
    for garbled in (BYTEARRAY, b"cos\nsystem\n(S'echo run >&2'\ntR.", bytes(range(256))):
        for path in (tmp_path / "cache").rglob("*.nbi"):
            path.write_bytes(garbled)
        done = python("-c", RUN, str(tmp_path), **environment)
        assert json.loads(done.stdout)["march"] == 46.0
        assert done.stderr == ""


@pytest.mark.slow
def test_a_folder_in_the_place_of_machine_code(tmp_path: Path) -> None:
    """The kernel is compiled, and a warning names what is in the way."""
    run(tmp_path)
    paths = [*(tmp_path / "cache").rglob("machine.march-*.nbc")]
    for path in paths:
        path.unlink()
        path.mkdir()
    done = python(
        "-c",
        RUN,
        str(tmp_path),
        SWASHPLATE_CACHE_DIR=str(tmp_path / "cache"),
        PYTHONWARNINGS="default",
    )
    assert json.loads(done.stdout)["march"] == 46.0
    assert len(paths) == 1
    assert str(paths[0]) in done.stderr


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
    files(tmp_path / "cache" / "swashplate_generated_1a", "old_1.march-3.nbi", age=1000.0 * DAY)
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


MADE_TWICE = """
import sys
from swashplate.machine import equation, kernel

@equation
def twice(x: float) -> float:
    return 2.0 * x

@equation
def thrice(x: float) -> float:
    return 3.0 * x

def summed(of):
    @kernel
    def loop(n):
        total = 0.0
        for i in range(n):
            total += of(float(i))
        return total
    return loop

loops = [summed(twice), summed(thrice)]
print([loop(4) for loop in loops], sum(sum(l.stats.cache_hits.values()) for l in loops))
"""


@pytest.mark.slow
def test_kernels_around_compiled_functions_are_kept_apart(tmp_path: Path) -> None:
    script = tmp_path / "made_twice.py"
    script.write_text(MADE_TWICE, "utf-8")
    cache = {"SWASHPLATE_CACHE_DIR": str(tmp_path / "cache")}
    said = [python(str(script), **cache).stdout.split("]") for _ in range(2)]
    assert [each[0] for each in said] == ["[12.0, 18.0"] * 2
    assert [int(each[1]) for each in said] == [0, 2]


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
