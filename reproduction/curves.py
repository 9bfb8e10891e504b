"""The simulated curves of chapters 4 and 7 and of figure 9.1, with the published parameters."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reproduction.catalogue import Shown
from reproduction.content import Curve, Figure, Level, Panel
from reproduction.speed_path import simulated_speed
from swashplate.analysis import with_factors
from swashplate.drive import Drive
from swashplate.maneuvers import source_tests
from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

LARGER = 1.5
"""Factor on the opening of the orifices and on the pump's flow in figure 9.1. [1]"""
SHAFTS = {"hoist": "winch", "slew": "turret", "luff": "winch"}
ABSENT = "Kruse's measured {} is not at hand and not drawn."


class Scaled(NamedTuple):
    """How a command is drawn on the axis of another quantity."""

    factor: float
    words: str

    def beside(self, ordinate: str) -> str:
        """Label of an axis that carries both."""
        return f"{ordinate},\n{self.words}"


DIVIDED = Scaled(0.1, "voltage / 10 (V)")
MULTIPLIED = Scaled(10.0, "voltage × 10 (V)")
"""The text at hand calls the command scaled without saying how: so that it fits the axis."""


def command(run: Simulation, scaled: Scaled) -> Curve:
    """The command on another quantity's axis."""
    assert run.voltage is not None
    return Curve(scaled.words, run.time, scaled.factor * run.voltage, "command")


def scaling_of(axis: str) -> Scaled:
    """How the command is drawn beside the speed of an axis."""
    return DIVIDED if axis == "slew" else MULTIPLIED


def filtered_speed_deg_s(run: Simulation) -> Array:
    """Speed through the two low passes of figure 7.4, as Kruse (2001) drew it. [deg/s]"""
    period = float(run.time[1] - run.time[0])
    return np.degrees(simulated_speed(run.shaft_speed, period, aligned=False))


@cache
def simulated(axis: str, test: str) -> Simulation:
    """A test of Kruse (2001) with the published parameters of its axis, from rest."""
    return Drive.preset(axis).simulate(source_tests(axis)[test].sample())


def current_figure(shown: Shown) -> Figure:
    """Figures 4.3 to 4.16: the sum of both channels' currents."""
    (test,) = shown.tests
    run = simulated(shown.axis, test)
    total = run.current_positive + run.current_negative
    errata = (2, 3, *((7,) if shown.axis == "slew" else ()), *((5,) if "sine" in test else ()))
    return Figure(
        shown.number,
        f"{shown.axis.capitalize()}: current of the card, {test}",
        f"Simulated |I₊| + |I₋| and the command divided by 10 ({shown.logs} in Kruse (2001)). "
        + ABSENT.format("current")
        + " The model has no dither.",
        (
            Panel(
                DIVIDED.beside("current (A)"),
                (command(run, DIVIDED), Curve("simulated", run.time, total, "simulated")),
            ),
        ),
        tuple(sorted(errata)),
    )


def speed_figure(shown: Shown) -> Figure:
    """Figures 7.5 to 7.13 and 7.15 to 7.19: the speed, driven by the simulated current."""
    (test,) = shown.tests
    run = simulated(shown.axis, test)
    scaled, shaft = scaling_of(shown.axis), SHAFTS[shown.axis]
    creep = (
        " The creep before the first command is the plussing, which acts from 0 s on."
        if shown.axis == "hoist"
        else ""
    )
    negative = (1,) if shown.axis == "hoist" and "sine" in test else ()
    return Figure(
        shown.number,
        f"{shown.axis.capitalize()}: {shaft} speed, {test}",
        f"Simulated speed, low-passed as in figure 7.4, and the {scaled.words.removesuffix(' (V)')}"
        f" ({shown.logs} in Kruse (2001)). " + ABSENT.format("speed") + creep,
        (
            Panel(
                scaled.beside(f"{shaft} speed (deg/s)"),
                (
                    command(run, scaled),
                    Curve("simulated", run.time, filtered_speed_deg_s(run), "simulated"),
                ),
            ),
        ),
        (*negative, 2, 13, 31, 33),
    )


def inside_figure(shown: Shown) -> Figure:
    """Figures 7.14 and 7.20: what happens inside during a sine."""
    (test,) = shown.tests
    run = simulated(shown.axis, test)
    pump = run.pump

    def curve(name: str, values: Array) -> Curve:
        return Curve(name, run.time, values, "simulated")

    stops = np.degrees([pump.Z13_plus, -pump.Z13_minus])
    openings = 1e3 * np.array([pump.Z16_plus, -pump.Z16_minus])
    seen = "7.12" if shown.axis == "hoist" else "7.19"
    panels = (
        Panel(
            DIVIDED.beside("current (A)"),
            (command(run, DIVIDED), curve("signed current", run.current)),
        ),
        Panel("solenoid force (N)", (curve("net force", run.solenoid_force),)),
        Panel(
            "spool (mm)",
            (
                Curve("position", run.time, 1e3 * run.spool_position, "other"),
                curve("effective opening", 1e3 * run.orifice_opening),
            ),
            tuple(Level(height, "orifice") for height in openings.tolist()),
        ),
        Panel("stroker pressure\n(MPa)", (curve("δP", 1e-6 * run.stroker_pressure),)),
        Panel(
            "swash angle (deg)",
            (curve("swash plate", np.degrees(run.swash_angle)),),
            tuple(Level(height, "stop") for height in stops.tolist()),
        ),
        Panel(
            scaling_of(shown.axis).beside("speed (deg/s)"),
            (
                command(run, scaling_of(shown.axis)),
                curve("not low-passed", np.degrees(run.shaft_speed)),
            ),
        ),
    )
    negative = (1,) if shown.axis == "hoist" else ()
    return Figure(
        shown.number,
        f"{shown.axis.capitalize()}: inside the drive, {test}",
        f"All simulated signals from current to speed in the run of figure {seen} "
        f"({shown.logs} in Kruse (2001)). None of those inside was ever measured. Which of them "
        "the source drew the text at hand does not say.",
        panels,
        (*negative, 2, 13, 31),
    )


def other_card_figure(shown: Shown) -> Figure:
    """Figures 7.28 and 7.29: luffing with the card of the slew axis, an extrapolation."""
    runs = [simulated(shown.axis, test) for test in shown.tests]
    curves = tuple(
        Curve(test, run.time, filtered_speed_deg_s(run), "simulated")
        for test, run in zip(shown.tests, runs, strict=True)
    )
    what = "steps and ramp" if "step" in shown.tests[-1] else "sines"
    return Figure(
        shown.number,
        f"Luff: winch speed with the Rexroth card, {what}",
        "Simulated speeds of the luff pump and motor behind the card that was identified on slew: "
        "an extrapolation in Kruse (2001) already, with nothing measured to compare. Commands "
        "leave "
        "zero at 1 s. The parameters are approximate.",
        (Panel("winch speed (deg/s)", curves),),
        (6, 13, 31, 33),
    )


def larger_figure(shown: Shown) -> Figure:
    """Figure 9.1: the hoist with orifices and pump flow half as large again."""
    (test,) = shown.tests
    before = simulated(shown.axis, test)
    drive = with_factors(Drive.preset(shown.axis), {"orifice": LARGER, "pump": LARGER})
    after = drive.simulate(source_tests(shown.axis)[test].sample())
    speed = filtered_speed_deg_s(after)
    return Figure(
        shown.number,
        f"Hoist: winch speed with 50 % more orifice and flow, {test}",
        f"Simulated speed with Z16 and Z10 times {LARGER:g} over that of the published set, both "
        f"low-passed as in figure 7.4, and the command times 10 ({shown.logs} in Kruse "
        "(2001)). The "
        f"limits become {speed.max():+.0f} and {speed.min():+.0f} deg/s.".replace("-", "−"),
        (
            Panel(
                MULTIPLIED.beside("winch speed (deg/s)"),
                (
                    command(before, MULTIPLIED),
                    Curve("published set", before.time, filtered_speed_deg_s(before), "other"),
                    Curve("orifice and flow × 1.5", after.time, speed, "simulated"),
                ),
            ),
        ),
        (1, 2, 13, 29, 31, 33),
    )
