"""``fit``, ``validate``, ``report`` and ``demo``: from tests to a drive, its verdict, its page."""

import csv
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from html import unescape
from math import exp
from pathlib import Path

import pytest
from tests.cli.conftest import STEPS, freeing, without_resource_warnings
from tests.shown import check_shown

import swashplate
from swashplate import Campaign, Drive
from swashplate.identification import Fit, FitSetup, Identification, fit, uncertainty_of
from swashplate.locks import locked

Words = Callable[..., str]
CAMPAIGN = "virtual/campaign.toml"
SETUP = freeing("J omega_plus Z8 Z16")


@pytest.fixture
def campaign(done: Words, tmp_path: Path) -> Path:
    """Virtual tests of a hoist with other orifices and another jump."""
    truth = Drive.preset("hoist").replace(Z16=(1.3e-4, 1.3e-4), J=(0.26, 0.31))
    truth.to_toml(tmp_path / "truth.toml")
    done("rig", "truth.toml", "--out", "virtual", *STEPS)
    path = tmp_path / CAMPAIGN
    path.write_text(path.read_text("utf-8").replace('drive = "drive.toml"', 'drive = "hoist"'))
    (tmp_path / "setup.toml").write_text(SETUP, "utf-8")
    return path


# --- fit ------------------------------------------------------------------------------------------


def test_a_campaign_becomes_a_drive(done, refused, campaign, tmp_path, monkeypatch) -> None:
    words = ("fit", CAMPAIGN, "--setup", "setup.toml", "--out", "fitted")
    said = done(*words, "--timing")
    (times,) = re.findall(r"^Time: +(.*)$", said, re.MULTILINE)
    parts = dict(each.removesuffix(" s").rsplit(" ", 1) for each in times.split(", "))
    assert [*parts] == ["start and kernels", "reading", "search", "assessment", "report"]
    assert all(float(each) >= 0.0 for each in parts.values())
    assert said.index("Estimates") < said.index("Search: ")
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
    assert header.startswith("parameter,unit,nominal,value,lower,upper,standard_error")
    assert len([row for row in rows if "offset" not in row]) == 6
    # the folder knows what was free
    Drive(parameters).renamed("winch").to_toml(tmp_path / "fitted" / "drive.toml")
    for named in (("fitted",), (CAMPAIGN, "--drive", "fitted/drive.toml")):
        advice = done("advise", *named, "--maneuver", "step:4", "--tests", "1")
        assert "Z16_plus" in advice
        assert "Z13" not in advice
    assert "fitted/drive.toml " in refused(*words)
    # what the report prints runs as printed, in the folder of the report
    page = unescape((tmp_path / "fitted" / "report.html").read_text("utf-8"))
    printed = re.findall(r"<code>(swashplate [^<]+)</code>", page)
    assert printed
    monkeypatch.chdir(tmp_path / "fitted")
    for command in printed:
        done(*shlex.split(command)[1:])
    assert "swashplate simulate drive.toml step:4" in printed
    # the stick was moved to 4 and -5 V
    ranked = done("advise", "../virtual/campaign.toml", "--drive", "drive.toml", "--top", "30")
    assert "step 4 V" in ranked
    assert "step 9 V" not in ranked
    # whoever designs a controller by it hears what its verdict has found
    monkeypatch.chdir(tmp_path)
    words = ("linearize", "fitted", "--at", "4")
    assert "The fit of this drive says" not in done(*words)
    stored = tmp_path / "fitted" / "fit.json"
    content = json.loads(stored.read_text("utf-8"))
    late = ["late", 0.0976, 0.9, "encoder_counts is 97.6 ms late", "compare its clock"]
    content["verdict"]["verdict"]["causes"] = [late]
    stored.write_text(json.dumps(content), "utf-8")
    sweep = ("bode", "fitted", "--amplitude", "4", "--bias", "4", "--from", "0.3")
    for each in (words, (*sweep, "--to", "1", "--points", "2"), ("export", "fitted", "--c", "c")):
        said = done(*each)
        assert "! The fit of this drive says: Not all of its error is noise. " in said
        assert "encoder_counts is 97.6 ms late" in said
    # a file apart from its fit has no verdict
    (tmp_path / "fitted" / "drive.toml").rename(tmp_path / "alone.toml")
    assert "says" not in done("linearize", "alone.toml", "--at", "4")


@pytest.mark.slow
def test_from_logs_with_a_current_to_a_drive_named_by_its_axis(
    run, done, virtual, tmp_path
) -> None:
    """From neutral: the amplifier is fitted to the current, and nothing is called neutral."""
    logs = [str(each) for each in sorted(virtual.parent.glob("*.csv"))]
    counts = ("--counts-per-turn", "2526.315789473684")
    done("campaign", "init", *logs, "--drive", "neutral", *counts, "--out", "campaign.toml")
    path = tmp_path / "campaign.toml"
    path.write_text(path.read_text("utf-8").replace("[axes.drive", "[axes.winch"), "utf-8")
    said = done("guess", "campaign.toml")
    (share,) = re.findall(r"fit ([\d.]+) % of the currents", " ".join(said.split()))
    assert float(share) > 95.0
    result = run("fit", "campaign.toml", "--from", "start.toml")
    assert result.exit_code in (0, 1)
    assert "the fit setup leaves it out" not in result.output
    fitted = Drive.from_toml(tmp_path / "fitted" / "drive.toml")
    assert fitted.name == "winch"
    # of steps of one size each way the current is known there alone
    currents = [Drive.preset("hoist").steady_current(volts) for volts in (-5.0, 4.0)]
    assert [fitted.steady_current(volts) for volts in (-5.0, 4.0)] == pytest.approx(
        currents, rel=0.02
    )
    plain = run("fit", "campaign.toml", "--out", "plain", "--no-report")
    said = " ".join(plain.output.split())
    assert "'rectified_current' is measured, but the fit setup leaves it out" in said
    assert Drive.from_toml(tmp_path / "plain" / "drive.toml").name == "winch"


@pytest.mark.slow
@pytest.mark.parametrize(
    "how", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM], ids=["kill", "Ctrl-C", "terminate"]
)
def test_an_interrupted_search_goes_on(campaign: Path, tmp_path: Path, how: signal.Signals) -> None:
    command = [sys.executable, "-m", "swashplate", "fit", CAMPAIGN, "--no-report", "--starts", "6"]
    command += ["--setup", "setup.toml", "--out"]
    store = tmp_path / "fitted" / "starts"
    running = subprocess.Popen(
        [*command, "fitted", "--jobs", "1" if how == signal.SIGKILL else "2"],
        cwd=tmp_path,
        env=without_resource_warnings(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 120.0
    while not list(store.glob("start-*.json")):
        assert running.poll() is None, "it ended before it could be interrupted"
        assert time.monotonic() < deadline
        time.sleep(0.005)
    os.killpg(running.pid, how)  # as a terminal does
    said, warnings = running.communicate(timeout=60.0)
    if how != signal.SIGKILL:
        assert running.returncode == 128 + how
        assert re.search(r"Interrupted: \d finished starts? (is|are) kept in fitted/starts;", said)
        assert "--resume continues" in said
        assert warnings == ""
        assert "Usable" not in said
    assert not (tmp_path / "fitted" / "drive.toml").exists()
    kept = {path: path.stat().st_mtime_ns for path in store.glob("start-*.json")}
    for words in ([*command, "fitted", "--resume"], [*command, "whole"]):
        subprocess.run([*words, "--jobs", "1"], cwd=tmp_path, capture_output=True, check=True)
    assert len(list(store.glob("start-*.json"))) == 7
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    resumed, whole = ((tmp_path / name / "drive.toml").read_text() for name in ("fitted", "whole"))
    assert resumed == whole


@pytest.mark.slow
def test_all_that_can_be_asked_for_besides(done: Words, campaign: Path, tmp_path: Path) -> None:
    asked = ("--profile", "Z8", "--profile", "J_plus")
    said = done("fit", CAMPAIGN, "--setup", "setup.toml", "--jobs", "1", *asked)
    assert "Fixed at their nominal values: V_dz, G1" in said
    (ends,) = re.findall(r"^ *Z8 +(.*)$", said.partition("Profile likelihoods")[2], re.M)
    found = [float(each) for each in re.findall(r"\d\S*", ends)][-3:]
    assert "profile" in (tmp_path / "fitted" / "report.html").read_text("utf-8").lower()
    # in Python the same is there
    profiles = ["Z8", "J_plus"]
    result = swashplate.identify(campaign, None, tmp_path / "setup.toml", profiles=profiles)
    # nearly quadratic: the profile ends where the linear interval of the noise does
    z8 = result["Z8"]
    noise = uncertainty_of(result.fit).own
    half = 1.96 * noise.standard_errors[noise.variables.names.index("Z8")]
    assert found == pytest.approx([z8.value, z8.value * exp(-half), z8.value * exp(half)], rel=0.01)
    summary, printed = result.summary().partition("Estimates")[2], " ".join(said.split())
    printed = printed.partition("Estimates")[2].partition("Stated error in a new maneuver")[0]
    sentences = [line for line in summary.splitlines() if re.match(r"(- |\w+: |Fixed at)", line)]
    assert len(sentences) >= 8
    assert [line for line in sentences if " ".join(line.split()) not in printed] == []
    assert printed.count(" - ") == sum(line.startswith("- ") for line in sentences)
    titles = ("Profile likelihoods", "Runs that were fitted")
    assert all(title in text for title in titles for text in (summary, printed))


@pytest.mark.slow
def test_a_result_that_is_of_no_use_ends_with_1(run, campaign, tmp_path) -> None:
    narrow = SETUP.replace("relative = [0.5, 2.0]", "relative = [0.99, 1.01]")
    (tmp_path / "narrow.toml").write_text(narrow, "utf-8")
    words = ("--setup", "narrow.toml", "--no-report", "--evaluations", "900", "--require", "3")
    result = run("fit", CAMPAIGN, *words)
    assert result.exit_code == 1
    assert result.stderr.startswith("Not usable: predicts speed from counts within ")
    assert "3 % is required" in " ".join(result.stderr.split())
    said = " ".join(result.stdout.split())
    # every value but one stands at an end of its bounds, and that one is not determined
    assert "Values: 0 of 6 may be quoted" in said
    assert "widen J under [free] of the fit setup and fit again." in said
    # whoever takes the drive along hears of it, and so do those who get the files
    said = run("export", "fitted", "--c", "folder").stdout
    assert "! The fit of this drive says: Not usable: " in said
    for words in ("linearize fitted --at 4", "bode fitted --amplitude 4 --points 2 --bias 4"):
        said = run(*words.split())
        assert said.stdout.startswith("! The fit of this drive says: Not usable: ")
        assert said.exit_code == 0
    headline = Drive.from_toml(tmp_path / "fitted" / "drive.toml").linearize(4.0).headline
    assert headline.startswith("The fit of this drive says: Not usable: ")
    (values,) = (tmp_path / "folder").glob("*_values.h")
    assert "Not usable: " in values.read_text("utf-8")


@pytest.mark.slow
def test_fits_that_are_refused(refused: Words, virtual: Path, tmp_path: Path) -> None:
    (tmp_path / "setup.toml").write_text(SETUP, "utf-8")
    for words, said in (
        ("--setup boom", "'boom' is no fit setup"),
        ("--axis boom", "no axis 'boom'; it has hoist"),
        ("--setup setup.toml --profile Z99", "no parameter 'Z99'"),
    ):
        assert said in refused("fit", CAMPAIGN, *words.split())
    for old, new, said in (
        ("Z16", "Z61", "'Z61'"),
        ("[0.5, 2.0]", "[2.0, 0.5]", "free.J.relative"),
        ("relative", "relativ", "'relative'"),
    ):
        (tmp_path / "bad.toml").write_text(SETUP.replace(old, new, 1), "utf-8")
        assert said in refused("fit", CAMPAIGN, "--setup", "bad.toml")
    virtual.write_text(virtual.read_text("utf-8").replace('role = "fit"', 'role = "ignore"'))
    assert "each run has the role 'ignore'" in refused("fit", CAMPAIGN)


def test_one_fit_at_a_time_into_a_folder(refused: Words, virtual: Path, tmp_path: Path) -> None:
    words = ("fit", CAMPAIGN, "--axis", "boom", "--out", "results/fitted")
    lock = locked(tmp_path / "results" / "fitted")
    with ThreadPoolExecutor(1) as another:
        another.submit(lock.__enter__).result()
        sentence = refused(*words)
        another.submit(lock.__exit__, None, None, None).result()
    assert "results/fitted " in sentence
    assert f"process {os.getpid()} on" in sentence
    assert "--out" in sentence
    assert "axis 'boom'" in refused(*words)  # and leaves no folder behind


def test_a_model_that_is_executed_says_so(run, virtual: Path, tmp_path: Path) -> None:
    page = re.sub(r"[\s│]+", " ", run("fit", "--help").stdout)
    assert "The file is executed: use only one that you trust" in page
    (tmp_path / "ending.py").write_text("import sys\nsys.exit(7)\n")
    done = run("fit", CAMPAIGN, "--model", "ending.py")
    assert done.exit_code == 2
    sentence = done.stderr
    assert "ending.py" in sentence
    assert "sys.exit(7)" in sentence
    assert "__main__" in sentence


# --- validate -------------------------------------------------------------------------------------


def test_a_drive_beside_the_runs_that_were_held_out(done, held_out, tmp_path) -> None:
    said = done("validate", "hoist", CAMPAIGN, "--out", "found")
    assert "hoist_step_-5_V" in said
    assert "hoist_step_4_V" not in said
    assert re.search(r"\ncurrent +\n.* mA ", said, re.DOTALL)
    assert re.search(r"\nspeed from counts +\n.* deg/s ", said, re.DOTALL)
    assert "'of range' below: over" in " ".join(said.split())
    assert "Usable: predicts speed from counts within 0." in said
    assert "Data: Not assessed: a drive that was not fitted to these runs" in said
    assert "Values: " not in said
    with (tmp_path / "found" / "measures.csv").open(encoding="utf-8") as file:
        rows = {row["channel"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"current", "counts", "speed from counts"}
    # the published drive itself: what is left is the instruments' error
    assert float(rows["speed from counts"]["fit_percent"]) > 97.0
    assert rows["counts"]["unit"] == "rad"
    assert rows["current"]["initial_state"] == "rest"
    assert abs(float(rows["current"]["correlation_with_input"])) < 0.5
    assert rows["speed from counts"]["correlation_with_input"] == ""
    page = (tmp_path / "found" / "report.html").read_text("utf-8")
    assert "residuals of current follow the input" not in page
    assert "<svg" in page


def test_a_drive_that_is_not_usable_ends_with_1(run, held_out, tmp_path) -> None:
    """A drive of too low a gain misses the more the larger the command."""
    Drive.preset("hoist").scale(Z10=0.4, J=0.4).to_toml(tmp_path / "wrong.toml")
    result = run("validate", "wrong.toml", CAMPAIGN, "--out", "found")
    assert result.exit_code == 1
    assert result.stderr.startswith("Not usable: ")
    assert "10 % is required" in " ".join(result.stderr.split())
    assert "NOT MET" in result.stdout
    page = (tmp_path / "found" / "report.html").read_text("utf-8")
    assert "residuals of current follow the input" in page


def test_validations_that_are_refused(refused: Words, held_out: Path) -> None:
    assert "none.toml" in refused("validate", "none.toml", str(held_out))
    text = held_out.read_text("utf-8").replace('role = "validate"', 'role = "ignore"')
    held_out.write_text(text, "utf-8")
    said = refused("validate", "hoist", CAMPAIGN)
    assert "axis 'hoist' has the role 'validate'" in said


@pytest.mark.slow
def test_the_command_and_python_write_the_same(done: Words, held_out: Path, tmp_path: Path) -> None:
    (tmp_path / "setup.toml").write_text(freeing("J_plus Z10"), "utf-8")
    words = ("--setup", "setup.toml", "--profile", "Z10", "--starts", "1", "--seed", "4")
    done("fit", CAMPAIGN, *words, "--jobs", "1", "--no-report")
    result = swashplate.identify(CAMPAIGN, free="setup.toml", profiles="Z10", starts=1, seed=4)
    for file in result.save("python"):
        assert file.read_bytes() == (tmp_path / "fitted" / file.name).read_bytes(), file.name


# --- report ---------------------------------------------------------------------------------------


@pytest.fixture
def fitted(held_out: Path, tmp_path: Path) -> Fit:
    """A fit and what it keeps of itself, in the folder fitted."""
    campaign = Campaign.from_toml(held_out)
    setup = FitSetup.model_validate(tomllib.loads(freeing("J_plus Z10")))
    found = fit(Drive.preset("hoist").parameters, campaign.select(role="fit"), setup)
    Identification(campaign, found, notes={"seed": "7"}).save(tmp_path / "fitted")
    return found


def test_the_report_is_written_again(done: Words, fitted: Fit, tmp_path: Path) -> None:
    said = done("report", "fitted", "--truth", "virtual/truth")  # the campaign is that of the fit
    assert "Report:    fitted/report.html" in said
    assert "Usable: predicts speed from counts within 0." in said
    page = (tmp_path / "fitted" / "report.html").read_text("utf-8")
    row = re.search(r"Z10</span></th>(?:<td[^>]*>[^<]*</td>){2}<td[^>]*>([^<]*)</td>", page)
    assert float(row[1]) == pytest.approx(fitted.values["Z10"], rel=5e-3)
    assert '<th class="n">truth</th>' in page
    assert '<th scope="row">seed</th><td>7</td>' in page
    words = ("fitted/drive.toml", CAMPAIGN, "--data", "all.parquet")
    assert "Samples, in SI: all.parquet" in done("report", *words)
    assert '<th class="n">truth</th>' not in (tmp_path / "fitted/report.html").read_text("utf-8")


def test_reports_that_are_refused(refused: Words, fitted: Fit, tmp_path: Path) -> None:
    command = ("report", "fitted", CAMPAIGN)
    assert "fit.json in virtual" in refused("report", "virtual", CAMPAIGN)
    assert "truth.toml" in refused(*command, "--truth", "truth.toml")
    Drive.preset("hoist").replace(Z10=9.0).to_toml(tmp_path / "fitted" / "mine.toml")
    said = refused("report", "fitted/mine.toml", CAMPAIGN)
    assert "mine.toml " in said
    assert "fitted/fit.json" in said
    path = tmp_path / CAMPAIGN
    text = path.read_text("utf-8")
    path.write_text(text.replace("virtual = true", "virtual = false"), "utf-8")
    assert "true parameters" in refused(*command, "--truth", "virtual/truth")
    path.write_text(text.replace('role = "fit"', 'role = "fit"\nweight = 2.0', 1), "utf-8")
    assert "changed since fitted/fit.json" in refused(*command)


# --- demo -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_main_job(done, tmp_path):
    printed = done("demo", "--out", "sub/demo")
    folder = tmp_path / "sub/demo"
    assert len(list((folder / "virtual").glob("*.csv"))) == 13
    assert (folder / "report.html").stat().st_size < 2_000_000
    fitted, truth = (
        Drive.from_toml(folder / name) for name in ("drive.toml", "virtual/truth/drive.toml")
    )
    for volts in (-6.5, -2.0, 2.0, 6.5):
        assert fitted.steady_speed(volts) == pytest.approx(truth.steady_speed(volts), rel=2e-3)
    inside, counted = map(int, re.search(r"for (\d+) of (\d+) parameters", printed).groups())
    assert counted > 30
    assert inside > 0.8 * counted
    for name in ("drive.toml", "estimates.csv", "report.html"):
        assert f"sub/demo/{name}" in printed
    readme = (Path(__file__).parents[2] / "README.md").read_text("utf-8")
    (shown,) = re.findall(r"```text\n(parameter .*?)```", readme, re.DOTALL)
    check_shown(f"...\n{shown}\n...", printed, "README.md", share=2e-3)
