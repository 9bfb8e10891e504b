"""What to fix, or to ask for instead, so that all that is free is determined."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from swashplate import Channel, Drive, Experiment, InputError, maneuvers
from swashplate.campaign.experiment import InputSignal, Source
from swashplate.identification.excitation import (
    Proposal,
    outlook,
    propose,
    proposed_setup,
)
from swashplate.identification.fitting import smooth
from swashplate.identification.setup import Free, GivenForces, Setup, Stage, load_setup, setup_text

HOIST = Drive(smooth(Drive.preset("hoist").parameters))
SOURCE = Source(Path("log.csv"), "speed")
FACTOR = Free(relative=(0.5, 2.0), log=True)


def run(name: str, volts: float) -> Experiment:
    command = maneuvers.step(volts, start=0.5, stop=2.5, length=4.0).sample(512.0)
    simulated = HOIST.simulate(command)
    signal = InputSignal("voltage", "V", simulated.time, command, "linear", SOURCE)
    speed = simulated.shaft_speed
    weight = np.ones(command.size)
    channel = Channel(
        "speed", "shaft_speed", "rad/s", simulated.time, speed, weight, SOURCE, noise=0.01
    )
    return Experiment(name, "hoist", name, "fit", "rest", None, signal, {"speed": channel})


def proposed(free: Mapping[str, Free], *runs: Experiment, **more: object) -> Proposal:
    stage = Stage(name="pump", part="pump", free=free, **more)  # type: ignore[arg-type]
    return propose(outlook(stage, HOIST.parameters, runs))


def complete(proposal: Proposal, *runs: Experiment) -> bool:
    assert proposal.proposed is not None
    return outlook(proposal.proposed, HOIST.parameters, runs).identifiability.complete


def test_away_from_the_stops_only_a_ratio_matters() -> None:
    runs = (run("a", 3.0), run("b", -3.0))
    found = proposed({"Z6": FACTOR, "Z8": FACTOR}, *runs)
    assert found.fixed == {"Z6": "only Z8/(1+Z6) is determined"}
    assert found.sentences() == ("Fix Z6: only Z8/(1+Z6) is determined.",)
    assert found.proposed is not None
    assert list(found.proposed.free) == ["Z8"]
    assert complete(found, *runs)


def test_a_direction_that_no_run_takes_is_fixed_alone() -> None:
    runs = (run("a", 9.0), run("b", 4.0))
    found = proposed({"Z13": FACTOR, "Z10": FACTOR, "Z14": FACTOR}, *runs)
    assert set(found.fixed) == {"Z13_minus", "Z14"}
    assert found.sentences() == ("Fix Z13_minus, Z14: no run exercises them.",)
    assert found.proposed is not None
    assert list(found.proposed.free) == ["Z13_plus", "Z10"]
    assert complete(found, *runs)


def test_tied_directions_stay_tied() -> None:
    tied = Free(relative=(0.5, 2.0), tied=True)
    found = proposed({"Z13": tied, "Z10": FACTOR}, run("a", 9.0))
    assert not found.changes
    assert found.sentences() == ()


def test_forces_are_asked_for_where_there_is_a_current() -> None:
    given = GivenForces(plus=(0.06, 0.16, 0.28, 0.40), minus=(0.06, 0.16, 0.28, 0.38))
    run_ = run("a", 4.0)
    largest = HOIST.simulate(run_.input.values).current.max() - HOIST["Z17"].value
    found = proposed({"Z10": FACTOR}, run_, forces=given)
    assert found.proposed is not None
    assert found.proposed.forces is not None
    # the outermost just inside the largest current, the others in proportion
    top = found.proposed.forces.plus[3]
    assert 0.95 * largest < top < largest
    assert found.proposed.forces.plus[0] == pytest.approx(0.06 / 0.40 * top, rel=0.01)
    assert found.proposed.forces.minus == given.minus
    asked, minus = found.sentences()
    assert "no run goes further" in asked
    assert "force_minus_4 cannot be left out of [stages.forces]" in minus
    assert found.fixed == {}


def test_a_set_up_is_written_as_it_will_be_read(tmp_path: Path) -> None:
    setup = load_setup("hoist")
    proposals = [
        propose(outlook(stage, HOIST.parameters, [with_current(run("a", 4.0))]))
        for stage in setup.stages
    ]
    made = proposed_setup(setup, proposals)
    text = setup_text(made, {each.stage.name: each.comments() for each in proposals})
    (tmp_path / "mine.toml").write_text(text, "utf-8")
    assert load_setup(tmp_path / "mine.toml") == made
    assert "# V_dz_minus, J_minus, G1_minus" in text
    assert all(len(line) <= 100 for line in text.splitlines())
    untouched = setup_text(setup)
    (tmp_path / "same.toml").write_text(untouched, "utf-8")
    assert load_setup(tmp_path / "same.toml") == setup


def test_windows_and_priors_survive(tmp_path: Path) -> None:
    text = """
title = "mine"
[[stages]]
name = "card"
part = "chain"
channels = ["shaft_speed"]
free.J = { bounds = [0.1, 0.5], prior = { mean = 0.3, deviation = 0.1 } }
weights.shaft_speed = [{ from = 1.0, to = 2.0, factor = 10.0, maneuver = "step *" }]
"""
    (tmp_path / "one.toml").write_text(text, "utf-8")
    setup = load_setup(tmp_path / "one.toml")
    (tmp_path / "two.toml").write_text(setup_text(setup), "utf-8")
    assert load_setup(tmp_path / "two.toml") == setup


def test_nothing_left_is_said() -> None:
    found = proposed({"Z14": FACTOR, "Z15": FACTOR}, run("a", 3.0))
    assert found.proposed is None
    assert "Nothing is then left of the stage 'pump'" in found.sentences()[-1]
    setup = Setup(stages=(found.stage,))
    with pytest.raises(InputError, match="determine none of the unknowns"):
        proposed_setup(setup, [found])


def with_current(experiment: Experiment) -> Experiment:
    """The same with the card's current."""
    from dataclasses import replace

    simulated = HOIST.simulate(experiment.input.values)
    current = replace(
        experiment["speed"],
        name="current",
        kind="rectified_current",
        unit="A",
        values=simulated.current_positive + simulated.current_negative,
        noise=0.002,
    )
    return replace(experiment, channels={**experiment.channels, "current": current})
