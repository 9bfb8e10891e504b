"""Equations in LLVM's language, of one number and of eight side by side, beside Python."""

from collections.abc import Mapping
from math import isnan
from typing import Any

import numpy as np
import pytest

from swashplate.machine.code_generation import Trace, arguments, leaves
from swashplate.machine.code_generation.elimination import partials_of
from swashplate.machine.code_generation.llvm import Code
from swashplate.machine.code_generation.machine_code import code_of_text
from swashplate.machine.declaration import JIT_OFF
from swashplate.machine.language import parsed

LANES = 8


def element(value: Any, path: str) -> Any:
    for word in path.split(".") if path else ():
        value = value[int(word)] if word.isdigit() else getattr(value, word)
    return value


def assert_printed(
    function: Any,
    derived: Any,
    given: Mapping[str, Any],
    options: Mapping[str, Any] | None = None,
    lengths: Mapping[str, int] | None = None,
) -> None:
    """That machine code gives the values of Python to the bit, and its derivatives but rounded.

    The derivatives are eliminated here, and carried through every node there.
    """
    if JIT_OFF:
        return
    values = arguments(parsed(function), dict(options or {}), dict(lengths or {}))
    results = [node for _, node in leaves(Trace().call(function, values))]
    places = {node: (name, path) for name, value in values.items() for path, node in leaves(value)}
    columns = {
        f"{name}.{path}" if path else name: node
        for node, (name, path) in places.items()
        if node.kind == "float"
    }
    partials = partials_of(results, [columns[path] for path in derived.inputs])
    expected = derived(*given.values())
    numbers = np.array([float(element(given[name], path)) for name, path in places.values()])
    for wide in (0, LANES):
        code = Code([("ptr", "given"), ("ptr", "out")], wide)
        known = {}
        for number, node in enumerate(places):
            text = code.in_all_lanes(code.load("%given", number, "double"))
            test = f"fcmp une {code.number} {text}, {code.constant(0.0)}"
            known[node] = code.put(test) if node.kind == "bool" else text
        for place, text in enumerate(code.floats([*results, *partials.values()], known)):
            code.store(text, "%out", place * (wide or 1))
        out = np.zeros((len(results) + len(partials), wide or 1))
        code_of_text("printed", code.text, ("*float", "*float"))(numbers, out)
        assert (np.isnan(out) | (out == out[:, :1])).all()
        found = out[:, 0].tolist()
        for one, other in zip(found, expected[: len(results)], strict=False):
            assert one == other or (isnan(one) and isnan(other)), (function, given)
        slopes = dict(zip(derived.entries, expected[len(results) :], strict=True))
        for entry, slope in zip(partials, found[len(results) :], strict=True):
            assert slope == pytest.approx(slopes.get(entry, 0.0), rel=1e-9, abs=1e-12), entry
