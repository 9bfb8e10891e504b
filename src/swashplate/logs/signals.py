"""Columns from arrays: which rows or columns of a matrix are signals, and what they are called."""

from __future__ import annotations

from typing import NamedTuple

MOST = 4096
"""Signals in one matrix; one with more of both rows and columns is a picture or a map."""


class Signal(NamedTuple):
    """One signal of an array: all of a vector, or a row or a column of a matrix."""

    name: str
    axis: int | None
    """Dimension along which it is chosen, None for a vector."""
    place: int
    """Position along that dimension, from 0."""


def signals(name: str, shape: tuple[int, ...], *, matlab: bool) -> list[Signal] | str:
    """Signals of an array, or why there are none.

    Parameters
    ----------
    name : str
        Of the array.
    shape : tuple of int
        In the order of its own language. The longer dimension is taken for the time.
    matlab : bool
        Whether signals are called ``x(1,:)`` and ``x(:,1)`` as in MATLAB or ``x[0,:]`` and
        ``x[:,0]`` as in Python.
    """
    if 0 in shape:
        return "it is empty"
    if len(shape) > 2:
        return f"it has {len(shape)} dimensions"
    if len(shape) < 2 or 1 in shape:
        return [Signal(name, None, 0)]
    rows, columns = shape
    axis, count = (1, columns) if rows >= columns else (0, rows)
    if count > MOST:
        return f"it is a matrix of {rows} by {columns}"
    first = 1 if matlab else 0
    form = ("({},:)", "(:,{})") if matlab else ("[{},:]", "[:,{}]")
    return [Signal(name + form[axis].format(place + first), axis, place) for place in range(count)]
