"""Signals of a crane's run: what the loop stores of each sample, and what follows from that."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.kinematics import Geometry, Home, Shafts, boom_at, rope_length
from swashplate.machine import kernel
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

SPEED, SHAFT, TIP, LOAD, PULL = 0, 3, 6, 9, 12
"""First columns of what the loop stores of every run: four groups of three, and the pull."""
ABSENT = -1
BOOM_AND_ROPE = ("rope", "boom_cos", "boom_sin")
"""Signals that follow from the angles of the shafts."""
PARTS = {"hoist": 0, "slew": 1, "luff": 2, "x": 0, "y": 1, "z": 2}
"""Position of an axis in its group."""


class Columns(NamedTuple):
    """Columns that the loop stores only of some runs, `ABSENT` if it does not."""

    voltage: int
    """First of the three voltages; ideal drives have none."""
    limits: int
    """First of the limits of the three drives; ideal ones have none."""
    hook: int
    """First of the hook with slings; without one it is the position of the load."""
    torque: int
    """First of the torques, if the rope loads the drives."""
    width: int
    """Number of columns, with those of every run."""


def columns_of(*, ideal: bool, hooked: bool, loaded: bool) -> Columns:
    """Columns that the loop stores of a run."""
    width = PULL + 1
    first_columns = {}
    for group, present in (
        ("voltage", not ideal),
        ("limits", not ideal),
        ("hook", hooked),
        ("torque", loaded),
    ):
        first_columns[group] = width if present else ABSENT
        width += 3 if present else 0
    return Columns(**first_columns, width=width)


@kernel
def _boom_and_rope(shafts: Array, g: Geometry, home: Home, out: Array) -> None:
    """Rope, cosine and sine of the boom at angles of the shafts."""
    for n in range(len(shafts)):
        now = Shafts(shafts[n, 0], shafts[n, 1], shafts[n, 2])
        boom = boom_at(now.luff, g, home)
        out[n, 0] = rope_length(now, g, home)
        out[n, 1] = boom.cos
        out[n, 2] = boom.sin


@dataclass(frozen=True, eq=False)
class Signals(Result):
    """Signals by their names of `ROWS`, each computed when it is asked for."""

    stored: Array
    """(n, `columns.width`) what the loop has stored."""
    columns: Columns
    geometry: Geometry
    home: Home

    @cached_property
    def _boom_and_rope(self) -> Array:
        columns = np.empty((len(self.stored), 3))
        _boom_and_rope(self.stored[:, SHAFT : SHAFT + 3], self.geometry, self.home, columns)
        columns.flags.writeable = False
        return columns

    @cached_property
    def _zeros(self) -> Array:
        zeros = np.zeros((len(self.stored), 3))
        zeros.flags.writeable = False
        return zeros

    def three(self, group: str) -> Array:
        """(n, 3) the signals of a group: ``"speed"`` of hoist, slew and luff, ``"tip"``."""
        columns = self.columns
        first = {
            "voltage": columns.voltage,
            "speed": SPEED,
            "limits": columns.limits,
            "shaft": SHAFT,
            "tip": TIP,
            "load": LOAD,
            "hook": LOAD if columns.hook == ABSENT else columns.hook,
            "torque": columns.torque,
        }[group]
        return self._zeros if first == ABSENT else self.stored[:, first : first + 3]

    def __getitem__(self, name: str) -> Array:
        """(n,) a signal of `ROWS`."""
        if name == "pull":
            return self.stored[:, PULL]
        if name in BOOM_AND_ROPE:
            return self._boom_and_rope[:, BOOM_AND_ROPE.index(name)]
        group, _, axis = name.partition("_")
        return self.three(group)[:, PARTS[axis]]

    def table(self) -> Array:
        """(n, 28) all signals, a column for each name of `ROWS`."""
        return np.stack([self[name] for name in ROWS], axis=1)
