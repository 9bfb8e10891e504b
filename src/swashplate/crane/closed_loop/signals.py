"""Signals of a crane's run, by name."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.results import Result

Array = NDArray[np.float64]

ROWS = (
    *("voltage_hoist", "voltage_slew", "voltage_luff"),
    *("speed_hoist", "speed_slew", "speed_luff"),
    *("limits_hoist", "limits_slew", "limits_luff"),
    *("shaft_hoist", "shaft_slew", "shaft_luff"),
    *("tip_x", "tip_y", "tip_z", "load_x", "load_y", "load_z", "hook_x", "hook_y", "hook_z"),
    *("pull", "rope", "boom_cos", "boom_sin"),
    *("torque_hoist", "torque_slew", "torque_luff"),
)
"""Signals of a run by name, SI; the torques are those that the drives have taken."""

THREES = ("speed", "shaft", "tip", "load")
"""Groups of three signals that are stored of every run, one after the other."""
SINGLES = ("pull", "rope", "boom_cos", "boom_sin")
"""Signals that are stored of every run after these."""
ABSENT = -1
PARTS = {"hoist": 0, "slew": 1, "luff": 2, "x": 0, "y": 1, "z": 2}
"""Position of an axis in its group."""


class Columns(NamedTuple):
    """First columns of the groups that are stored only of some runs, `ABSENT` if they are not."""

    limits: int
    """Of the three drives; ideal ones have none."""
    voltage: int
    """Ideal drives have none; with direct actuation they are the commands."""
    hook: int
    """With slings; without one it is the position of the load."""
    torque: int
    """If the rope loads the drives."""
    width: int
    """Number of columns, with those of every run."""


def columns_of(*, ideal: bool, hooked: bool, loaded: bool) -> Columns:
    """Columns that are stored of a run."""
    width = 3 * len(THREES) + len(SINGLES)
    first_columns = {}
    for group, present in (
        ("limits", not ideal),
        ("voltage", not ideal),
        ("hook", hooked),
        ("torque", loaded),
    ):
        first_columns[group] = width if present else ABSENT
        width += 3 if present else 0
    return Columns(**first_columns, width=width)


@dataclass(frozen=True, eq=False)
class Signals(Result):
    """Signals by their names of `ROWS`, each computed when it is asked for."""

    stored: Array
    """(n, `columns.width`)"""
    columns: Columns

    @cached_property
    def _zeros(self) -> Array:
        zeros = np.zeros((len(self.stored), 3))
        zeros.flags.writeable = False
        return zeros

    def three(self, group: str) -> Array:
        """(n, 3) the signals of a group: ``"speed"`` of hoist, slew and luff, ``"tip"``."""
        if group == "hook" and self.columns.hook == ABSENT:
            group = "load"
        is_always = group in THREES
        first = 3 * THREES.index(group) if is_always else getattr(self.columns, group)
        return self._zeros if first == ABSENT else self.stored[:, first : first + 3]

    def __getitem__(self, name: str) -> Array:
        """(n,) a signal of `ROWS`."""
        if name in SINGLES:
            return self.stored[:, 3 * len(THREES) + SINGLES.index(name)]
        group, _, axis = name.partition("_")
        return self.three(group)[:, PARTS[axis]]

    def table(self) -> Array:
        """(n, 28) all signals, a column for each name of `ROWS`."""
        return np.stack([self[name] for name in ROWS], axis=1)
