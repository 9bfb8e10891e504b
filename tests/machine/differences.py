"""Partial derivatives of an equation against Richardson-extrapolated differences."""

from collections.abc import Collection, Iterator
from math import isfinite
from typing import Any

import pytest


def leaves(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    """What is at the ends of nested tuples, by dotted paths."""
    if isinstance(value, tuple):
        names = getattr(value, "_fields", None) or [str(i) for i in range(len(value))]
        for name, each in zip(names, value, strict=True):
            yield from leaves(each, f"{path}.{name}")
    else:
        yield path, value


def changed(value: Any, path: list[str], to: float) -> Any:
    """A nested tuple with one number replaced."""
    if not path:
        return to
    fields = getattr(value, "_fields", None)
    at = fields.index(path[0]) if fields else int(path[0])
    values = [changed(v, path[1:], to) if i == at else v for i, v in enumerate(value)]
    return type(value)(*values) if fields else tuple(values)


def compared(
    run: Any,
    derived: Any,
    arguments: dict[str, Any],
    implicit: Collection[str] = (),
    vanishing: Collection[str] = (),
) -> bool:
    """Compare value and partials with a plain function, unless the point has to be drawn again.

    Points at which another branch is taken within reach of the differences are told by those of
    three steps, which contradict each other there. Inputs in `implicit` and outputs in `vanishing`
    are not compared.
    """

    def values(path: str, to: float) -> list[float]:
        name, *rest = path.split(".")
        moved = {**arguments, name: changed(arguments[name], rest, to)}
        return [float(v) for _, v in leaves(run(*moved.values()), "")]

    try:
        base = [float(v) for _, v in leaves(run(*arguments.values()), "")]
    except (ValueError, ZeroDivisionError, OverflowError):
        return False
    if not all(isfinite(v) for v in base):
        return False
    got = derived(*arguments.values())
    # powers are by squaring, as in compiled code, where Python's own may have another last bit
    assert got[: len(derived.outputs)] == pytest.approx(base, rel=1e-14, abs=0.0)
    slopes = dict(zip(derived.entries, got[len(derived.outputs) :], strict=True))
    floats = {path: v for name, each in arguments.items() for path, v in leaves(each, name)}
    for i, path in enumerate(derived.inputs):
        number = floats[path]
        size = abs(number) or 1e-3
        h = 1e-3 * size
        at = {k: values(path, number + k * h) for k in (-1.0, -0.5, -0.25, 0.25, 0.5, 1.0)}
        for o, value in enumerate(base):
            if derived.outputs[o] in vanishing:
                continue
            slope_of = {k: (at[k][o] - at[-k][o]) / (2.0 * k * h) for k in (1.0, 0.5, 0.25)}
            whole, half, quarter = slope_of.values()
            coarse, fine = (4.0 * half - whole) / 3.0, (4.0 * quarter - half) / 3.0
            tolerance = 1e-6 * abs(fine) + 1e-9 * abs(value) / size
            if abs(coarse - fine) > tolerance:
                return False  # too curved for the differences, or a branch within their reach
            wide, narrow = (abs(at[k][o] + at[-k][o] - 2.0 * value) for k in (0.5, 0.25))
            if narrow > 0.25 * h * tolerance and wide < 3.0 * narrow:
                return False  # where two branches meet: of a curve it falls by four
            if path in implicit:
                continue
            slope = slopes.get((o, i), 0.0)
            assert abs(slope - fine) <= tolerance, (derived.outputs[o], path, slope, fine)
    return True
