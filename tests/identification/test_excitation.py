"""What each run makes the drive do, and which run tells of which unknown."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swashplate import Channel, Drive, Experiment, maneuvers
from swashplate.campaign.experiment import InputSignal, Source
from swashplate.identification.drive_model import Forces
from swashplate.identification.excitation import (
    Outlook,
    acting,
    activation,
    need_of,
    outlook,
)
from swashplate.identification.fitting import smooth
from swashplate.identification.setup import Free, GivenForces, Stage
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
        "Z13_minus needs the swash plate at its stop (minus), which no run has: fix it, or add a "
        "test that has it.",
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
        "size beyond Z17 (minus), which no run has: ask for forces at smaller currents, or add a "
        "test that has it."
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
