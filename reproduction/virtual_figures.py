"""Figures that need what instruments read: encoder counts, and the luff axis's measured current."""

from __future__ import annotations

from typing import Literal

import numpy as np

from reproduction.bench import ON_CURRENT, Bench
from reproduction.catalogue import Shown
from reproduction.content import Curve, Figure, Panel
from reproduction.curves import MULTIPLIED, filtered_speed_deg_s
from swashplate.campaign import interpolate_counts
from swashplate.drive import Drive, simulate_drive
from swashplate.identification.estimation.drive_model import measured_current

WINDOW = (1.55, 1.75)
"""Part of the ramp that figure 7.2 looks at: the winch is slow, a count lasts some samples. [s]"""


def encoder_figure(shown: Shown, bench: Bench) -> Figure:
    """Figure 7.2: raw counts and the straight lines between their changes."""
    (test,) = shown.tests
    (channel,) = bench.run(shown.axis, test).of_kind("encoder_counts")
    assert channel.counts is not None
    smoothed = interpolate_counts(channel.time, channel.counts)
    seen = (channel.time >= WINDOW[0]) & (channel.time <= WINDOW[1])
    time = channel.time[seen]
    return Figure(
        shown.number,
        f"Raw and smoothed encoder counts, {shown.axis}, {test}",
        "Virtual encoder counts of the hoist winch at low speed, 512 samples a second, and the "
        "straight lines that Kruse's smoothing puts between two changes. The run that the "
        "source shows is not named in the text at hand.",
        (
            Panel(
                "encoder (counts)",
                (
                    Curve("raw, virtual", time, channel.counts[seen], "virtual", held=True),
                    Curve("smoothed", time, smoothed[seen], "simulated"),
                ),
            ),
        ),
        (24, 25),
        virtual=True,
    )


def measured_current_figure(shown: Shown, bench: Bench) -> Figure:
    """Figures 7.21 to 7.27: pump and motor behind 1.5 times a measured-type current."""
    (test,) = shown.tests
    experiment = bench.run(shown.axis, test)
    record = measured_current(experiment, ON_CURRENT)
    start: Literal["rest"] = "rest"
    run = simulate_drive(Drive.preset(shown.axis).parameters, {"current": record}, start)
    volts = MULTIPLIED.factor * experiment.input.at(run.time)
    return Figure(
        shown.number,
        f"Luff: winch speed by a measured-type current, {test}",
        "Pump and motor behind 1.5 times a virtual ammeter's reading of a stand-in card, given the "
        "command's sign; the command times 10. Kruse (2001) took the measured current of a "
        "Hägglunds "
        f"card ({shown.logs}); neither that nor its measured speed is at hand. Approximate.",
        (
            Panel(
                MULTIPLIED.beside("winch speed (deg/s)"),
                (
                    Curve(MULTIPLIED.words, run.time, np.asarray(volts), "command"),
                    Curve("by virtual current", run.time, filtered_speed_deg_s(run), "simulated"),
                ),
            ),
        ),
        (13, 31, 33),
        virtual=True,
    )
