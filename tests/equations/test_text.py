"""Texts of derived functions: short, readable, and the same in every process."""

import ast
import inspect
import subprocess
import sys
from typing import Any

import pytest

from swashplate.equations import closure, closure_hash, derive, equation, plain
from swashplate.equations.declaration import is_function
from swashplate.models import amplifier, pump
from swashplate.models import displacement_control as control
from swashplate.models.amplifier import CardOptions
from swashplate.models.displacement_control import PumpOptions

OPTIONS: dict[str, Any] = dict.fromkeys(("literal", "split", "steep", "symmetric"))
CASES = [
    (pump.pump_sample, ("state.pressure", "inputs.current", "p"), PumpOptions()),
    (control.spool_balance, ("force", "arm_sine", "p.Z4", "p.Z5", "p.Z18"), None),
    (control.leaky_step, ("pressure", "opening", "p"), None),
    (amplifier.card_sample, ("state", "p"), CardOptions()),
]


def chosen(function: Any, options: Any) -> dict[str, Any]:
    """All options off, or as given."""
    names = plain(function).__code__.co_varnames
    given = {"options": options} if options is not None else {}
    return {**{name: off for name, off in OPTIONS.items() if name in names}, **given}


def code_lines(text: str) -> int:
    """Lines of statements: without the head, the docstring and brackets' own lines."""
    node = ast.parse(inspect.cleandoc("\n" + text)).body[0]
    assert isinstance(node, ast.FunctionDef)
    skipped = isinstance(node.body[0], ast.Expr)
    return sum(s.end_lineno - s.lineno + 1 for s in node.body[skipped:])


@pytest.mark.parametrize(
    ("function", "by", "options"), CASES, ids=lambda case: getattr(case, "__name__", "")
)
def test_texts_are_short(function: Any, by: tuple[str, ...], options: Any) -> None:
    lengths = {"inputs.at.s": 2, "inputs.span.s": 3}
    derived = derive(function, by, options=chosen(function, options), lengths=lengths)
    for name, text in derived.texts.items():
        assert max(map(len, text.splitlines())) <= 100, name
        assert text.startswith(f"def {name}(")
        ast.parse(text)
    written = [plain(each) for each in closure(function).values() if is_function(each)]
    lines = sum(code_lines(inspect.getsource(each)) for each in written)
    assert code_lines(derived.source) <= 12 * lines + 2
    first = inspect.getdoc(derived.python)
    assert first.startswith(f"{plain(function).__name__} with its derivatives by ")
    assert f"{plain(function).__module__}, line " in first


PRINT = """
import sys
from swashplate.equations import derive
from swashplate.models import displacement_control as control
from swashplate.models import pump
cases = [
    (control.leaky_step, ("opening", "p"), {"symmetric": None}),
    (control.spool_balance, ("p.Z5", "p.Z4", "force"), {}),
    (pump.pump_step, ("state", "p"), {"options": control.PumpOptions()}),
]
texts = [derive(f, by, options=o).texts for f, by, o in cases[:: int(sys.argv[1])]]
print(sorted({t for each in texts for t in each.values()}))
"""


@pytest.mark.slow
def test_texts_are_the_same_in_every_order() -> None:
    first, second = (
        subprocess.run(
            [sys.executable, "-c", PRINT, order], capture_output=True, text=True, check=True
        ).stdout
        for order in ("1", "-1")
    )
    assert first == second
    assert "def pump_step_by" in first


def scaled(factor: float) -> Any:
    @equation
    def scaling(x: float) -> float:
        return factor * x

    return scaling


double, triple = scaled(2.0), scaled(3.0)


@equation
def both(x: float) -> float:
    return double(x) * triple(x)


def test_functions_of_one_name_are_kept_apart() -> None:
    derived = derive(both, "x")
    for run in (derived.python, derived.compiled):
        assert run(2.0) == (24.0, 24.0)
    assert closure_hash(double) != closure_hash(triple)
