import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.cli.conftest import STEPS
from typer.testing import Result

from swashplate import Drive

Words = Callable[..., str]
SETUP = """
[[stages]]
name = "card"
part = "card"
free.J = { relative = [0.5, 2.0] }
free.omega_plus = { relative = [0.5, 2.0] }

[[stages]]
name = "pump"
part = "pump"
free.Z8 = { relative = [0.5, 2.0], log = true }
free.Z16 = { relative = [0.5, 2.0], log = true }
"""


@pytest.fixture
def campaign(done: Words, tmp_path: Path) -> Path:
    """Virtual tests of a hoist with other orifices and another jump."""
    truth = Drive.preset("hoist").replace(Z16=(1.3e-4, 1.3e-4), J=(0.26, 0.31))
    truth.to_toml(tmp_path / "truth.toml")
    done("rig", "truth.toml", "--out", "virtual", *STEPS)
    path = tmp_path / "virtual" / "campaign.toml"
    path.write_text(path.read_text("utf-8").replace('drive = "drive.toml"', 'drive = "hoist"'))
    (tmp_path / "setup.toml").write_text(SETUP, "utf-8")
    return path


def test_a_campaign_becomes_a_drive(
    done: Words, refused: Words, campaign: Path, tmp_path: Path
) -> None:
    words = ("--setup", "setup.toml", "--out", "fitted", "--timing")
    said = done("fit", "virtual/campaign.toml", *words)
    (times,) = re.findall(r"^Time: +(.*)$", said, re.MULTILINE)
    parts = dict(each.removesuffix(" s").rsplit(" ", 1) for each in times.split(", "))
    assert [*parts] == ["start and kernels", "reading", "search", "judging", "report"]
    assert all(float(each) >= 0.0 for each in parts.values())
    assert "Stage card" in said
    assert "Stage pump" in said
    fitted = Drive.from_toml(tmp_path / "fitted" / "drive.toml")
    assert fitted["Z16"].value == pytest.approx((1.3e-4, 1.3e-4), rel=2e-3)
    assert fitted["J"].value == pytest.approx((0.26, 0.31), rel=2e-3)
    # what is fitted says so, with campaign, date and interval; what is fixed, where it is from
    parameters = fitted.parameters
    assert (parameters["Z16"].status, parameters["Z9"].status) == ("fitted", "fixed")
    assert re.fullmatch(
        r"campaign\.toml, \d\d \w+ \d{4}; 95 %: plus \S+ to \S+; minus \S+ to \S+",
        parameters["Z16"].source,
    )
    assert parameters["Z9"].source.startswith("hoist: ")
    assert parameters.title.startswith("Virtual tests")
    assert "speed at the end" in done("simulate", "fitted/drive.toml", "step:4")
    header, *rows = (tmp_path / "fitted" / "estimates.csv").read_text("utf-8").splitlines()
    assert header.startswith("stage,parameter,unit,nominal,estimate")
    assert len([row for row in rows if "offset" not in row]) == 6
    # the folder knows what was free: no packaged configuration bears the drive's name
    Drive(parameters).renamed("winch").to_toml(tmp_path / "fitted" / "drive.toml")
    advice = done("advise", "fitted", "--maneuver", "step:4", "--tests", "1")
    assert "Z16_plus" in advice
    assert "Z13" not in advice
    again = ("fit", "virtual/campaign.toml", "--setup", "setup.toml", "--out", "fitted")
    assert "fitted/drive.toml exists already" in refused(*again)


@pytest.mark.slow
def test_starts_are_resumed_after_a_kill(campaign: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "swashplate", "fit", "virtual/campaign.toml"]
    command += ["--setup", "setup.toml", "--out", "fitted", "--starts", "12", "--jobs", "1"]
    store = tmp_path / "fitted" / "starts" / "card"
    running = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    deadline = time.monotonic() + 120.0
    while not (store.exists() and len(list(store.glob("start-*.json"))) >= 2):
        assert running.poll() is None, "it ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.005)
    os.kill(running.pid, signal.SIGKILL)
    running.wait()
    kept = {path: path.stat().st_mtime_ns for path in store.glob("start-*.json")}
    again = subprocess.run(
        [*command, "--resume"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert "Stage pump" in again.stdout
    assert len(list(store.glob("start-*.json"))) == 13
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    whole = [word if word != "fitted" else "whole" for word in command]
    subprocess.run(whole, cwd=tmp_path, capture_output=True, check=True)
    assert (tmp_path / "fitted" / "drive.toml").read_text("utf-8") == (
        tmp_path / "whole" / "drive.toml"
    ).read_text("utf-8")


@pytest.mark.slow
def test_ctrl_c_stops_the_whole_search_and_resume_goes_on(campaign: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "swashplate", "fit", "virtual/campaign.toml", "--no-report"]
    command += ["--setup", "setup.toml", "--starts", "12", "--jobs", "2", "--out"]
    store = tmp_path / "fitted" / "starts"
    running = subprocess.Popen(
        [*command, "fitted"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 120.0
    while not list(store.glob("card/start-*.json")):
        assert running.poll() is None, "it ended before it could be interrupted"
        assert time.monotonic() < deadline
        time.sleep(0.005)
    os.killpg(running.pid, signal.SIGINT)  # as a terminal does
    said, _ = running.communicate(timeout=60.0)
    assert running.returncode == 130
    assert "Interrupted in the stage 'card': interrupted after " in said
    assert "--resume goes on" in said
    assert "Usable" not in said
    assert not (store / "pump").exists()
    assert not (tmp_path / "fitted" / "drive.toml").exists()
    for words in ([*command, "fitted", "--resume"], [*command, "whole"]):
        subprocess.run(words, cwd=tmp_path, capture_output=True, check=True)
    resumed, whole = ((tmp_path / name / "drive.toml").read_text() for name in ("fitted", "whole"))
    assert resumed == whole


@pytest.mark.slow
def test_all_that_can_be_asked_for_besides(done: Words, campaign: Path, tmp_path: Path) -> None:
    asked = ("--folds", "2", "--bootstrap", "40", "--profile", "Z8", "--profile", "J_plus")
    setup = ("--setup", "setup.toml", "--jobs", "1")
    said = done("fit", "virtual/campaign.toml", *setup, *asked)
    assert "bootstrap" in said
    assert "40 draws of noise" in said
    assert "Cross-validation" in said
    assert "Fixed at their nominal values: V_dz, G1" in said
    header, *rows = (tmp_path / "fitted" / "estimates.csv").read_text("utf-8").splitlines()
    assert "bootstrap lower 95 %,bootstrap upper 95 %" in header
    # by other noise of the same kind the estimates move about as far as the errors say
    columns = header.split(",")
    for row in rows:
        entry = dict(zip(columns, row.split(","), strict=True))
        if "offset" in entry["parameter"]:
            continue
        wide = [float(entry[f"{name} 95 %"]) for name in ("lower", "upper")]
        drawn = [float(entry[f"bootstrap {name} 95 %"]) for name in ("lower", "upper")]
        assert 0.3 < (drawn[1] - drawn[0]) / (wide[1] - wide[0]) < 2.0, entry["parameter"]
    page = (tmp_path / "fitted" / "report.html").read_text("utf-8")
    assert "profile" in page.lower()


def test_a_result_that_is_of_no_use_ends_with_1(
    run: Callable[..., Result], campaign: Path, tmp_path: Path
) -> None:
    narrow = SETUP.replace("relative = [0.5, 2.0]", "relative = [0.99, 1.01]")
    (tmp_path / "narrow.toml").write_text(narrow, "utf-8")
    words = ("--setup", "narrow.toml", "--no-report", "--evaluations", "900")
    result = run("fit", "virtual/campaign.toml", *words)
    assert result.exit_code == 1
    assert result.stderr.startswith("Not usable: ")
    assert "bound" in result.stderr
    said = " ".join(result.stdout.split())
    assert "widen J under [stages.free] of the stage 'card' and fit again." in said
    # whoever takes the drive along hears of it, and so do those who get the files
    said = run("export", "fitted", "--c", "folder").stdout
    assert "! The fit of this drive says: Not usable: " in said
    (values,) = (tmp_path / "folder").glob("*_values.h")
    assert "Not usable: " in values.read_text("utf-8")


def test_refusals(refused: Words, campaign: Path, tmp_path: Path) -> None:
    fit = ("fit", "virtual/campaign.toml")
    assert "no packaged fit configuration 'boom'" in refused(*fit, "--setup", "boom")
    assert "no axis 'boom'; it has hoist" in refused(*fit, "--axis", "boom")
    assert "20 draws do not reach the ends" in refused(*fit, "--bootstrap", "20")
    assert "no parameter 'Z99'" in refused(*fit, "--setup", "setup.toml", "--profile", "Z99")
    (tmp_path / "bad.toml").write_text(SETUP.replace("Z16", "Z61"), "utf-8")
    assert "no parameter 'Z61'" in refused(*fit, "--setup", "bad.toml")
    (tmp_path / "bad.toml").write_text(SETUP.replace("[0.5, 2.0]", "[2.0, 0.5]", 1), "utf-8")
    said = refused(*fit, "--setup", "bad.toml")
    assert "bad.toml: stages 1.free.J.relative: [2, 0.5] must rise: write [0.5, 2]" in said
    (tmp_path / "bad.toml").write_text(SETUP.replace("relative", "relativ", 1), "utf-8")
    assert "perhaps 'relative' is meant" in refused(*fit, "--setup", "bad.toml")
    text = campaign.read_text("utf-8").replace('role = "fit"', 'role = "ignore"')
    campaign.write_text(text, "utf-8")
    assert "no run of the axis 'hoist' has the role 'fit'" in refused(*fit)
