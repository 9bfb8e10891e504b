"""Kruse's numbers: static table, limits, accelerations, settled speeds, and the published tables.

The expected values are those of the model description, worked out from the published parameters
apart from this code, and good to the digits given. The tables' text: tests/reproduction.
"""

import numpy as np
import pytest

from swashplate import Drive, maneuvers
from swashplate.parameters import CATALOGUE

STATIC = {
    # volts: hoist+ A, deg/s; hoist-; slew+; slew-
    1.0: ((0.3184, 22.25), (0.3447, -22.16), (0.2048, 0.88), (0.1979, -0.76)),
    4.0: ((0.4754, 97.75), (0.5093, -85.72), (0.3185, 3.23), (0.3071, -3.06)),
    6.5: ((0.6106, 161.67), (0.6374, -153.98), (0.4132, 4.24), (0.3980, -4.29)),
    9.0: ((0.7452, 196.0), (0.7474, -185.0), (0.5079, 4.24), (0.4890, -4.29)),
}


@pytest.mark.parametrize("volts", STATIC)
def test_static_table(volts: float) -> None:
    columns = STATIC[volts]
    for drive, sign, (ampere, speed) in zip(
        ("hoist", "hoist", "slew", "slew"), (1, -1, 1, -1), columns, strict=True
    ):
        found = Drive.preset(drive)
        assert abs(found.steady_current(sign * volts)) == pytest.approx(ampere, abs=0.5e-4)
        digit = 0.05 if abs(speed) in (196.0, 185.0) else 0.005
        assert np.rad2deg(found.steady_speed(sign * volts)) == pytest.approx(speed, abs=digit)


@pytest.mark.parametrize(
    ("name", "limits", "accelerations", "saturated"),
    [
        ("hoist", (196.0, 185.0), (136.8, 177.8), (7.87, 7.41)),
        ("slew", (4.242, 4.292), (5.81, 5.87), (5.30, 5.62)),
        ("luff", (155.9, 190.8), (35.9, 88.9), None),
    ],
)
def test_limits_under_full_current(
    name: str, limits: tuple, accelerations: tuple, saturated: tuple | None
) -> None:
    """First Z10 Z1 Z8 √(Z9/2) Z16/(1+Z6), with the orifice open; at last the speed is Z10·Z13."""
    drive, fine = Drive.preset(name), 0.1 if name == "slew" else 1.0
    for k, sign in enumerate((1.0, -1.0)):
        speed = sign * np.rad2deg(drive.simulate_current(np.full(9000, sign)).shaft_speed)
        assert speed.max() == pytest.approx(limits[k], abs=0.05 * fine**2)
        assert (speed[1] - speed[0]) * 512.0 == pytest.approx(accelerations[k], abs=0.05 * fine)
        if saturated:
            most, volts = abs(drive.steady_speed(sign * 10.0)), sign * saturated[k]
            assert abs(drive.steady_speed(volts + sign * 0.01)) == most
            assert abs(drive.steady_speed(volts - sign * 0.01)) < most


def test_hoist_9_volt_step_reaches_its_limit_and_falls_back_without_wind_up(hoist: Drive) -> None:
    run = hoist.simulate(maneuvers.step(9.0).sample(512.0))
    speed = np.rad2deg(run.shaft_speed)
    assert speed.max() == pytest.approx(196.0, abs=0.05)
    # the hoist creeps at 0 V, the slew does not
    assert speed[-1] == pytest.approx(3.09, abs=0.005)
    assert Drive.preset("slew").steady_speed(0.0) == 0.0
    # without the relief the plate would stay at its stop long after the command has gone
    leaves = np.flatnonzero(speed > 195.9)[-1] / 512.0
    assert 6.0 < leaves < 6.25


@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
def test_every_maneuver_settles_where_the_static_curve_says(name: str) -> None:
    """Steps of the campaign and their mirror images, both directions."""
    drive = Drive.preset(name)
    for test, maneuver in maneuvers.source_tests(name).items():
        for signed in (maneuver, -maneuver):
            run = drive.simulate(signed.sample(512.0))
            assert np.isfinite(run.shaft_speed).all()
            low, high = drive.steady_speed(-10.0), drive.steady_speed(10.0)
            assert low - 1e-12 <= run.shaft_speed.min()
            assert run.shaft_speed.max() <= high + 1e-12
            if test.startswith("step"):
                level = float(run.voltage[5 * 512])
                assert run.shaft_speed[6 * 512 - 1] == pytest.approx(
                    drive.steady_speed(level), rel=2e-3
                )


# --- the published tables -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
def test_tables_4_1_to_4_4_and_7_2_to_8_3_are_the_packaged_sets(
    name: str, source_parameters: dict
) -> None:
    pump = source_parameters["pump_motor"][name]
    card = source_parameters["control_card"][pump["control_card"]]
    drive = Drive.preset(name)
    assert drive.parameters.card == pump["control_card"]
    facts = {key: value for key, value in {**card, **pump}.items() if key in drive.parameters}
    assert set(facts) == set(drive.parameters)
    for symbol, fact in facts.items():
        parameter = drive[symbol]
        assert parameter.unit == source_parameters["units"][symbol]
        assert list(parameter.values) == (fact if isinstance(fact, list) else [fact]), symbol
        assert parameter.source.startswith("table")


@pytest.mark.parametrize(
    ("name", "symbol", "values", "status"),
    [
        # a few cells by hand, for a checkout without the tables
        ("hoist", "Z1", (4.6441e-07,), "fitted"),
        ("hoist", "Z16", (1.1634e-04, 1.5126e-04), "fitted"),
        ("hoist", "Z22", (0.0, -54.153), "fitted"),
        ("hoist", "lim2", (2.2615, 2.6483), "fitted"),
        ("hoist", "tau", (0.014,), "assumed"),
        ("slew", "V_dz", (0.090948, 0.088321), "fitted"),
        ("slew", "C", (4.8368, 4.8368), "fitted"),
        ("slew", "Z14", (3.6461e-03,), "inactive"),
        ("luff", "Z15", (4.5768e08,), "approximate"),
        ("luff", "Z13", (0.059489, 0.07282), "assumed"),
        ("luff", "Z1", (2.9459e-07,), "approximate"),
    ],
)
def test_cells_and_how_they_were_found(
    name: str, symbol: str, values: tuple[float, ...], status: str
) -> None:
    found = Drive.preset(name)[symbol]
    assert (found.values, found.status) == (values, status)


def test_erratum_05_units_of_g2_and_g3() -> None:
    """Table 8.1 prints A/V for both; 3.3 needs A/V² and A/V³."""
    assert (CATALOGUE["G2"].unit, CATALOGUE["G3"].unit) == ("A/V^2", "A/V^3")
