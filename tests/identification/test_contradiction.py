"""Currents that keep a drive from following its motion count less, others count in full."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identification.given import virtual

from swashplate import Drive
from swashplate.campaign import Experiment
from swashplate.identification import fit, whole_drive
from swashplate.maneuvers import parse

HOIST = Drive.preset("hoist")
MANEUVERS = [
    *(parse(f"step:{volts},length=6") for volts in (9, -9, 4, -4)),
    parse("sine:6,0.1,length=15"),
    parse("sine:3,0.3,length=10"),
]


def misread(run: Experiment) -> Experiment:
    """A run whose currents read 60 mA too much one way, which no single dead zone explains."""
    channels = dict(run.channels)
    for name, channel in run.channels.items():
        if channel.kind == "signed_current":
            values = channel.values + np.where(channel.values > 0.02, 0.06, 0.0)
            channels[name] = replace(channel, values=values)
    return replace(run, channels=channels)


@pytest.mark.slow
def test_currents_that_contradict_the_motion_count_less(tmp_path) -> None:
    campaign = virtual(
        tmp_path, "hoist", MANEUVERS, seed=2, channels=("signed_current", "shaft_speed")
    )
    runs = campaign.select(role="fit")
    assert all("signed_current" in {c.kind for c in run.channels.values()} for run in runs)
    setup = whole_drive(HOIST.parameters)
    sound = fit(HOIST, runs, setup)
    assert not sound.setup.weights
    wrong = fit(HOIST, [misread(run) for run in runs], setup)
    (window,) = wrong.setup.weights["signed_current"]
    assert window.factor < 0.5
    errors = {
        name: max(run.measures.nrmse for run in result.qualities if run.channel == "shaft_speed")
        for name, result in (("sound", sound), ("wrong", wrong))
    }
    assert errors["wrong"] < 2.0 * errors["sound"] + 0.002
