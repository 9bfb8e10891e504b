"""Which run tells of which unknown, after a fit and before one."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swashplate import Channel, Drive, Experiment, maneuvers
from swashplate.campaign.experiment import InputSignal, Source
from swashplate.identification.excitation import Outlook, excitation, outlook
from swashplate.identification.fitting import smooth
from swashplate.identification.linearised import LinearisedFit, LinearisedRun
from swashplate.identification.setup import Free, GivenForces, Stage
from swashplate.identification.unknowns import Unknowns

HOIST = Drive(smooth(Drive.preset("hoist").parameters))
SOURCE = Source(Path("log.csv"), "speed")


def run(name: str, volts: float, weight: float = 1.0) -> Experiment:
    """A step of 2 s, its speed as the drive has it."""
    command = maneuvers.step(volts, start=0.5, stop=2.5, length=4.0).sample(512.0)
    simulated = HOIST.simulate(command)
    signal = InputSignal("voltage", "V", simulated.time, command, "linear", SOURCE)
    channel = Channel(
        "speed",
        "shaft_speed",
        "rad/s",
        simulated.time,
        simulated.shaft_speed,
        np.full(command.size, weight),
        SOURCE,
        noise=0.01,
    )
    return Experiment(name, "hoist", name, "fit", "rest", None, signal, {"speed": channel})


def looked(free: Mapping[str, Free], *runs: Experiment, **more: object) -> Outlook:
    return outlook(
        Stage(name="pump", part="pump", free=free, **more),  # type: ignore[arg-type]
        HOIST.parameters,
        runs,
    )


FACTOR = Free(relative=(0.5, 2.0))


def test_shares_by_hand() -> None:
    first = np.array([[3.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    second = np.array([[1.0, 0.0, 0.0]])
    runs = [
        LinearisedRun("ramp", "speed", np.arange(2.0), np.zeros(2), first),
        LinearisedRun("step", "speed", np.arange(1.0), np.zeros(1), second),
    ]
    found = excitation(LinearisedFit.of(runs, Unknowns.of(["Z8", "Z13", "Z14"], np.ones(3))))
    np.testing.assert_allclose(found.share, [[0.9, 1.0, 0.0], [0.1, 0.0, 0.0]])
    np.testing.assert_allclose(found.sensitivity[0], [0.03 / np.sqrt(2.0), 0.01 / np.sqrt(2.0), 0])
    assert found.sentences() == (
        "Z8: 90 % of what is known of it comes from ramp, speed alone.",
        "Z13: 100 % of what is known of it comes from ramp, speed alone.",
        "Z14: no run depends on it.",
    )


def test_before_a_fit_each_run_is_marked() -> None:
    found = looked({"Z13": FACTOR, "Z10": FACTOR}, run("low", 3.0), run("high", 9.0))
    assert found.activation.runs == ("low", "high")
    assert found.marks("Z13_plus") == ("none", "most")
    assert found.marks("Z13_minus") == ("none", "none")
    assert found.effect("Z13_minus") == 0.0
    # the speed is Z10 times an angle: 1 % of it is 1 % of all speeds, over their noise
    speeds = np.concatenate([HOIST.simulate(each.input.values).shaft_speed for each in RUNS])
    assert found.effect("Z10") == pytest.approx(np.linalg.norm(0.01 * speeds) / 0.01)
    assert found.sentences() == (
        "Z13_minus needs the swash plate at its stop (minus), which no run has.",
        "Z13_plus: 100 % of what the runs tell of it comes from high alone.",
    )


RUNS = (run("low", 3.0), run("high", 9.0))


def test_what_happens_where_nothing_counts_is_unseen() -> None:
    early, stopped = run("early", 3.0), run("stopped", 9.0)
    time = stopped["speed"].time
    blind = replace(stopped["speed"], weight=np.where(time < 0.8, 1.0, 0.0))
    found = looked({"Z13_plus": FACTOR}, early, replace(stopped, channels={"speed": blind}))
    assert found.marks("Z13_plus") == ("none", "unseen")
    assert found.sentences() == (
        "Z13_plus needs the swash plate at its stop (plus): stopped has it, but no sample that "
        "counts shows it.",
    )


def test_forces_that_no_current_reaches_are_named_together() -> None:
    currents = (0.06, 0.16, 0.28, 0.38)
    found = looked(
        {"Z10": FACTOR}, run("up", 4.0), forces=GivenForces(plus=currents, minus=currents)
    )
    assert found.identifiability.unexcited == tuple(f"force_minus_{k}" for k in (1, 2, 3, 4))
    assert found.sentences()[0] == (
        "force_minus_1, force_minus_2, force_minus_3 and force_minus_4 need currents of their "
        "size beyond Z17 (minus), which no run has."
    )


def test_the_verdict_names_an_exact_gauge() -> None:
    found = looked({"Z1": FACTOR, "Z8": FACTOR, "Z9": FACTOR}, *RUNS)
    (direction,) = found.identifiability.null
    assert direction.gauge is not None
    assert direction.gauge.name == "scale of pressure"
    assert found.identifiability.rank == 2
