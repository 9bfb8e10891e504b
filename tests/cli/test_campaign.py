"""``campaign``, ``rig`` and ``advise``: tests, and what they are worth."""

import json
import re
import shutil
from collections.abc import Callable
from math import pi
from pathlib import Path

import polars as pl
import pytest
from tests.cli.conftest import freeing
from typer.testing import Result

from swashplate import Campaign, Drive

Words = Callable[..., str]
COUNTS = ("--counts-per-turn", "1000")
ROWS = [
    f"{k / 100},{4 if k > 20 else 0},{0.4 if k > 20 else 0},{7 * max(k - 20, 0)}"
    for k in range(100)
]


def steps(*volts: float) -> tuple[str, ...]:
    """Short steps, as options."""
    tests = [f"step:{each},start=0.5,stop=2.5,length=4" for each in volts]
    return tuple(word for each in tests for word in ("--maneuver", each))


# --- campaign files -------------------------------------------------------------------------------


@pytest.fixture
def logs(tmp_path: Path) -> list[str]:
    names = ["lift.csv", "lower.csv"]
    for name in names:
        text = "\n".join(["time [s],voltage [V],current [A],counts", *ROWS]) + "\n"
        (tmp_path / name).write_text(text, "utf-8")
    return names


def test_from_logs_to_a_check(run: Callable[..., Result], done: Words, logs: list[str]) -> None:
    said = done("campaign", "init", *logs, *COUNTS, "--drive", "hoist")
    assert "Draft: campaign.toml" in said
    said = done("campaign", "check")
    assert "2 experiments (2 to fit)" in said
    assert "step +4 V" in said
    # the logs are made up: a hoist turns at 98 deg/s, these counts at 252
    assert "'encoder_counts' moves" in " ".join(said.split())
    assert "1 finding, marked" in said
    assert run("campaign", "check", "--strict").exit_code == 1


@pytest.mark.slow
def test_check_plot_and_report_show_the_whole_of_a_long_log(
    run: Callable[..., Result], done: Words, tmp_path: Path
) -> None:
    """300,000 rows at 100 Hz, in which the winch moves for 20 s after 700 s."""
    rows = range(300_000)
    moves = [70_000 <= row < 72_000 for row in rows]
    pl.DataFrame(
        {
            "time": [row / 100.0 for row in rows],
            "u": [5.0 * each for each in moves],
            "n": [3.0 * each for each in moves],
        }
    ).write_csv(tmp_path / "log.csv")
    (tmp_path / "campaign.toml").write_text(TACHO, "utf-8")
    said = " ".join(done("campaign", "check").split())
    assert "log, the whole log: 3000 s, 300,000 rows" in said
    assert said.count("300,000 rows") == 2
    assert "one window with motion, which is used" in said
    lasts = float(re.search(r"to fit, ([\d.]+) s", said)[1])
    assert 27.0 <= lasts <= 27.0 + 2 * 2.56  # rest before and after, in blocks of 256 rows
    said = done("campaign", "plot", "--out", "overview.png")
    assert [each.stem for each in sorted(tmp_path.glob("overview*.png"))] == [
        "overview-1",
        "overview-2",
    ]
    run("validate", "hoist", "campaign.toml", "--role", "all", "--out", "judged")
    page = (tmp_path / "judged" / "report.html").read_text("utf-8")
    assert "one window with motion, which is used" in page


TACHO = """
[axes.hoist]
drive = "hoist"
time = { column = "time" }
input = { column = "u", unit = "V" }
channels.tacho = { column = "n", kind = "shaft_speed", unit = "deg/s" }
[[runs]]
file = "log.csv"
"""


@pytest.mark.slow
def test_a_tacho_beside_the_drive_before_any_fit(done, refused, tmp_path) -> None:
    rows = [f"{k / 100},{4 if k > 20 else 0},{98 if k > 40 else 0}" for k in range(300)]
    (tmp_path / "log.csv").write_text("\n".join(["time,u,n", *rows]) + "\n", "utf-8")
    look = ("campaign", "plot", "--run", "log", "--channel", "tacho", "--to", "2", "--force")
    for drive in ('drive = "hoist"', ""):
        text = TACHO.replace('drive = "hoist"', drive)
        (tmp_path / "campaign.toml").write_text(text, "utf-8")
        done(*look, "--out", "look.svg")
        drawn = (tmp_path / "look.svg").read_text("utf-8")
        assert ("measured less simulated" in drawn) == bool(drive)
    assert "--channel" in refused("campaign", "plot", "--run", "log")
    assert "channel 'speed'" in refused(*look[:5], "speed")
    (tmp_path / "campaign.toml").write_text(TACHO.replace('"V"', '"mV"'), "utf-8")
    said = refused("fit", "campaign.toml", "--out", "fit", code=1)
    assert 'unit = "V"' in said


def test_what_a_draft_leaves_out_stands_before_the_command_to_run(done, tmp_path) -> None:
    rows = [f"{k},{row}" for k, row in enumerate(ROWS)]
    text = "\n".join(["Nr,time [s],voltage [V],current [A],Geber", *rows]) + "\n"
    (tmp_path / "log.csv").write_text(text, "utf-8")
    (tmp_path / "fitted").mkdir()
    done("whatif", "hoist", "--scale", "pump=1.1", "--out", "fitted/drive.toml")
    said = done("campaign", "init", "log.csv", *COUNTS, "--drive", "fitted").splitlines()
    assert said[2:] == [
        "  Columns that are not used: Nr, Geber",
        "  No column looks like an encoder's counts among Nr, Geber; counts_per_turn = 1000 is "
        "left out",
        "Then run",
        "  swashplate campaign check campaign.toml",
    ]
    assert 'drive = "fitted/drive.toml"' in (tmp_path / "campaign.toml").read_text("utf-8")
    said = " ".join(done("campaign", "check").split())
    assert "no channel measures its motion" in said


def test_what_a_draft_leaves_open_is_printed_with_its_table(done, tmp_path) -> None:
    rows = [f"{k},{1000 * k % 9000},{row}" for k, row in enumerate(ROWS)]
    (tmp_path / "log.csv").write_text("\n".join(["Nr,PIW_DRUCK,time [s],u [V],i [A],n", *rows]))
    pressure = ("--column", "stroker_pressure=PIW_DRUCK", "--title", "Winch 3")
    said = done("campaign", "init", "log.csv", *pressure)
    table = "  [axes.drive.channels.stroker_pressure]"
    assert f'{table} unit = "Pa"    # FIXME' in said
    assert f"{table} scale = 1.0    # FIXME" in said
    assert 'title = "Winch 3"' in (tmp_path / "campaign.toml").read_text("utf-8")


def test_what_is_left_out_is_printed_and_an_empty_campaign_is_a_finding(
    run: Callable[..., Result], done: Words, tmp_path: Path
) -> None:
    rows = "\n".join(f"{k / 100},{k},{k}" for k in range(100))
    (tmp_path / "good.csv").write_text(f"time [s],voltage [V],speed [rpm]\n{rows}\n")
    (tmp_path / "dates.csv").write_text(
        "time [s],voltage [V],speed [rpm]\n11-Xyz,1,2\n12-Xyz,2,3\n"
    )
    (tmp_path / "other.csv").write_text(f"time [s],pegel [V/m],speed [rpm]\n{rows}\n")
    said = " ".join(done("campaign", "init", "good.csv", "other.csv", "dates.csv").split())
    assert "pegel [V/m] (only in other.csv)" in said
    assert "'voltage [V]' among 'time [s]', 'pegel [V/m]'" in said
    assert "'11-Xyz', which is not a number" in said
    done("campaign", "init", "dates.csv", "--force")
    assert "no log is read" in done("campaign", "check")
    assert run("campaign", "check", "--strict").exit_code == 1
    for command in (("guess",), ("fit",), ("advise",), ("campaign", "plot")):
        refused = run(*command, "campaign.toml")
        assert refused.exit_code == 2
        assert "no log is read" in " ".join(refused.output.split())


def test_no_command_reads_a_file_with_an_open_entry(
    run: Callable[..., Result], done: Words, logs: list[str]
) -> None:
    done("campaign", "init", *logs, "--drive", "hoist")
    for command in (
        *(("campaign", "check"), ("campaign", "plot"), ("guess",), ("fit",), ("advise",)),
        ("validate", "hoist"),
    ):
        refused = run(*command, "campaign.toml")
        assert refused.exit_code == 2
        assert "counts_per_turn = 1000 is marked FIXME" in " ".join(refused.output.split())


# --- virtual tests --------------------------------------------------------------------------------


def test_refinements_and_backlash_change_the_logs(done: Words, tmp_path: Path) -> None:
    short = ("--severity", "clean", "--maneuver", "step:4,start=0.5,stop=1,length=2")
    done("rig", "slew", "--out", "a", *short)
    done("rig", "slew", "--out", "b", "--backlash-deg", "0.1", *short)
    done("rig", "slew", "--out", "c", "--set", "cam_ripple=0.02", *short)
    first, *others = (
        next(iter(Campaign.from_toml(tmp_path / name / "campaign.toml"))) for name in "abc"
    )
    for each in others:
        assert (first["counts"].values != each["counts"].values).any()
        assert (first["current"].values == each["current"].values).all()
    # a fit starts from the drive that was named, and only the truth has what was set
    nominal = Campaign.from_toml(tmp_path / "c" / "campaign.toml").drive("slew")
    assert nominal == Drive.preset("slew")
    truth = Drive.from_toml(tmp_path / "c" / "truth" / "drive.toml")
    assert truth.parameters.refinements == ("cam_ripple",)


# --- what tests are worth -------------------------------------------------------------------------


def section(said: str, title: str) -> dict[str, str]:
    """Rows of a table by their first cell."""
    rows = said.split(title, 1)[1].split("─\n", 1)[1].split("\n\n", 1)[0]
    cells = [[*re.split(r"  +", line.strip(), maxsplit=1), ""] for line in rows.splitlines()]
    return {row[0]: row[1] for row in cells}


def test_small_positive_steps_want_large_and_negative_ones(done: Words, tmp_path: Path) -> None:
    done("rig", "hoist", "--out", "virtual", *steps(1, 2))
    (tmp_path / "setup.toml").write_text(freeing("Z13 Z19", "pump"), "utf-8")
    words = ("virtual/campaign.toml", "--setup", "setup.toml", *steps(2, -2, 9, -9))
    said = done("advise", *words, "--tests", "2", "--out", "advice.csv")
    best = section(said, "For each parameter")
    assert best["Z13_plus"].endswith("step 9 V")
    assert best["Z13_minus"].endswith("step -9 V")
    assert "step -" in best["Z19_minus"]
    tests = section(said, "Tests")
    # the large negative one tells of the negative force and the negative stop at once
    assert [*tests][:: len(tests) - 1] == ["step -9 V", "step 2 V"]
    assert "Z13_minus, Z19_minus" in tests["step -9 V"]
    assert [*section(said, "Plan")] == ["step -9 V", "step 9 V"]
    table = pl.read_csv(tmp_path / "advice.csv")
    # no other test determines it
    known = table.filter(pl.col("error of Z13_minus").is_not_null())
    assert known["test"].to_list() == ["step -9 V"]
    # a fitted drive brings its noise
    Drive.preset("hoist").to_toml(tmp_path / "fitted.toml")
    assert "(residuals of the drive)" in done("advise", *words[:5], "--drive", "fitted.toml")


def test_a_fresh_plan_needs_a_drive_alone(done: Words, refused: Words) -> None:
    said = done("advise", "hoist", *steps(2, -2), "--top", "2")
    assert {"step 2 V", "step -2 V"} <= set(section(said, "Tests"))
    assert "encoder_counts: noise 0.000718 rad (rounding of Kruse's encoder)" in said
    assert "--axis " in refused("advise", "hoist", "--axis", "hoist")


def test_what_positive_steps_determine(done: Words, tmp_path: Path) -> None:
    done("rig", "hoist", "--out", "virtual", "--severity", "clean", *steps(2, 9, 0.1))
    (tmp_path / "setup.toml").write_text(freeing("J lim1_plus Z8 Z13"), "utf-8")
    words = ("virtual/campaign.toml", "--setup")
    said = done("advise", *words, "setup.toml", "--runs", "runs.csv")
    assert said.startswith("! hoist_step_0.1_V: its command stays between 0 and 0.1 V")
    determined = said.partition("\nTests ")[0].splitlines()
    rows = {line.split("  ")[0]: re.split("  +", line.strip()) for line in determined}
    assert rows["J_plus"][-1] == "#+."  # at the stop, the counts do not tell of it
    assert rows["J_minus"][1:] == ["a command beyond the dead zone", "0", "..."]
    assert rows["Z13_plus"][-1] == ".#."  # only the step of 9 V reaches the stop
    said = " ".join(said.split())
    assert (
        "J_minus needs a command beyond the dead zone (minus), which no sample shows: fix" in said
    )
    assert "run 2: hoist_step_9_V" in said
    table = pl.read_csv(tmp_path / "runs.csv")
    shares = table.select(pl.sum_horizontal(pl.col("^hoist_.*$"))).to_series()
    assert set(shares.round(9)) == {0.0, 1.0}
    (tmp_path / "mine.toml").write_text(freeing("Z8 Z13_plus", "pump"), "utf-8")
    assert "The fit setup needs no change." in done("advise", *words, "mine.toml")


def test_a_guess_looks_for_its_folder_first(refused, virtual, tmp_path, monkeypatch) -> None:
    """Not after the search, which takes many times as long."""
    from swashplate import drafting

    monkeypatch.setattr(drafting, "guess_drive", lambda runs: pytest.fail("it searched"))
    (tmp_path / "file").write_text("")
    sentence = refused("guess", "virtual/campaign.toml", "--out", "file/guessed")
    assert "file/guessed cannot be created" in sentence


@pytest.mark.parametrize("subject", ["fitted", "fitted/drive.toml"])
def test_advice_on_a_fit_knows_the_largest_commands(
    done: Words, tmp_path: Path, subject: str
) -> None:
    """Without its campaign, too: a stick that ends at 4 and -5 V gives no more."""
    kept = Path(__file__).parents[1] / "fixtures" / "f206f7e8" / "fitted"
    shutil.copytree(kept, tmp_path / "fitted")
    file = tmp_path / "fitted" / "fit.json"
    content = json.loads(file.read_text("utf-8"))
    content["verdict"]["verdict"]["commands"] = ["voltage", -5.0, 4.0]
    file.write_text(json.dumps(content), "utf-8")
    # a setup in stages, as that version wrote it, is refused
    (tmp_path / "fitted" / "setup.toml").write_text(freeing("Z8 Z16", "pump"), "utf-8")

    done("advise", subject, "--tests", "0", "--out", "tests.csv")
    names = pl.read_csv(tmp_path / "tests.csv")["test"].to_list()
    volts = [float(word) for name in names for word in re.findall(r"-?[\d.]+(?=[/ ].*V)", name)]
    steps = [float(name.split()[1]) for name in names if name.startswith("step")]
    assert (min(steps), max(steps)) == (-5.0, 4.0)
    assert min(volts) >= -5.0
    assert max(volts) <= 4.0


def test_a_draft_of_logs_with_thousands(done, refused, tmp_path: Path) -> None:
    """The way out that the refusal names is an option of init, and stands in the draft."""
    rows = [f'{10 * k},{3 * (k > 50)},"{999 + k:,}"' for k in range(200)]
    text = "\n".join(["time_ms,voltage_V,speed_rpm", *rows])
    (tmp_path / "log.csv").write_text(text, "utf-8")
    assert "thousands" in refused("campaign", "init", "log.csv")
    assert "it is delimiter, decimal" in refused("campaign", "init", "log.csv", "--format", "a=b")
    assert "number of a line" in refused(
        "campaign", "init", "log.csv", "--format", "header_row=first"
    )
    done("campaign", "init", "log.csv", "--format", "thousands=,")
    (run,) = Campaign.from_toml(tmp_path / "campaign.toml")
    rpm = run["shaft_speed"].values * 30.0 / pi
    assert rpm[[0, 199]] == pytest.approx([999.0, 1198.0])
