"""Tables of a run in SI, and in the units that the terminal shows."""

import numpy as np
import pytest

from swashplate import Drive, InputError, maneuvers
from swashplate.units import shown_in

RUN = Drive.preset("hoist").simulate(maneuvers.step(9.0, stop=2.0, length=3.0))


def test_a_table_is_in_si_by_default() -> None:
    frame = RUN.to_polars()
    assert frame.columns[0] == "time"
    np.testing.assert_array_equal(frame["shaft_speed"], RUN.shaft_speed)
    assert frame.columns == RUN.to_polars(units="SI").columns


def test_a_table_in_the_units_of_the_terminal() -> None:
    frame = RUN.to_pandas(units="display")
    assert frame.shape == RUN.to_pandas().shape
    factors = {
        "shaft_speed [deg/s]": (RUN.shaft_speed, 180.0 / np.pi),
        "shaft_position [deg]": (RUN.shaft_position, 180.0 / np.pi),
        "swash_angle [deg]": (RUN.swash_angle, 180.0 / np.pi),
        "stroker_pressure [bar]": (RUN.stroker_pressure, 1e-5),
        "spool_position [mm]": (RUN.spool_position, 1e3),
        "current [A]": (RUN.current, 1.0),
        "voltage [V]": (RUN["voltage"], 1.0),
        "time [s]": (RUN.time, 1.0),
    }
    for name, (values, factor) in factors.items():
        np.testing.assert_allclose(frame[name], factor * values, rtol=1e-13)
    np.testing.assert_array_equal(frame["limit_orifice"], RUN.active("orifice"))


def test_a_unit_does_not_depend_on_the_numbers() -> None:
    rest = Drive.preset("hoist").simulate(maneuvers.rest(1.0))
    assert [*rest.to_pandas("display").columns] == [*RUN.to_pandas("display").columns]


def test_chosen_units_are_those_of_the_table() -> None:
    with shown_in(["rpm"]):
        frame = RUN.to_polars("display")
    np.testing.assert_allclose(frame["shaft_speed [rpm]"], RUN.shaft_speed * 30.0 / np.pi)
    assert "shaft_position [turns]" in frame.columns


def test_other_units_are_refused() -> None:
    with pytest.raises(InputError, match="'bar'.* 'SI' or 'display'"):
        RUN.to_polars(units="bar")  # type: ignore[arg-type]


def test_a_single_number_is_not_a_record() -> None:
    hoist = Drive.preset("hoist")
    with pytest.raises(InputError, match=r"voltage .* 9: .*maneuvers\.step\(9\)"):
        hoist.simulate(9.0)
    with pytest.raises(InputError, match="current .* 0.3") as caught:
        hoist.simulate_current(0.3)
    assert "maneuver" not in str(caught.value)
