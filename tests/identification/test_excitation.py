"""What each run makes the drive do, which run tells of which unknown, and what to fix."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.identification.linear import linear_fit, unknowns_of

from swashplate import Channel, Drive, Experiment, InputError, maneuvers
from swashplate.campaign.experiment import InputSignal, Source
from swashplate.identification.drive_model import Forces
from swashplate.identification.excitation import (
    Outlook,
    Proposal,
    acting,
    activation,
    excitation,
    need_of,
    outlook,
    propose,
    proposed_setup,
)
from swashplate.identification.fitting import smooth
from swashplate.identification.problem import LinearisedRun
from swashplate.identification.setup import Free, GivenForces, Setup, Stage, load_setup, setup_text
from swashplate.identification.unknowns import Unknown

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
    found = excitation(linear_fit(runs, unknowns_of(["Z8", "Z13", "Z14"], np.ones(3))))
    np.testing.assert_allclose(found.share, [[0.9, 1.0, 0.0], [0.1, 0.0, 0.0]])
    np.testing.assert_allclose(found.sensitivity[0], [0.03 / np.sqrt(2.0), 0.01 / np.sqrt(2.0), 0])
    assert found.sentences() == (
        "Z8: 90 % of its information is from ramp, speed alone.",
        "Z13: 100 % of its information is from ramp, speed alone.",
        "Z14: no run depends on it.",
    )


def test_before_a_fit_each_run_is_marked() -> None:
    found = looked({"Z13": FACTOR, "Z10": FACTOR}, run("low", 3.0), run("high", 9.0))
    assert tuple(found.simulations) == ("low", "high")
    assert found.marks("Z13_plus") == ("none", "most")
    assert found.marks("Z13_minus") == ("none", "none")
    assert found.effect("Z13_minus") == 0.0
    # the speed is Z10 times an angle: 1 % of it is 1 % of all speeds, over their noise
    speeds = np.concatenate([HOIST.simulate(each.input.values).shaft_speed for each in RUNS])
    assert found.effect("Z10") == pytest.approx(np.linalg.norm(0.01 * speeds) / 0.01)
    assert found.sentences() == (
        "Z13_minus needs the swash plate at its stop (minus), which no run has.",
        "Z13_plus: 100 % of its information is from high alone.",
    )


RUNS = (run("low", 3.0), run("high", 9.0))


def test_what_happens_where_nothing_counts_is_unseen() -> None:
    early, stopped = run("early", 3.0), run("stopped", 9.0)
    time = stopped["speed"].time
    blind = replace(stopped["speed"], weight=np.where(time < 0.8, 1.0, 0.0))
    found = looked({"Z13_plus": FACTOR}, early, replace(stopped, channels={"speed": blind}))
    assert found.marks("Z13_plus") == ("none", "unseen")
    assert found.sentences() == (
        "Z13_plus needs the swash plate at its stop (plus): stopped meets it, but shows it in no "
        "sample that is used.",
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


# --- what happens in a run ------------------------------------------------------------------------


FORCES = Forces((0.06, 0.16, 0.28, 0.40), (0.06, 0.16, 0.28, 0.38))


def seconds_of(maneuver: maneuvers.Maneuver, drive: Drive = HOIST) -> dict[str, float]:
    return acting(drive.simulate(maneuver.sample(512.0)), drive.parameters)


def test_a_command_within_the_dead_zone_exercises_nothing_of_the_card() -> None:
    seconds = seconds_of(maneuvers.step(0.1))
    card = ("V_dz_plus", "J_plus", "omega_plus", "lim1_plus", "lim2_plus", "a_plus", "tau", "Z17")
    assert [seconds[name] for name in card] == [0.0] * len(card)
    # the plussing tilts the plate all the same
    assert seconds["Z18"] > 9.0


def test_durations_of_a_step_by_hand() -> None:
    seconds = seconds_of(maneuvers.step(4.0))
    # on from 1 s to 6 s, and nothing the other way
    assert seconds["V_dz_plus"] == pytest.approx(5.0, abs=2 / 512)
    assert seconds["V_dz_minus"] == seconds["lim1_minus"] == seconds["Z19_minus"] == 0.0
    # lim1 lifts the current from I_t1 to its settled value
    settled = HOIST.steady_current(4.0)
    rise = (settled - HOIST["I_t1"].value.plus) / HOIST["lim1"].value.plus
    assert seconds["lim1_plus"] == pytest.approx(rise, abs=3 / 512)
    # and lim2 brings it down from there to I_t2
    fall = (settled - HOIST["I_t2"].value.plus) / HOIST["lim2"].value.plus
    assert seconds["lim2_plus"] == pytest.approx(fall, abs=0.02)
    assert seconds["I_t1_plus"] == seconds["I_t2_plus"] == pytest.approx(1 / 512)
    assert seconds["a_plus"] > 0.1
    # 97.75 deg/s is well below the limit of 196 deg/s
    assert seconds["Z13_plus"] == seconds["Z14"] == seconds["Z15"] == 0.0
    assert seconds["Z16_plus"] > 0.2


def test_the_stop_is_reached_one_way() -> None:
    seconds = seconds_of(maneuvers.step(-9.0))
    assert seconds["Z13_minus"] > 3.0
    assert seconds["Z13_plus"] == 0.0


def test_limits_that_are_off_never_act() -> None:
    off = HOIST.replace(lim1=np.inf, lim2=np.inf, a=np.inf)
    seconds = seconds_of(maneuvers.step(9.0), off)
    assert seconds["lim1_plus"] == seconds["lim2_plus"] == seconds["a_plus"] == 0.0
    assert seconds["omega_plus"] > 0.0


def test_a_current_has_no_card() -> None:
    current = np.repeat([0.0, 0.6, -0.6], 512)
    seconds = acting(HOIST.simulate_current(current), HOIST.parameters)
    assert seconds["V_dz_plus"] == seconds["tau"] == 0.0
    assert seconds["Z19_plus"] == pytest.approx(1.0, abs=2 / 512)
    assert seconds["Z19_minus"] == pytest.approx(1.0, abs=2 / 512)


def test_the_table_of_runs() -> None:
    runs = {
        "low": HOIST.simulate(maneuvers.step(2.0).sample(512.0)),
        "high": HOIST.simulate(maneuvers.step(9.0).sample(512.0)),
    }
    unknowns = [
        Unknown("Z13", 0.28, 0.1, 0.5, sets=("Z13_plus", "Z13_minus")),
        Unknown("force_plus_4", 1.0, 0.5, 2.0),
        Unknown("Z14", 1e-3, 1e-4, 1e-2),
        Unknown("offset counts", 0.0, -1.0, 1.0, run="low"),
    ]
    table = activation(runs, HOIST.parameters, unknowns, FORCES)
    stops, forces, spool = table.T
    assert stops[0] == 0.0
    assert stops[1] > 3.0
    # 2 V leave less than 0.34 A beyond Z17, half way from the third current to the fourth
    assert forces[0] == 0.0
    assert forces[1] > 4.0
    assert not spool.any()


def test_needs_in_words() -> None:
    assert need_of("lim1_minus") == "a current rising at its limit"
    assert need_of("Z10") == "a tilted swash plate"
    assert need_of("force_minus_4", FORCES) == "0.38 A beyond Z17"


# --- proposals ------------------------------------------------------------------------------------


BY_ORDER = Free(relative=(0.5, 2.0), log=True)


def proposed(free: Mapping[str, Free], *runs: Experiment, **more: object) -> Proposal:
    stage = Stage(name="pump", part="pump", free=free, **more)  # type: ignore[arg-type]
    return propose(outlook(stage, HOIST.parameters, runs))


def complete(proposal: Proposal, *runs: Experiment) -> bool:
    assert proposal.proposed is not None
    return outlook(proposal.proposed, HOIST.parameters, runs).identifiability.complete


def test_away_from_the_stops_only_a_ratio_matters() -> None:
    runs = (run("a", 3.0), run("b", -3.0))
    found = proposed({"Z6": BY_ORDER, "Z8": BY_ORDER}, *runs)
    assert found.fixed == {"Z6": "only Z8/(1+Z6) is determined"}
    assert found.sentences() == ("Fix Z6: only Z8/(1+Z6) is determined.",)
    assert found.proposed is not None
    assert list(found.proposed.free) == ["Z8"]
    assert complete(found, *runs)


def test_a_direction_that_no_run_takes_is_fixed_alone() -> None:
    runs = (run("a", 9.0), run("b", 4.0))
    found = proposed({"Z13": BY_ORDER, "Z10": BY_ORDER, "Z14": BY_ORDER}, *runs)
    assert set(found.fixed) == {"Z13_minus", "Z14"}
    assert found.sentences() == ("Fix Z13_minus, Z14: no run exercises them.",)
    assert found.proposed is not None
    assert list(found.proposed.free) == ["Z13_plus", "Z10"]
    assert complete(found, *runs)


def test_tied_directions_stay_tied() -> None:
    tied = Free(relative=(0.5, 2.0), tied=True)
    found = proposed({"Z13": tied, "Z10": BY_ORDER}, run("a", 9.0))
    assert not found.changes
    assert found.sentences() == ()


def test_forces_are_asked_for_where_there_is_a_current() -> None:
    given = GivenForces(plus=(0.06, 0.16, 0.28, 0.40), minus=(0.06, 0.16, 0.28, 0.38))
    run_ = run("a", 4.0)
    largest = HOIST.simulate(run_.input.values).current.max() - HOIST["Z17"].value
    found = proposed({"Z10": BY_ORDER}, run_, forces=given)
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
    found = proposed({"Z14": BY_ORDER, "Z15": BY_ORDER}, run("a", 3.0))
    assert found.proposed is None
    assert "Nothing is then left of the stage 'pump'" in found.sentences()[-1]
    setup = Setup(stages=(found.stage,))
    with pytest.raises(InputError, match="determine none of the parameters"):
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
