"""Machine code of pieces on disk: made once, found again, made again if damaged."""

import os
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

MACHINE = """
from typing import NamedTuple

from swashplate.machine import Model, equation


class Lag(NamedTuple):
    share: float


class Rod(NamedTuple):
    position: float


@equation
def step(state: Rod, command: float, p: Lag, h: float) -> Rod:
    return Rod(state.position + p.share * (command - state.position))


rod = Model("rod", parameters=Lag, state=Rod, step=step)
"""
RUN = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
import swashplate.machine.code_generation.machine_code as machine_code

compiled = []
compile_one = machine_code._compiled

def counted(name, text, **how):
    compiled.append(name)
    return compile_one(name, text, **how)

machine_code._compiled = counted
import machine
from swashplate.machine import Machine, sensitivities, simulate

p, command = machine.Lag(0.5), np.ones(4)
end = simulate(Machine(machine.rod, p), {"command": command}, 100.0)["position"][-1]
slope = sensitivities(Machine(machine.rod, p), {"command": command}, 100.0)["position"][-1, 0]
print(end, slope, len(compiled))
"""
END, SLOPE = 1.0 - 0.5**3, 3.0 * 0.5**2
"""After three steps towards 1 from 0."""


def start(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    (folder / "machine.py").write_text(MACHINE, "utf-8")
    cache = {"SWASHPLATE_COMPILE": "1", "SWASHPLATE_CACHE_DIR": str(folder / "cache")}
    return subprocess.run(
        [sys.executable, "-c", RUN, str(folder)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, **cache, **environment},
    )


def compiled(folder: Path, **environment: str) -> int:
    """How many functions a process of its own compiles; its numbers are right."""
    end, slope, count = start(folder, **environment).stdout.split()
    assert (float(end), float(slope)) == (END, SLOPE)
    return int(count)


@pytest.fixture
def warm(tmp_path: Path) -> Path:
    """A folder in which the machine was run once."""
    assert compiled(tmp_path) > 5
    return tmp_path


def test_a_second_process_compiles_nothing(warm: Path) -> None:
    assert compiled(warm) == 0


def test_code_is_for_one_processor(warm: Path) -> None:
    generic = {"SWASHPLATE_CPU": "generic"}
    assert compiled(warm, **generic) > 5
    assert compiled(warm, **generic) == 0
    assert compiled(warm) == 0


def test_damaged_code_is_made_again(warm: Path) -> None:
    files = [*(warm / "cache").rglob("*_code_*.kept")]
    assert len(files) > 5
    for number, path in enumerate(files):
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 0xFF
        path.write_bytes(bytes(content) if number % 2 else content[:20])
    assert compiled(warm) == len(files)
    assert compiled(warm) == 0


def test_many_workers_at_once(tmp_path: Path) -> None:
    with ThreadPoolExecutor(3) as pool:
        workers = [pool.submit(compiled, tmp_path) for _ in range(3)]
    assert all(worker.result() > 0 for worker in workers)
    assert compiled(tmp_path) == 0
    assert not [*(tmp_path / "cache").rglob("*.tmp")]


@pytest.mark.skipif(
    sys.platform == "win32" or os.geteuid() == 0, reason="whoever is root may write"
)
def test_a_folder_that_cannot_be_written(warm: Path) -> None:
    """What is there is used, and what is not is compiled in every session."""
    modules = warm / "cache" / "swashplate_generated"
    next(modules.glob("*_code_*.kept")).unlink()
    modules.chmod(stat.S_IRUSR | stat.S_IXUSR)
    try:
        assert compiled(warm) > 0
        assert compiled(warm) > 0
    finally:
        modules.chmod(stat.S_IRWXU)


def test_a_file_in_the_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    nowhere = {"SWASHPLATE_CACHE_DIR": str(tmp_path / "file"), "PYTHONWARNINGS": "default"}
    assert compiled(tmp_path, **nowhere) > 5
