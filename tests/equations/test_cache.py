"""Machine code and generated modules on disk: kept as long as what they reach is unchanged."""

import inspect
import json
import os
import subprocess
import sys
import traceback
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import time
from typing import Any

import numpy as np
import pytest

from swashplate.equations import (
    closure,
    closure_hash,
    derive,
    equation,
    generated,
    kernel,
    source,
)
from swashplate.equations.cache import DAY, UNCACHED

SLOPE = 2.0

EQUATIONS = '''
"""Two kernels of three equations."""
from typing import NamedTuple

from swashplate.equations import equation, kernel

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
from swashplate.equations import closure_hash
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
        env={**os.environ, "NUMBA_DISABLE_JIT": "0", **environment},
    )


def run(folder: Path, text: str = EQUATIONS) -> dict[str, Any]:
    """Values and cache hits of the kernels in a process of their own."""
    (folder / "machine.py").write_text(text)
    os.utime(folder / "machine.py", (1e9, 1e9))  # the stamp that Numba itself would look at
    more = {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
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
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
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
        NUMBA_CACHE_DIR=str(tmp_path / "cache"),
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


def test_source_of_an_equation_and_of_what_is_derived() -> None:
    assert source(line).startswith("@equation\ndef line(x: float)")
    derived = derive(bend, "x")
    assert source(derived) == derived.texts["bend_by_x"]
    assert inspect.getsource(derived.python) == derived.source
    assert derived.source.isascii()


# --- generated modules ----------------------------------------------------------------------------

MODULE = '''
@inlined
{derived}

@kernel
def fill(x, out):
    """Filled."""
    for i in range(x.size):
        out[i, 0], out[i, 1] = bend_by_x(x[i])


def failing():
    raise ValueError("here")
'''


def made() -> dict[str, Any]:
    from swashplate.equations import inlined

    derived = derive(bend, "x")
    texts = "\n\n@inlined\n".join(derived.texts.values())
    names = {**derived.names, "kernel": kernel, "inlined": inlined}
    return generated("bends", MODULE.format(derived=texts), names)


@pytest.mark.interpreted
def test_a_generated_module_computes_and_can_be_read() -> None:
    space = made()
    x, out = np.array([1.0, 2.0]), np.zeros((2, 2))
    space["fill"](x, out)
    assert out.tolist() == [[8.0, 12.0], [24.0, 20.0]]
    path = Path(space["__file__"])
    assert path.name.startswith("bends_")
    assert "def fill(x, out):" in path.read_text()
    assert inspect.getsource(space["failing"]) == 'def failing():\n    raise ValueError("here")\n'
    with pytest.raises(ValueError, match="here") as raised:
        space["failing"]()
    assert 'raise ValueError("here")' in "".join(traceback.format_tb(raised.value.__traceback__))
    assert made()["__file__"] == space["__file__"]
    assert not list(path.parent.glob("*.tmp"))


GENERATE = """
import sys
import numpy as np
from swashplate.equations import derive, generated, inlined, kernel
sys.path.insert(0, sys.argv[1])
import machine
d = derive(machine.both, ("x", "s"))
texts = "\\n".join("@inlined\\n" + t for t in d.texts.values())
text = texts + "\\n@kernel\\ndef fill(x, s):\\n    return " + d.name + "(x, s)\\n"
space = generated("machine", text, {**d.names, "inlined": inlined, "kernel": kernel})
print(space["fill"](2.0, machine.Spring(3.0)), sum(space["fill"].stats.cache_hits.values()))
"""


def generate(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    (folder / "machine.py").write_text(EQUATIONS)
    return python("-c", GENERATE, str(folder), **environment)


@pytest.mark.slow
def test_a_second_process_compiles_nothing(tmp_path: Path) -> None:
    cache = str(tmp_path / "cache")
    assert generate(tmp_path, NUMBA_CACHE_DIR=cache).stdout == "(15.0, 7.0, 4.0) 0\n"
    assert generate(tmp_path, NUMBA_CACHE_DIR=cache).stdout == "(15.0, 7.0, 4.0) 1\n"
    assert len(list((tmp_path / "cache" / "swashplate_generated").glob("*.py"))) == 1


@pytest.mark.slow
def test_many_workers_at_once(tmp_path: Path) -> None:
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    with ThreadPoolExecutor(3) as pool:
        workers = [pool.submit(generate, tmp_path, **cache) for _ in range(3)]
    assert all(each.result().stdout.startswith("(15.0, 7.0, 4.0)") for each in workers)


def files(folder: Path, *names: str, age: float = 0.0, size: int = 10) -> None:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_bytes(b"x" * size)
        os.utime(folder / name, (time() - age, time() - age))


@pytest.mark.slow
def test_the_folder_is_tidied_once_a_day_and_use_counts(tmp_path: Path) -> None:
    modules = tmp_path / "cache" / "swashplate_generated"
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    generate(tmp_path, **environment)
    files(modules, "old_1.py", age=1000.0 * DAY)
    files(tmp_path / "cache" / "swashplate_generated_1a", "old_1.march-3.nbi", age=1000.0 * DAY)
    (own,) = modules.glob("machine_*.py")
    os.utime(own, (0.0, 0.0))
    generate(tmp_path, **environment)  # nothing new
    assert time() - own.stat().st_mtime < DAY
    assert (modules / "old_1.py").exists()
    own.unlink()
    generate(tmp_path, **environment)  # tidied already today
    assert (modules / "old_1.py").exists()
    own.unlink()
    os.utime(modules / "tidied", (0.0, 0.0))
    generate(tmp_path, **environment)
    assert not [*(tmp_path / "cache").rglob("old_1.*")]
    assert own.exists()


MADE_TWICE = """
import sys
from swashplate.equations import equation, kernel

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
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    said = [python(str(script), **cache).stdout.split("]") for _ in range(2)]
    assert [each[0] for each in said] == ["[12.0, 18.0"] * 2
    assert [int(each[1]) for each in said] == [0, 2]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a file is not a folder anywhere, but said otherwise")
def test_without_a_place_it_works_with_a_warning(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "temporary").mkdir()
    done = generate(
        tmp_path,
        NUMBA_CACHE_DIR=str(tmp_path / "file"),
        TMPDIR=str(tmp_path / "temporary"),
        PYTHONWARNINGS="default",
    )
    assert done.stdout.startswith("(15.0, 7.0, 4.0)")
    assert UNCACHED in done.stderr
    assert not [*(tmp_path / "temporary").iterdir()]  # nothing is left behind
