import numpy as np
import pytest

from swashplate import Drive, InputError, ParameterError
from swashplate.analysis.whatif import LEVERS, find_lever, pulled, pulled_columns
from swashplate.parameters.definitions import columns_of

HOIST_Z16 = (1.1634e-04, 1.5126e-04)


@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        ({"orifice": 1.5}, {"Z16_plus": 1.74510e-4, "Z16_minus": 2.26890e-4}),
        ({"orifice_plus": 2.0}, {"Z16_plus": 2.32680e-4, "Z16_minus": 1.5126e-4}),
        # an area goes with the square of its diameter
        ({"orifice_diameter": 1.2}, {"Z16_plus": 1.675296e-4, "Z16_minus": 2.178144e-4}),
        ({"pump": 1.5}, {"Z10": 18.594}),
        ({"pump": 1.5, "drive_speed": 0.8}, {"Z10": 14.8752}),
        ({"dead_zone": 0.0}, {"V_dz_plus": 0.0, "V_dz_minus": 0.0}),
        ({"rate_limit_up": np.inf}, {"lim1_plus": np.inf, "lim1_minus": np.inf}),
        ({"spool_stroke": 0.5}, {"Z14": 0.00182305}),
        ({"relief": 2.0}, {"Z15": 8.2382e6}),
        ({"Z9": 1.1}, {"Z9": 1.18173e7}),
        ({"Z16_minus": 2.0}, {"Z16_plus": 1.1634e-4, "Z16_minus": 3.0252e-4}),
    ],
)
def test_what_a_lever_multiplies(hoist, factors, expected):
    numbers = pulled(hoist, factors).parameters.numbers
    assert {name: numbers[name] for name in expected} == pytest.approx(expected, rel=1e-12)
    others = set(hoist.parameters.numbers) - set(pulled_columns(hoist.parameters.numbers, factors))
    assert all(numbers[name] == hoist.parameters.numbers[name] for name in others)


def test_the_flow_of_the_pump_takes_the_loss_to_an_accelerating_load_along():
    """Z12 = K_mL K_mf C_i C_q holds the pump's displacement as Z10 = K_mf C_q does."""
    drive = Drive.preset("hoist").replace(Z11=0.1, Z12=0.2)
    larger = pulled(drive, {"pump": 1.5})
    assert larger["Z12"].value == pytest.approx(0.3)
    assert larger["Z11"].value == 0.1


def test_a_factor_of_one_changes_no_number(hoist):
    for name in LEVERS:
        assert pulled(hoist, {name: 1.0}).parameters.numbers == hoist.parameters.numbers


def test_many_settings_at_once(hoist):
    columns = pulled_columns(
        hoist.parameters.numbers, {"orifice": [1.0, 1.5], "orifice_plus": [2.0, 1.0]}
    )
    np.testing.assert_allclose(columns["Z16_plus"], np.multiply(HOIST_Z16[0], [2.0, 1.5]))
    np.testing.assert_allclose(columns["Z16_minus"], np.multiply(HOIST_Z16[1], [1.0, 1.5]))


def test_every_lever_says_what_it_is_and_moves_parameters_that_there_are():
    for lever in LEVERS.values():
        assert lever.meaning.endswith(".")
        assert columns_of(list(lever.powers))


def test_refusals(hoist):
    with pytest.raises(InputError, match=r"no lever 'orifise' \(did you mean orifice\?\)"):
        find_lever("orifise")
    with pytest.raises(InputError, match="no lever 'xyz'; the levers are orifice, "):
        find_lever("xyz")
    with pytest.raises(InputError, match="The factor on pump is -1, but must be 0 or more"):
        pulled(hoist, {"pump": -1.0})
    with pytest.raises(InputError, match="The factor on pump is nan"):
        pulled(hoist, {"pump": float("nan")})
    with pytest.raises(InputError, match="Z15 is inf, which the factor 0 cannot change"):
        pulled(hoist.replace(Z15=np.inf), {"relief": 0.0})
    with pytest.raises(ParameterError, match="Z10"):
        pulled(hoist, {"pump": 0.0})
