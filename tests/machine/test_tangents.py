"""Derivatives of whole marches against tangents that are carried along, sample by sample."""

import numpy as np
import pytest
from tests.drive.experiments import ALL
from tests.machine.tangents import marched

from swashplate import Drive
from swashplate.machine.fields import floats_of
from swashplate.parameters import DEFINITIONS, SWITCHES

RATE, SIZE = 512.0, 300
COULOMB = ("C_plus", "C_minus")
DRIVES = {
    "hoist": {},
    "slew": {},
    "luff": {},
    "hoist, all refinements": ALL,
    "hoist, leaky": {"Z7": 0.5, "Z12": 0.03},
    "hoist, card at any rate": {"C": 0.5},
}


@pytest.mark.parametrize("name", DRIVES)
def test_columns_are_those_of_tangents(name: str) -> None:
    drive = Drive.preset(name.partition(",")[0]).replace(**DRIVES[name])
    if "any rate" in name:
        drive = drive.at_every_rate()
    time = np.arange(SIZE) / RATE
    voltage = 5.3 * np.sin(9.0 * time + 0.7)
    instance = drive
    run = instance, {"voltage": voltage}, 1.0 / RATE, "shaft_speed"
    values, slopes = marched(*run)
    _, alone = marched(*run, begins=False)
    found = drive.sensitivities(voltage, RATE)
    assert np.array_equal(found.run.shaft_speed, values)
    paths = [
        f"{instance.model.prefix(i)}{path}"
        for i, part in enumerate(instance.model.parts)
        for path in floats_of(part.parameters)
    ]
    columns = found["shaft_speed"]
    assert np.abs(columns).max() > 0.0
    for k, column in enumerate(found.names):
        if drive.parameters.numbers[column] == 0.0 and column in (*SWITCHES, *COULOMB):
            continue  # off, with a derivative to one side that is declared
        index = paths.index(DEFINITIONS.path_of(column))
        # the gauge Z2 moves the state at rest and all that follows, which cancel but for 0.4 %
        size = max(np.abs(slopes[:, index]).max(), np.abs(alone[:, index]).max())
        assert np.abs(columns[:, k] - slopes[:, index]).max() <= 1e-12 * size, column
