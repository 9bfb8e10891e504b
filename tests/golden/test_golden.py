"""Numbers as they were before the last change of the engine, of a few runs: see README.md.

Every 64th sample of each column lies in the file, with the sum of squares of all. A signal may
differ by nothing, a derivative by 1e-9 of its column's largest magnitude.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.drive.experiments import ALL

from swashplate import Drive, Simulation

Array = NDArray[np.float64]

FILE = Path(__file__).with_name("golden.npz")
EACH = 64
SIGNALS = (
    *("current", "current_positive", "current_negative", "solenoid_force", "spool_position"),
    *("orifice_opening", "stroker_pressure", "swash_angle", "shaft_speed", "shaft_position"),
)
LOADED = {**ALL, "solenoid_delay": 0.0, "solenoid_lag": 0.0, "Z7": 0.4, "Z13": 0.6}
"""As the file has them: lateness came after it was written."""


def columns(run: Simulation) -> Array:
    """All signals of a run, side by side."""
    return np.column_stack([run[name] for name in SIGNALS])


def form(**forms: str) -> Drive:
    """The hoist with another form of its equations."""
    return Drive(replace(Drive.preset("hoist").replace(C=3.0).parameters, **forms))


CASES: dict[str, Callable[[Array], Array]] = {
    "hoist": lambda voltage: columns(Drive.preset("hoist").simulate(voltage)),
    "slew": lambda voltage: columns(Drive.preset("slew").simulate(voltage)),
    "luff": lambda voltage: columns(Drive.preset("luff").simulate(voltage)),
    "split steps": lambda voltage: columns(form(card_switch="split").simulate(voltage)),
    "physical root": lambda voltage: columns(form(pressure_root="symmetric").simulate(voltage)),
    "all refinements": lambda v: columns(Drive.preset("hoist").replace(**LOADED).simulate(v)),
    "pump alone": lambda v: columns(Drive.preset("hoist").simulate_current(0.08 * v)),
    "derivatives": lambda v: np.array(Drive.preset("hoist").sensitivities(v)["shaft_speed"]),
}


def kept(values: Array) -> Array:
    """What the file has of a case."""
    return np.vstack([values[::EACH], np.sum(values * values, axis=0)])


@pytest.mark.parametrize("name", CASES)
def test_case(name: str) -> None:
    with np.load(FILE) as stored:
        values = CASES[name](stored["voltage"])
        found, was = kept(values), stored[name]
    assert found.shape == was.shape
    if name != "derivatives":
        assert np.array_equal(found[:-1], was[:-1])
    # a sum may be taken in another order by another processor
    scale = np.vstack([np.abs(values).max(axis=0) + np.zeros_like(was[:-1]), was[-1:]])
    np.testing.assert_array_less(np.abs(found - was), 1e-9 * scale + 1e-300)


if __name__ == "__main__":  # write the file, on the voltage that it has, for the cases named
    with np.load(FILE) as read:
        all_of_it = dict(read)
    for word in sys.argv[1:]:
        all_of_it[word] = kept(CASES[word](all_of_it["voltage"]))
    np.savez_compressed(FILE, **all_of_it)
