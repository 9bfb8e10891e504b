"""What someone should look into before a fit; nothing in a good measurement."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.drafting.conftest import Drafted

from swashplate import Campaign
from swashplate.campaign import Quality, beyond_the_card, campaign_findings, examine

Edit = Callable[..., Path]


def qualities(path: Path, run: str = "up") -> dict[str, Quality]:
    return {each.signal: each for each in examine(Campaign.from_toml(path)[run])}


def rewrite(path: Path, change: Callable[[np.ndarray], np.ndarray]) -> Path:
    log = path.parent / "up.csv"
    header, *rows = log.read_text("utf-8").splitlines()
    table = change(np.array([[float(cell) for cell in row.split(",")] for row in rows]))
    lines = [",".join(f"{cell:.10g}" for cell in row) for row in table]
    log.write_text("\n".join([header, *lines]) + "\n", "utf-8")
    return path


def test_a_good_log_has_no_findings(campaign_folder: Path) -> None:
    found = qualities(campaign_folder / "campaign.toml")
    assert list(found) == ["input", "current", "counts"]
    for each in found.values():
        assert each.findings == ()
        assert each.stamps.rate == pytest.approx(100.0)
        assert each.stamps.gaps.size == 0
    assert (found["input"].low, found["input"].high) == (0.0, 4.0)
    assert found["counts"].lost_counts == 0
    assert found["current"].lost_counts is None


SHOWN = {
    "1 gap, the longest 0.11 s; 10 samples are missing": (
        "input",
        lambda t: np.delete(t, range(20, 30), axis=0),
    ),
    "-900 counts at 0.795 s": ("counts", lambda t: t - np.outer(t[:, 0] >= 800.0, [0, 0, 0, 900])),
    "is it connected": ("current", lambda t: t * [1, 1, 0, 1] + [0, 0, 12.0, 0]),
    "should it be signed_current": (
        "current",
        lambda t: t * np.where(t[:, :1] >= 600.0, [1, 1, -1, 1], 1.0),
    ),
    "nothing can be identified": ("input", lambda t: t * [1, 0, 0, 0]),
    "check unit, scale and offset": ("input", lambda t: t * [1, 10, 1, 1]),
    "should its sign be -1": ("counts", lambda t: t * [1, 1, 1, -1]),
}


@pytest.mark.parametrize("said", SHOWN)
def test_what_a_log_shows(campaign_folder: Path, said: str) -> None:
    signal, change = SHOWN[said]
    found = qualities(rewrite(campaign_folder / "campaign.toml", change))
    assert said in found[signal].findings[0]
    if said.startswith("1 gap"):  # stamps that are the input's are told of once
        assert found["current"].stamps.longest == pytest.approx(0.11)
        assert found["current"].findings == ()


def test_clipping_at_the_ends_of_the_range(edited: Edit) -> None:
    path = edited('unit = "mA"', 'unit = "mA"\nlimits = [0.0, 400.0]')
    # 50 samples at 0 and 51 at 400 mA
    assert qualities(path)["current"].clipped == 1.0
    path = edited("limits = [0.0, 400.0]", "limits = [-10.0, 400.0]")
    assert qualities(path)["current"].clipped == pytest.approx(51 / 101)


# --- windows that no run takes --------------------------------------------------------------------


GEAR = "gear_ratio = 2.0\n"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        # records go from 0 to 1 s; a step of +4 V in one run, of -4 V in the other
        (
            GEAR,
            f'{GEAR}ignore = [{{ from = 0.9 }}, {{ maneuver = "step +*" }}]\n'
            "weights = [{ from = 0.2, to = 0.3, factor = 2.0 }]\n",
            (),
        ),
        (
            GEAR,
            f'{GEAR}ignore = [{{ maneuver = "setp *" }}]\n',
            (
                "axes.winch.channels.counts.ignore: no run has the maneuver 'setp *', so its "
                "window has no effect; the maneuvers are 'step +4 V', 'step -4 V'",
            ),
        ),
        # in ms, as the log's stamps are
        (
            'drive = "hoist"',
            'drive = "hoist"\nignore = [{ from = 100.0, to = 200.0, why = "x" }]',
            (
                "axes.winch.ignore: the window from 100 s to 200 s contains no sample of any of 2 "
                "runs",
            ),
        ),
        (
            'role = "validate"',
            'role = "validate"\nweights = [{ from = 7.0, factor = 2.0 }]',
            (
                "run 2 (down.csv): weights: the window from 7 s to its end contains no sample of "
                "down, which goes from 0 to 1 s",
            ),
        ),
    ],
)
def test_windows_that_no_run_takes(edited: Edit, old: str, new: str, said: tuple[str, ...]) -> None:
    assert campaign_findings(Campaign.from_toml(edited(old, new))) == said


# --- what a campaign lacks to be held against a drive ---------------------------------------------


def test_no_channel_measures_the_motion_and_a_command_is_beyond_the_card(edited: Edit) -> None:
    """Written as 4 V, -4 V and meant as three times that."""
    path = edited('unit = "mV" }', 'unit = "mV", scale = 3.0 }')
    head, _, rest = path.read_text("utf-8").partition("[axes.winch.channels.counts]")
    path.write_text(head + rest[rest.index("[[runs]]") :], "utf-8")
    tests = Campaign.from_toml(path)
    (said,) = campaign_findings(tests)
    assert said.startswith("axis 'winch': no channel measures its motion")
    (up,), (down,) = (beyond_the_card(each) for each in tests)
    assert "up.csv: column 'joystick': the voltage is 12 V at 0.5 s, but the card takes" in up
    assert "the voltage is -12 V" in down
    assert "[axes.winch.input]" in down


def test_a_stick_that_rests_away_from_zero_is_named(edited: Edit) -> None:
    """One that goes from 1 to 9 V about 5 V, as many do."""
    path = edited('unit = "mV" }', 'unit = "mV", offset = 5000.0 }')
    said, *_ = campaign_findings(Campaign.from_toml(path))
    assert said.startswith("axis 'winch': it moves both ways although its command never changes")
    assert "rests at 5 V needs offset = -5 in [axes.winch.input]" in said


@pytest.mark.parametrize("step", [1, 4])
def test_an_encoder_resolves_the_step_of_its_counts(campaign_folder: Path, step: int) -> None:
    """A decoder that counts every fourth edge is four times as coarse."""

    def faster(table: np.ndarray) -> np.ndarray:
        turned = step * np.rint(1e-4 * table[:, 0] ** 2)
        return np.column_stack([table[:, :3], turned])

    path = campaign_folder / "campaign.toml"
    even = Campaign.from_toml(path)["up"]["counts"]
    count = abs(even.encoder.angle_per_count)
    assert even.resolution == count  # equal steps are a constant speed
    run = Campaign.from_toml(rewrite(path, faster))["up"]
    assert run["counts"].resolution == step * count
    assert run["current"].resolution is None


# --- runs beside each other -----------------------------------------------------------------------


def tacho(drafted: Drafted, factors: dict[str, float], resolution: float = 1e-9) -> Campaign:
    """Steps of several volts on a machine of 20 1/min a volt, a factor on each log's reading."""
    time, logs = np.arange(800) / 100.0, {}
    for volts, (name, factor) in enumerate(factors.items(), 4):
        command = volts * ((time > 1.0) & (time < 6.0))
        speed = factor * 20.0 * np.convolve(command, np.ones(50) / 50.0)[: time.size]
        read = np.round(speed / resolution) * resolution
        logs[f"{name}.csv"] = {"time": time, "voltage": command, "n [1/min]": read}
    return drafted(logs)


@pytest.mark.parametrize("factor", [2.0 * np.pi / 60.0, 60.0])
def test_a_log_in_another_unit_is_named(drafted: Drafted, factor: float) -> None:
    """One log in rad/s, or in turns per hour, under a unit of 1/min."""
    tests = tacho(drafted, {"a": 1.0, "b": 1.0, "odd": factor, "c": 1.0})
    (said,) = campaign_findings(tests)
    assert said.startswith(
        f"odd: 'shaft_speed' moves {factor:.3g} times as fast as in the other runs"
    )
    assert "check the unit of 'n [1/min]' in this log" in said


def test_runs_of_one_machine_have_one_scale(drafted: Drafted) -> None:
    assert campaign_findings(tacho(drafted, {"a": 1.0, "b": 1.3, "c": 0.8, "d": 1.0})) == ()


def test_a_coarse_reading_is_named(drafted: Drafted) -> None:
    coarse = tacho(drafted, {"a": 1.0}, resolution=5.0)
    (found,) = (each for each in examine(coarse["a"]) if each.signal == "shaft_speed")
    assert found.findings == (
        "reads in steps of 30 deg/s, 6.2 % of its range: smaller motions and dead zones cannot be "
        "resolved",
    )
    fine = tacho(drafted, {"a": 1.0}, resolution=1.0)
    assert all(each.findings == () for each in examine(fine["a"]))
