"""What is generated from a model's equations is kept on disk, and never outlives them."""

import linecache
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from swashplate.machine import Machine, Model, derive, equation, join, simulate

pytestmark = pytest.mark.slow

MACHINE = '''
from typing import NamedTuple

from swashplate.machine import Model, declared, equation

GAIN = 2.0
TABLE = (1.0, 3.0)


class Lag(NamedTuple):
    share: float


class Rod(NamedTuple):
    position: float


@equation
def deepest(x: float) -> float:
    """Three calls below the step."""
    return GAIN * x + TABLE[1]


@equation
def deeper(x: float) -> float:
    return deepest(x)


@equation
def deep(x: float) -> float:
    return deeper(x)


@equation
def ruled(x: float) -> float:
    return x


@declared(ruled)
def _ruled(x: float) -> float:
    return 1.0


@equation
def step(state: Rod, command: float, p: Lag, h: float) -> Rod:
    return Rod(state.position + p.share * (deep(ruled(command)) - state.position))


rod = Model("rod", parameters=Lag, state=Rod, step=step)
'''
RUN = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
import swashplate.machine.code_generation.tracing as tracing

count = [0]
call = tracing.Trace.call

def counted(*arguments):
    count[0] += 1
    return call(*arguments)

tracing.Trace.call = counted
import machine
from swashplate.machine import Machine, sensitivities, simulate, stepper

p, command = machine.Lag(0.5), np.ones(4)
end = simulate(Machine(machine.rod, p), {"command": command}, 100.0)["position"][-1]
slope = sensitivities(Machine(machine.rod, p), {"command": command}, 100.0)["position"][-1, 0]
stepper(Machine(machine.rod, p), ["command"], rate=100.0)
print(end, slope, count[0])
"""


def run(folder: Path, text: str) -> tuple[float, float, int]:
    """Last position, its derivative by the share, and how many equations were read."""
    (folder / "machine.py").write_text(text, "utf-8")
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(folder)],
        capture_output=True,
        text=True,
        check=True,
        env={
            **os.environ,
            "SWASHPLATE_COMPILE": "1",
            "SWASHPLATE_CACHE_DIR": str(folder / "cache"),
            # Python knows byte code by second and size, and this file changes faster than that
            "PYTHONDONTWRITEBYTECODE": "1",
        },
    )
    end, slope, count = done.stdout.split()
    return float(end), float(slope), int(count)


def expected(target: float, share: float = 0.5) -> tuple[float, float]:
    """After three steps towards a target from zero: target (1 - (1 - share)³), and its slope."""
    return target * (1.0 - (1.0 - share) ** 3), target * 3.0 * (1.0 - share) ** 2


@pytest.fixture
def warm(tmp_path: Path) -> Path:
    """A folder in which the machine was run once."""
    end, slope, count = run(tmp_path, MACHINE)
    assert (end, slope) == pytest.approx(expected(5.0), rel=1e-14)
    assert count > 0
    return tmp_path


def test_a_warm_process_reads_no_equation(warm: Path) -> None:
    end, slope, count = run(warm, MACHINE)
    assert (end, slope) == pytest.approx(expected(5.0), rel=1e-14)
    assert count == 0
    comment = MACHINE.replace('"""Three calls below the step."""', '"""Something else."""  # more')
    assert run(warm, comment)[2] == 0


@pytest.mark.parametrize(
    ("old", "new", "target"),
    [
        ("return GAIN * x + TABLE[1]", "return GAIN * x - TABLE[1]", -1.0),
        ("GAIN = 2.0", "GAIN = 4.0", 7.0),
        ("TABLE = (1.0, 3.0)", "TABLE = (1.0, 6.0)", 8.0),
    ],
)
def test_what_is_edited_counts(warm: Path, old: str, new: str, target: float) -> None:
    assert MACHINE.count(old) == 1
    end, slope, count = run(warm, MACHINE.replace(old, new))
    assert (end, slope) == pytest.approx(expected(target), rel=1e-14)
    assert count > 0


def test_a_declared_derivative_that_is_edited_counts(warm: Path) -> None:
    old = "return 1.0\n\n\n@equation\ndef step"
    scaled = MACHINE.replace("deep(ruled(command))", "deep(ruled(p.share * command))")
    right = run(warm, scaled)
    halved = scaled.replace(old, old.replace("1.0", "0.5"))
    assert halved != scaled
    end, slope, _ = run(warm, halved)
    assert end == right[0]
    assert slope != right[1]


STANDS_IN = """

@equation
def other(x: float) -> float:
    return 3.0 * x


rod = replaced(rod, deeper, other)
"""


def test_an_equation_that_stands_for_another_counts(warm: Path) -> None:
    imported = MACHINE.replace("declared, equation", "declared, equation, replaced")
    end, slope, count = run(warm, imported + STANDS_IN)
    assert (end, slope) == pytest.approx(expected(3.0), rel=1e-14)
    assert count > 0
    end, slope, count = run(warm, imported + STANDS_IN.replace("3.0", "4.0"))
    assert (end, slope) == pytest.approx(expected(4.0), rel=1e-14)
    assert count > 0


def test_a_damaged_file_is_made_again(warm: Path) -> None:
    files = [*(warm / "cache").rglob("*.kept")]
    assert files
    for number, path in enumerate(files):
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 0xFF
        path.write_bytes(bytes(content) if number % 2 else b"")
    end, slope, count = run(warm, MACHINE)
    assert (end, slope) == pytest.approx(expected(5.0), rel=1e-14)
    assert count > 0
    assert run(warm, MACHINE)[2] == 0


def cell(number: int, text: str, space: dict[str, Any]) -> None:
    """Run a cell of a notebook, whose text is kept under a name that is not a file's."""
    name = f"<ipython-input-{number}-abc>"
    linecache.cache[name] = (len(text), None, text.splitlines(True), name)
    exec(compile(text, name, "exec"), space)


def test_a_cell_of_a_notebook_that_is_run_again_counts() -> None:
    space: dict[str, Any] = {"__name__": "__main__"}
    head, _, tail = MACHINE.partition("@equation\ndef deepest")
    helper, _, rest = tail.partition("@equation\ndef deeper")
    ends = []
    for number, sign in enumerate(("+", "-")):
        changed = helper.replace("x + TABLE", f"x {sign} TABLE")
        cell(3 * number, head, space)
        cell(3 * number + 1, f"@equation\ndef deepest{changed}", space)
        cell(3 * number + 2, f"@equation\ndef deeper{rest}", space)
        found = simulate(Machine(space["rod"], space["Lag"](0.5)), {"command": np.ones(4)}, 100.0)
        ends.append(found["position"][-1])
    assert ends == pytest.approx([expected(5.0)[0], expected(-1.0)[0]], rel=1e-14)


def test_a_helper_alone_that_is_run_again_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The cell that makes the model is not run again: only the one below it."""
    monkeypatch.setattr(sys, "ps1", "In [1]: ", raising=False)
    space: dict[str, Any] = {"__name__": "__main__"}
    head, _, tail = MACHINE.partition("@equation\ndef deepest")
    helper, _, rest = tail.partition("@equation\ndef deeper")
    cell(100, head, space)
    cell(101, f"@equation\ndef deepest{helper}", space)
    cell(102, f"@equation\ndef deeper{rest}", space)
    command = {"command": np.ones(4)}

    def end() -> float:
        return float(
            simulate(Machine(space["rod"], space["Lag"](0.5)), command, 100.0)["position"][-1]
        )

    assert end() == pytest.approx(expected(5.0)[0], rel=1e-14)
    cell(103, f"@equation\ndef deepest{helper.replace('x + TABLE', 'x - TABLE')}", space)
    assert end() == pytest.approx(expected(-1.0)[0], rel=1e-14)
    cell(104, "GAIN = 4.0", space)
    assert end() == pytest.approx(expected(1.0)[0], rel=1e-14)
    found = derive(space["deeper"], "x")
    assert found(1.0) == (1.0, 4.0)
    cell(105, "GAIN = 6.0", space)
    assert derive(space["deeper"], "x")(1.0) == (3.0, 6.0)


TABLES = """
from typing import NamedTuple
import one, two, three
import tables
from swashplate.machine import Model, equation, interpolate

class Gain(NamedTuple):
    gain: float

class Rod(NamedTuple):
    position: float

@equation
def first(x: float) -> float:
    return one.GAIN * x

@equation
def second(x: float) -> float:
    return two.GAIN * x

@equation
def third(x: float) -> float:
    return three.GAIN * x

@equation
def step(state: Rod, command: float, p: Gain) -> Rod:
    drawn = interpolate(command, tables.KNOTS, tables.VALUES)
    return Rod(state.position + first(command) + second(command) + third(command) + drawn)

rod = Model("rod", parameters=Gain, state=Rod, step=step)
"""
TABLES_RUN = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
import machine
from swashplate.machine import Machine, simulate
run = simulate(Machine(machine.rod, machine.Gain(0.0)), {"command": np.ones(2)}, 100.0)
print(run["position"][-1])
"""


def test_constants_and_tables_of_modules_are_edited(tmp_path: Path) -> None:
    """Of three modules one constant of the same name each, and a table."""
    texts = {
        "one": "GAIN = 1.0", "two": "GAIN = 2.0", "three": "GAIN = 3.0",
        "tables": "KNOTS = (0.0, 2.0)\nVALUES = (0.0, 20.0)", "machine": TABLES,
    }  # fmt: skip

    def end() -> float:
        for name, text in texts.items():
            (tmp_path / f"{name}.py").write_text(text, "utf-8")
        environment = {"SWASHPLATE_COMPILE": "1", "SWASHPLATE_CACHE_DIR": str(tmp_path / "cache")}
        environment["PYTHONDONTWRITEBYTECODE"] = "1"  # the files change within a second
        done = subprocess.run(
            [sys.executable, "-c", TABLES_RUN, str(tmp_path)],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, **environment},
        )
        return float(done.stdout)

    assert end() == 1.0 + 2.0 + 3.0 + 10.0
    for name, text, change in (
        ("one", "GAIN = 5.0", 4.0),
        ("two", "GAIN = 12.0", 10.0),
        ("three", "GAIN = 13.0", 10.0),
        ("tables", "KNOTS = (0.0, 2.0)\nVALUES = (0.0, 40.0)", 10.0),
        ("tables", "KNOTS = (0.0, 4.0)\nVALUES = (0.0, 40.0)", -10.0),
    ):
        before, texts[name] = end(), text
        assert end() == before + change, name


class Level(NamedTuple):
    level: float


class Depth(NamedTuple):
    depth: float


class Share(NamedTuple):
    share: float


@equation
def fill(state: Level, command: float, p: Share) -> Level:
    return Level(state.level + p.share * command)


@equation
def sink(state: Depth, level: float, p: Share) -> Depth:
    return Depth(state.depth + p.share * level)


@equation
def doubled(level: float) -> float:
    return 2.0 * level


@equation
def tripled(level: float) -> float:
    return 3.0 * level


def test_models_of_other_links_are_told_apart() -> None:
    parts = Model("tank", Share, Level, fill), Model("pond", Share, Depth, sink)
    first = {"one": doubled, "two": doubled, "three": tripled}
    second = {"one": doubled, "two": tripled, "three": tripled}
    for links, factor in ((first, 2.0), (second, 3.0)):
        model = join("linked", *parts, links=links)
        numbers = model.parameters(Share(1.0), Share(1.0))
        run = simulate(Machine(model, numbers), {"command": np.ones(4)}, 1.0)
        assert run["two"].tolist() == [factor * each for each in run["level"]]
