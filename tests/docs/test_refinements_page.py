"""docs/refinements.md explains every refinement; what is said of stiction and hysteresis holds."""

from pathlib import Path

import numpy as np

from swashplate import Drive, maneuvers
from swashplate.models.refinements import friction_width
from swashplate.parameters.definitions import REFINEMENTS

PAGE = (Path(__file__).parents[2] / "docs" / "refinements.md").read_text("utf-8")
STICTION = {"spool_friction": 0.115, "spool_presliding": 5e-5, "dither_time": 0.6}


def test_every_refinement_is_explained() -> None:
    for symbol in REFINEMENTS:
        assert f"`{symbol}`" in PAGE, symbol


def test_the_numbers_of_stiction() -> None:
    hoist = Drive.preset("hoist")
    sticky = hoist.replace(**STICTION)
    overshoots = []
    for volts in (6.5, -4.0):
        speed = sticky.simulate(maneuvers.step(volts).sample(512.0)).shaft_speed[: 6 * 512]
        overshoots.append(100.0 * (np.abs(speed).max() / abs(hoist.steady_speed(volts)) - 1.0))
    assert np.round(overshoots, 1).tolist() == [2.3, 4.6]
    sine = maneuvers.sine(9.0, 0.1).sample(512.0)
    plain, stuck = hoist.simulate(sine).shaft_speed, sticky.simulate(sine).shaft_speed
    assert round(100.0 * np.abs(stuck - plain).max() / plain.max(), 1) == 2.2
    n = hoist.parameters.numbers
    assert round(1e3 * friction_width(0.115, n["Z4"], n["Z5"]), 3) == 0.031


def test_the_numbers_of_hysteresis() -> None:
    hoist = Drive.preset("hoist")
    ramp, step = maneuvers.ramp(1.0).sample(512.0), maneuvers.step(6.5).sample(512.0)
    lost = [
        np.degrees(
            hoist.simulate(command).shaft_speed[at]
            - hoist.replace(solenoid_hysteresis=0.01).simulate(command).shaft_speed[at]
        )
        for command, at in ((ramp, int(np.argmax(ramp >= 6.5))), (step, int(5.9 * 512)))
    ]
    assert np.round(lost, 1).tolist() == [4.7, 4.6]
