"""A crane's file: numbers that are numbers, plausible ones, and sources that belong to them."""

import re

import pytest

from swashplate.crane import Crane, preset_text
from swashplate.errors import InputError, ParameterError


@pytest.fixture
def read(tmp_path):
    """A crane of the packaged file with entries replaced, by name."""

    def made(**entries):
        text = preset_text("tg3637")
        for name, entry in entries.items():
            text, count = re.subn(rf"(?m)^{name} = .*$", f"{name} = {entry}", text)
            assert count == 1, name
        path = tmp_path / "mine.toml"
        path.write_text(text, "utf-8")
        return Crane.from_toml(path)

    return made


def quantity(value, unit):
    return f'{{ value = {value}, unit = "{unit}" }}'


@pytest.mark.parametrize(
    "value", ["true", '"36"', "[36.0, true]", "nan", "inf", "1979-05-27", "{ a = 1 }"]
)
def test_what_is_no_number_is_refused(read, value):
    with pytest.raises(ParameterError, match=r"mine\.toml: geometry\.boom_length\.value "):
        read(boom_length=quantity(value, "m"))


IMPLAUSIBLE = {
    "boom_length": [("299", "mm"), ("36000", "m"), ("-36", "m"), ("1e300", "m"), ("1e-300", "m")],
    "foot_offset": [("-1", "m"), ("2500", "m")],
    "slew_axis": [("[40000, 8.5, 19.0]", "m"), ("[40.0, -1e300, 19.0]", "m")],
    "tower_sheave_distance": [("0", "m"), ("1e300", "m")],
    "tower_sheave_angle": [("-10", "deg"), ("1e300", "deg")],
    "hoist_drum_radius": [("1e-300", "m"), ("400", "m")],
    "hoist_falls": [("0.5", "1"), ("1e300", "1")],
    "luff_drum_radius": [("1e-300", "m"), ("400", "m")],
    "luff_falls": [("0", "1"), ("1e300", "1")],
    "rope_coupling": [("-0.5", "1"), ("1e9", "1")],
    "safe_load": [("0", "kg"), ("1e300", "kg"), ("35000", "t")],
    "boom_limits": [("[15, 100]", "deg"), ("[-1e300, 80]", "deg")],
    "rope_limits": [("[1e-300, 50.0]", "m"), ("[3.0, 1e300]", "m")],
}
RANGES = {
    "boom_length": "1 to 300 m",
    "foot_offset": "0 to 50 m",
    "slew_axis": "-450 to 450 m",
    "tower_sheave_distance": "0.1 to 150 m",
    "tower_sheave_angle": "0 to 180 deg",
    "hoist_drum_radius": "0.01 to 5 m",
    "hoist_falls": "1 to 250",
    "luff_drum_radius": "0.01 to 5 m",
    "luff_falls": "1 to 250",
    "rope_coupling": "0 to 4",
    "safe_load": r"1 to 3e\+07 kg",
    "boom_limits": "0 to 90 deg",
    "rope_limits": "0.05 to 6000 m",
    "deck": "0 to 100 m",
}


@pytest.mark.parametrize(
    ("name", "value", "unit"),
    [(name, *each) for name, all_ in IMPLAUSIBLE.items() for each in all_],
)
def test_implausible_values_are_refused_with_the_plausible_range(read, name, value, unit):
    with pytest.raises(ParameterError, match=rf"mine\.toml: {name} .* {RANGES[name]}") as error:
        read(**{name: quantity(value, unit)})
    assert str(error.value).count(". ") == 0


CRANES = {
    "ship to shore": {
        "boom_length": ("70.0", "m"),
        "foot_offset": ("3.0", "m"),
        "slew_axis": ("[0.0, 0.0, 45.0]", "m"),
        "tower_sheave_distance": ("35.0", "m"),
        "tower_sheave_angle": ("95.0", "deg"),
        "hoist_drum_radius": ("0.6", "m"),
        "hoist_falls": ("8", "1"),
        "luff_drum_radius": ("0.6", "m"),
        "luff_falls": ("12", "1"),
        "rope_coupling": ("0.0", "1"),
        "safe_load": ("65.0", "t"),
        "boom_limits": ("[0.0, 80.0]", "deg"),
        "rope_limits": ("[2.0, 70.0]", "m"),
    },
    "heavy lift of 5000 t": {
        "boom_length": ("125.0", "m"),
        "foot_offset": ("14.0", "m"),
        "slew_axis": ("[-95.0, 0.0, 35.0]", "m"),
        "tower_sheave_distance": ("62.0", "m"),
        "tower_sheave_angle": ("105.0", "deg"),
        "hoist_drum_radius": ("1.2", "m"),
        "hoist_falls": ("96", "1"),
        "luff_drum_radius": ("1.2", "m"),
        "luff_falls": ("64", "1"),
        "rope_coupling": ("0.0", "1"),
        "safe_load": ("5000.0", "t"),
        "boom_limits": ("[20.0, 82.0]", "deg"),
        "rope_limits": ("[5.0, 3500.0]", "m"),
    },
    "small knuckle boom": {
        "boom_length": ("2800", "mm"),
        "foot_offset": ("0.2", "m"),
        "slew_axis": ("[3.0, 1.2, 1.5]", "m"),
        "tower_sheave_distance": ("450", "mm"),
        "tower_sheave_angle": ("100.0", "deg"),
        "hoist_drum_radius": ("45", "mm"),
        "hoist_falls": ("1", "1"),
        "luff_drum_radius": ("45", "mm"),
        "luff_falls": ("2", "1"),
        "rope_coupling": ("0.0", "1"),
        "safe_load": ("150.0", "kg"),
        "boom_limits": ("[0.0, 75.0]", "deg"),
        "rope_limits": ("[0.2, 12.0]", "m"),
    },
}


@pytest.mark.parametrize("kind", CRANES)
def test_cranes_from_small_to_large_are_read(read, kind):
    crane = read(**{name: quantity(*entry) for name, entry in CRANES[kind].items()})
    assert crane.assumed == "2 of 15 quantities"
    assert crane.swing_damping == 0.005
    low, high = crane.rope_limits
    home = crane.home(boom_deg=45.0, rope_m=0.5 * (low + high))
    assert crane.geometry.boom < home.luff_rope + crane.geometry.sheave


def test_a_source_does_not_stay_with_another_value(read):
    starboard = 'status = "assumed", source = "starboard pedestal; foot about 12 m above deck"'
    reading = "type name read as 36 t at 37 m outreach: 2.5 m + 36 m cos 15 deg = 37.3 m"
    boom = f'status = "assumed", source = "{reading}"'
    with pytest.raises(
        ParameterError, match=r"mine\.toml: boom_length and slew_axis .* tg3637.*source"
    ):
        read(
            slew_axis=f'{{ value = [40.0, 8.5, 19.0], unit = "m", {starboard} }}',
            boom_length=f'{{ value = 28.0, unit = "m", {boom} }}',
        )
    # the same value in another unit keeps its source; another value with its own one is fine
    same = read(boom_length=f'{{ value = 36000, unit = "mm", {boom} }}')
    assert same.geometry.boom == pytest.approx(36.0)
    read(slew_axis='{ value = [40.0, 8.5, 19.0], unit = "m", source = "port pedestal, drawing 7" }')


def test_a_limits_source_does_not_stay_with_another_value(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(preset_text("tg3637").replace("value = 4.0", "value = 3.0"), "utf-8")
    with pytest.raises(ParameterError, match=r"mine\.toml: side_lead .* tg3637"):
        Crane.from_toml(path)


def test_published_values_have_a_source(read):
    with pytest.raises(ParameterError, match=r"mine\.toml: geometry\.safe_load: .*source"):
        read(safe_load='{ value = 15.0, unit = "t", status = "published" }')


def test_a_value_from_python_is_the_users(read):
    crane = Crane.preset("tg3637").with_geometry(slew_axis=(40.0, 8.5, 19.0), safe_load=15000)
    for name in ("slew_axis", "safe_load"):
        changed = crane.quantities[name]
        assert (changed.status, changed.source) == ("user", "")
    with pytest.raises(ParameterError, match="safe_load .* True, .* one number"):
        crane.with_geometry(safe_load=True)


def test_units_that_measure_something_else_are_refused(read):
    with pytest.raises(InputError, match="boom_length .* 'kg'"):
        read(boom_length=quantity("36.0", "kg"))
