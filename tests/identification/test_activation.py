"""What each run makes the drive do, at thresholds that are passed or not by construction."""

import numpy as np
import pytest

from swashplate import Drive, maneuvers
from swashplate.identification.drive_model import Forces
from swashplate.identification.excitation import acting, activation, need_of
from swashplate.identification.fitting import smooth
from swashplate.identification.unknowns import Unknown

HOIST = Drive(smooth(Drive.preset("hoist").parameters))
FORCES = Forces((0.06, 0.16, 0.28, 0.40), (0.06, 0.16, 0.28, 0.38))


def found(maneuver: maneuvers.Maneuver, drive: Drive = HOIST) -> dict[str, float]:
    return acting(drive.simulate(maneuver.sample(512.0)), drive.parameters)


def test_a_command_within_the_dead_zone_exercises_nothing_of_the_card() -> None:
    seconds = found(maneuvers.step(0.1))
    card = ("V_dz_plus", "J_plus", "omega_plus", "lim1_plus", "lim2_plus", "a_plus", "tau", "Z17")
    assert [seconds[name] for name in card] == [0.0] * len(card)
    # the plussing tilts the plate all the same
    assert seconds["Z18"] > 9.0


def test_durations_of_a_step_by_hand() -> None:
    seconds = found(maneuvers.step(4.0))
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
    seconds = found(maneuvers.step(-9.0))
    assert seconds["Z13_minus"] > 3.0
    assert seconds["Z13_plus"] == 0.0


def test_limits_that_are_off_never_act() -> None:
    off = HOIST.replace(lim1=np.inf, lim2=np.inf, a=np.inf)
    seconds = found(maneuvers.step(9.0), off)
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
    assert table.runs == ("low", "high")
    assert table.names == ("Z13", "force_plus_4", "Z14")
    assert table["Z13"][0] == 0.0
    assert table["Z13"][1] > 3.0
    # 2 V leave less than 0.34 A beyond Z17, half way from the third current to the fourth
    assert table["force_plus_4"][0] == 0.0
    assert table["force_plus_4"][1] > 4.0
    assert not table["Z14"].any()


def test_needs_in_words() -> None:
    assert need_of("lim1_minus") == "a current rising at its limit"
    assert need_of("Z10") == "a tilted swash plate"
    assert need_of("force_minus_4", FORCES) == "0.38 A beyond Z17"
