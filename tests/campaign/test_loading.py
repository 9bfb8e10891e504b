"""A campaign file and its logs become experiments in SI."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from swashplate import Campaign, Drive, FileError, InputError, ParameterError, SwashplateError

Edit = Callable[..., Path]


def test_signals_are_in_si(campaign_folder: Path) -> None:
    tests = Campaign.from_toml(campaign_folder / "campaign.toml")
    assert (tests.title, len(tests), tests.virtual) == ("Bench", 2, False)
    up = tests["up"]
    assert up.input.unit == "V"
    assert up.input.time[:3] == pytest.approx([0.0, 0.01, 0.02], abs=1e-15)
    assert up.input.values[49:51] == pytest.approx([0.0, 4.0])
    assert up["current"].values[-1] == pytest.approx(0.4)
    # 40 counts a sample downwards, turned round; 2000 counts for a turn of the shaft
    counts = up["counts"]
    assert counts.counts is not None
    assert counts.counts[-1] == -40 * 50
    assert counts.values[-1] == pytest.approx(2.0 * np.pi, rel=1e-12)
    assert counts.unit == "rad"
    assert (up.role, tests["down"].role) == ("fit", "validate")
    assert up.start == "rest"


def test_selection_and_drive(campaign_folder: Path) -> None:
    tests = Campaign.from_toml(campaign_folder / "campaign.toml")
    assert [each.name for each in tests.select(role="validate")] == ["down"]
    assert tests.drive("winch").parameters == Drive.preset("hoist").parameters
    with pytest.raises(InputError, match="run 'sideways'.* up, down"):
        tests["sideways"]
    with pytest.raises(InputError, match="axis 'boom'.* winch"):
        tests.select(axis="boom")
    with pytest.raises(InputError, match="role 'train'.* fit, validate, ignore"):
        tests.select(role="train")
    assert tests[0] is tests.experiments[0]
    with pytest.raises(InputError, match="channel 'speed'.* current, counts"):
        tests["up"]["speed"]


def test_a_maneuver_is_stated_and_a_drive_lies_beside(edited: Edit, campaign_folder: Path) -> None:
    assert Campaign.from_toml(campaign_folder / "campaign.toml")["up"].maneuver == "step +4 V"
    Drive.preset("slew").to_toml(campaign_folder / "mine.toml")
    edited('file = "up.csv"', 'file = "up.csv"\nmaneuver = "harbour lift"')
    tests = Campaign.from_toml(edited('drive = "hoist"', 'drive = "mine.toml"'))
    assert tests["up"].maneuver == "harbour lift"
    assert tests.drive("winch").name == "slew"


def test_an_override_holds_for_its_run_alone(edited: Edit) -> None:
    path = edited(
        'file = "down.csv"',
        'file = "down.csv"\naxes.winch.channels.counts.gear_ratio = 1.0\n'
        "axes.winch.input.scale = 0.5",
    )
    tests = Campaign.from_toml(path)
    assert tests["down"]["counts"].values[-1] == pytest.approx(-4.0 * np.pi)
    assert tests["down"].input.values[-1] == pytest.approx(-2.0)
    assert tests["up"]["counts"].values[-1] == pytest.approx(2.0 * np.pi)
    assert tests["up"].input.values[-1] == pytest.approx(4.0)


def test_a_unit_in_the_header_counts_unless_another_is_stated(edited: Edit) -> None:
    edited("time,joystick,ammeter", "time,joystick,ammeter [dA]", "up.csv")
    path = edited("time,joystick,ammeter", "time,joystick,ammeter [dA]", "down.csv")
    assert Campaign.from_toml(path)["up"]["current"].values[-1] == pytest.approx(0.4)
    edited('unit = "mA"\n', "")
    assert Campaign.from_toml(path)["up"]["current"].values[-1] == pytest.approx(40.0)


def test_weights_multiply_and_ignored_windows_are_zero(edited: Edit) -> None:
    edited(
        'unit = "mA"\n',
        'unit = "mA"\nweight = 2.0\nweight_by_input = [[0.0, 1.0], [8.0, 0.5]]\n'
        "weights = [{ from = 0.6, to = 0.7, factor = 3.0 },"
        " { maneuver = 'sine *', factor = 100.0 }]\n"
        "ignore = [{ to = 0.1 }]\n",
    )
    path = edited(
        'file = "up.csv"',
        'file = "up.csv"\nweight = 5.0\nweights = [{ maneuver = "step *", factor = 7.0 }]\n'
        'ignore = [{ from = 0.9, why = "hit the stop" }]',
    )
    up = Campaign.from_toml(path)["up"]
    weight = up["current"].weight
    # at 4 V the polyline from 1 at 0 V to 0.5 at 8 V has 0.75
    assert weight[[0, 10]] == pytest.approx([0.0, 0.0])
    assert weight[20] == pytest.approx(2.0 * 5.0 * 7.0)
    assert weight[55] == pytest.approx(2.0 * 5.0 * 7.0 * 0.75)
    assert weight[60] == pytest.approx(2.0 * 5.0 * 7.0 * 0.75 * 3.0)
    assert weight[90] == 0.0
    assert up.ignored == ((0.9, np.inf, "hit the stop"),)
    assert up["counts"].weight[0] == pytest.approx(5.0 * 7.0)


def test_missing_samples_are_refused_or_dropped_and_counted(edited: Edit) -> None:
    path = edited("300,0,0,0\n", "300,0,,0\n", "up.csv")
    with pytest.raises(FileError) as caught:
        Campaign.from_toml(path)
    assert (
        "up.csv: column 'ammeter' (channel 'current') has no finite number in data row 31;"
        in str(caught.value)
    )
    edited('unit = "mA"', 'unit = "mA"\nmissing = "drop"')
    up = Campaign.from_toml(path)["up"]
    assert up["current"].dropped == 1
    assert up["current"].time.size == 100
    assert up["counts"].time.size == 101


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('title = "Bench"', "title = 3", "title ... 3, ... text"),
        ('title = "Bench"', "titel = 'x'", "'titel': ... 'title'"),
        ('column = "joystick"', 'colum = "joystick"', "axes.winch.input"),
        ('kind = "voltage"', 'kind = "volt"', "axes.winch.input.kind ...'volt'"),
        ("counts_per_turn = 1000\n", "", "encoder_counts ... counts_per_turn"),
        ("gear_ratio = 2.0", "gear_ratio = 0.0", "gear_ratio ... 0.0"),
        ('{ column = "time", unit = "ms" }', "{ unit = 'ms' }", "column of the time"),
        ('role = "validate"', 'role = "check"', "runs 2.role ...'check'"),
        ('role = "validate"', 'start = "given"', "start_pressure"),
        (
            'role = "validate"',
            'start = "given"\nstart_pressure = 1e300',
            "start_pressure ... 1e+300",
        ),
        ('role = "validate"', "ignore = [{ from = 2.0, to = 1.0 }]", "2.0 s to 1.0 s"),
        ('role = "validate"', 'only = ["boom"]', "axis 'boom', ... winch"),
        ('role = "validate"', 'name = "up"', "two runs ... 'up'"),
        ('role = "validate"', "axes.winch.input.unti = 'V'", "'unti': ... 'unit'"),
        ('column = "joystick"', 'column = "lever"', "the input: "),
        ('unit = "mV"', 'unit = "bar"', "'bar', ... V"),
        ('unit = "mA"', 'unit = "mAA"', "unknown unit 'mAA'"),
        ('file = "up.csv"', 'file = "left.csv"', "left.csv"),
        ('unit = "ms"', 'unit = "V"', "'V', ... s"),
        ("[[runs]]", "[[runs]", "TOML"),
        ('role = "validate"', "axes.winch.channels.count.sign = 1", "channel 'count'"),
        ('unit = "mV"', 'unit = "V/0"', "unreadable unit 'V/0'"),
        ('unit = "mV"', 'unit = "V", offset = 1e30', "unit, scale and offset"),
        *(
            ("counts_per_turn = 1000", f"counts_per_turn = {value}", f"{value} ...1e-06 to 1e+12")
            for value in ("5e-324", "1e-300", "1e+300")
        ),
        ("gear_ratio = 2.0", "gear_ratio = 5e-324", "gear_ratio: 5e-324 ... 1e-06 to 1e+12"),
        ('column = "time", unit = "ms"', "rate = 5e-324", "rate: 5e-324 ... 1e-06 to 1e+12"),
        *(
            ('unit = "mA"', f'unit = "mA"\n{entry}', f"{value} ... {low} to {high}")
            for entry, value, low, high in (
                ("scale = 5e-324", "5e-324", "1e-30", "1e+30"),
                ("scale = -1e308", "-1e+308", "-1e+30", "-1e-30"),
                ("offset = 1e308", "1e+308", "1e-30", "1e+30"),
                ("noise = 5e-324", "5e-324", "1e-30", "1e+30"),
                ("weight = 1e308", "1e+308", "1e-30", "1e+30"),
                ("limits = [0.0, 1e308]", "1e+308", "1e-30", "1e+30"),
                ("accuracy = { zero = 1e308 }", "1e+308", "1e-30", "1e+30"),
            )
        ),
        # they go down to -2040
        (
            "gear_ratio = 2.0",
            "rolls_over_at = 1024",
            "counter of 1024 ",
        ),
        ("gear_ratio = 2.0", "rolls_over_at = 10.5", "a whole number of counts"),
        (
            'unit = "mA"',
            'unit = "mA"\nrolls_over_at = 9',
            "rolls_over_at ... encoder_counts and positions",
        ),
        (
            'kind = "rectified_current"\ncolumn = "ammeter"\nunit = "mA"',
            'kind = "position"\ncolumn = "ammeter"\nunit = "deg"\nrolls_over_at = 360',
            "up.csv: column 'ammeter': ... 1.111 times rolls_over_at",
        ),
    ],
)
def test_what_is_wrong_is_one_sentence(edited: Edit, old: str, new: str, sentence: str) -> None:
    path = edited(old, new)
    with pytest.raises(SwashplateError) as caught:
        Campaign.from_toml(path)
    message = str(caught.value)
    for part in sentence.split("..."):
        assert part in message
    assert "\n" not in message
    assert message.endswith(".")


def test_the_campaign_file_itself(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"campaign\.toml"):
        Campaign.from_toml(tmp_path / "campaign.toml")
    (tmp_path / "campaign.toml").write_text("title = 'x'\n", "utf-8")
    with pytest.raises(ParameterError, match="entry 'axes'"):
        Campaign.from_toml(tmp_path / "campaign.toml")


# --- entries that a person has to settle, and campaigns without runs ------------------------------


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('unit = "mA"', 'unit = "A"    # FIXME: no unit', r"\.current\]: unit = \"A\" is"),
        (
            'unit = "mA"',
            '# unit = "A"    # FIXME: the header gives none',
            r"unit = \"A\" is .*none",
        ),
        ("gear_ratio", "scale = 1.0    # FIXME\ngear_ratio", r"\.counts\]: scale = 1.0 is"),
        ('role = "validate"', 'role = "validate"  # FIXME', r"\[\[runs\]\]: role"),
        ('title = "Bench"', 'title = "FIXME"', r"line \d+: title"),
    ],
)
def test_a_file_in_which_an_entry_is_open_is_refused(
    edited: Edit, old: str, new: str, said: str
) -> None:
    path = edited(old, new)
    number = next(k for k, line in enumerate(path.read_text().splitlines(), 1) if "FIXME" in line)
    with pytest.raises(ParameterError, match=rf"campaign.toml, line {number}\b.*FIXME.*delete"):
        Campaign.from_toml(path)
    with pytest.raises(ParameterError, match=said):
        Campaign.from_toml(path)


def test_a_remark_is_no_open_entry(edited: Edit) -> None:
    path = edited('title = "Bench"', '# FIXME is what drafts write\ntitle = "Bench"')
    assert len(Campaign.from_toml(path)) == 2


def test_all_open_entries_are_counted(edited: Edit) -> None:
    edited('title = "Bench"', 'title = "Bench"    # FIXME')
    path = edited('role = "validate"', 'role = "validate"    # FIXME')
    with pytest.raises(ParameterError, match=r"title .* so is line \d+"):
        Campaign.from_toml(path)


def test_a_campaign_without_a_run_that_is_read_says_so(edited: Edit) -> None:
    edited('role = "validate"', 'role = "ignore"')
    path = edited('file = "up.csv"', 'file = "up.csv"\nrole = "ignore"')
    tests = Campaign.from_toml(path)
    assert len(tests) == 0
    assert "role 'ignore'" in tests.without_runs
    assert not Campaign.from_toml(edited('\nrole = "ignore"', "")).without_runs
