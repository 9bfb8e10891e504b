"""Drives that come from fits: what the verdict was is said, and a drive of no use is refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.marks import rest_slow
from typer.testing import CliRunner

from swashplate import Drive
from swashplate.cli import app
from swashplate.crane import (
    Crane,
    OperatorCommand,
    assess,
    control,
    preset_text,
    simulate,
    with_design_change,
)
from swashplate.identification import FitSetup, Verdict
from swashplate.identification.assessment import FitFile, StoredVerdict
from swashplate.identification.diagnostics.discrepancy import ClassError, PredictionError
from swashplate.identification.estimation.setup import Free
from swashplate.identification.estimation.solving import Solution
from swashplate.report.scene import write_assessment, write_scene

HEADLINES = {
    True: "Usable: predicts shaft_speed within 1.1 % of its range in a new maneuver (large 1.1 %).",
    False: "Not usable: predicts shaft_speed within 14 % of its range in large motion; 10 % is "
    "required.",
}
NONE_KNOWN = "has none: fit again"
SOLUTION = Solution(
    vector=np.zeros(0), cost=0.0, evaluations=1, converged=True, interrupted=False, message=""
)
"""Of this fit only the verdict is read."""
SHORT = {"length": 60.0, "run_in": 0.0, "remedies": False, "tipping_points": False}
VALIDITY = "Holds for steps from -9 to 9 V; never reached: the swash plate's stop Z13."
UNREACHED = (
    "No test of the hoist's drive reached Z13_plus and Z13_minus: beyond what was tested it is "
    "extrapolated."
)
"""What the verdict holds for, and what the tests left open: both halves go with every verdict."""


def verdict_of(usable):
    """A verdict by the stated error of the shaft's speed: 1.1 or 14 % of its range."""
    error = 0.011 if usable else 0.14
    speed = PredictionError(
        "shaft_speed", "rad/s", 3.0, (error**2, 0.0, 0.0), (ClassError("large", error, 3, 1),)
    )
    return Verdict(0.1, (speed,), ("shaft_speed",), validity=VALIDITY, fastest_sine=0.1)


@pytest.fixture
def fit(tmp_path):
    """The folder of a fit of the hoist, with a verdict that calls it usable or not, or none."""

    def made(usable, name="fitted", changed=1.0):
        folder = tmp_path / name
        folder.mkdir()
        parameters = replace(
            Crane.preset("tg3637").hoist.parameters, unreached={"Z13_plus": 0.2, "Z13_minus": 0.1}
        )
        drive = Drive(parameters)
        drive.scale(Z16=changed).to_toml(folder / "drive.toml")
        verdict = None
        if usable is not None:
            verdict = StoredVerdict(
                verdict=verdict_of(usable), numbers=dict(drive.parameters.numbers)
            )
        file = FitFile(
            swashplate="1",
            axis="hoist",
            campaign="campaign.toml",
            runs={"step": ""},
            nominal="",
            setup=FitSetup(part="pump", free={"Z8": Free(relative=(0.5, 2.0))}),
            unknowns=(),
            solution=SOLUTION,
            starts=(),
            profiles=(),
            notes={},
            verdict=verdict,
        )
        (folder / "fit.json").write_text(file.model_dump_json(by_alias=True), "utf-8")
        return folder

    return made


def said(*words):
    return CliRunner().invoke(app, ["crane", *map(str, words)], env={"COLUMNS": "200"})


COMMANDS = {
    "run": ("--length", "5"),
    "assess": ("--seeds", "2"),
    "follow": ("--sea", "ss3"),
    "sweep": ("bearing", "--points", "0", "--seeds", "1"),
    "operability": ("--headings", "0"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_a_fit_that_is_not_usable(fit, command):
    folder = fit(False)
    refused = said(command, "tg3637", *COMMANDS[command], "--drive", f"hoist={folder}")
    assert refused.exit_code == 2, refused.output
    sentence = refused.stderr
    assert sentence.count("\n") == 1
    for word in (f"hoist={folder}", HEADLINES[False].rstrip("."), "fit again", "--force"):
        assert word in sentence


def test_a_cranes_file_with_such_a_fit_is_refused_too(fit, tmp_path):
    fit(False)
    mine = tmp_path / "mine.toml"
    mine.write_text(preset_text("tg3637").replace('hoist = "hoist"', 'hoist = "fitted"'), "utf-8")
    refused = said("run", mine, "--length", "5")
    assert refused.exit_code == 2
    assert "Not usable" in refused.stderr
    assert said("run", mine, "--length", "5", "--force").exit_code == 0
    shown = said("show", mine)
    assert shown.exit_code == 0
    assert HEADLINES[False] in " ".join(shown.stdout.split())


@pytest.mark.parametrize("usable", [True, False])
@pytest.mark.parametrize("command", ["run", "follow"])
def test_the_verdict_is_said(fit, command, usable):
    force = [] if usable else ["--force"]
    shown = said(command, "tg3637", *COMMANDS[command], "--drive", f"hoist={fit(usable)}", *force)
    assert shown.exit_code == 0, shown.output
    for words in (f"{HEADLINES[usable]} {VALIDITY}", UNREACHED):
        assert words in " ".join(shown.stdout.split())


def test_a_drive_without_a_verdict_says_so(fit, tmp_path):
    crane = Crane.preset("tg3637")
    alone = tmp_path / "alone.toml"
    crane.hoist.to_toml(alone)
    shown = said("run", "tg3637", "--length", "5", "--drive", f"hoist={alone}")
    assert shown.exit_code == 0
    words = " ".join(shown.stdout.split())
    assert "its verdict is not known: there is no fit next to it" in words
    older = crane.with_drive(hoist=fit(None)).sources["hoist"]
    assert (older.fit_usable, older.usable) == (None, True)
    assert "fit again" in older.verdict
    # the verdict is on the drive that was fitted, not on one that was changed by hand
    changed = crane.with_drive(hoist=fit(True, "changed", changed=1.1)).sources["hoist"]
    assert changed.fit_usable is None
    assert "is not the drive" in changed.verdict
    broken = fit(True, "broken")
    (broken / "fit.json").write_text("{", "utf-8")
    unread = crane.with_drive(hoist=broken).sources["hoist"]
    assert unread.fit_usable is None
    assert "fit.json is not JSON" in unread.verdict
    assert not crane.with_drive(hoist="hoist", luff=crane.luff).sources


def test_a_title_that_says_not_usable_counts_without_the_fit(tmp_path):
    crane = Crane.preset("tg3637")
    title = f"tests: fitted to 4 runs, 24 Nov 2026. {HEADLINES[False]}"
    crane.hoist.renamed("hoist", title.rstrip(".")).to_toml(tmp_path / "mine.toml")
    refused = said("follow", "tg3637", "--drive", f"hoist={tmp_path / 'mine.toml'}")
    assert refused.exit_code == 2
    assert HEADLINES[False].rstrip(".") in refused.stderr


def test_in_python_the_verdict_is_data_of_the_crane(fit):
    crane, folder = Crane.preset("tg3637"), fit(True)
    source = crane.with_drive(hoist=folder).sources["hoist"]
    assert source == (
        str(folder / "drive.toml"),
        folder,
        True,
        HEADLINES[True],
        VALIDITY,
        0.1,
    )
    result = SimpleNamespace(drive=crane.hoist, verdict=verdict_of(False))
    bad = crane.with_drive(hoist=result)
    assert not bad.sources["hoist"].usable
    # a moved lever makes another drive of the same fit
    moved = with_design_change(bad, "hoist", {"orifice": 1.5})
    assert moved.sources["hoist"].fit_usable is False
    assert not bad.with_drive(hoist="hoist").sources
    unassessed = crane.with_drive(hoist=SimpleNamespace(drive=crane.hoist)).sources["hoist"]
    assert unassessed.fit_usable is None
    # a limit that is given a value is no longer open
    fitted = crane.with_drive(hoist=folder)
    stopped = with_design_change(fitted, "hoist", {"Z13": 1.1})
    assert (fitted.unreached_sentence("hoist"), stopped.unreached_sentence("hoist")) == (
        UNREACHED,
        "",
    )
    assert UNREACHED in crane.with_drive(hoist=fitted.hoist).provenance()
    assert bad.with_drive(luff=crane.luff).sources == bad.sources


@pytest.mark.slow
@pytest.mark.parametrize(
    ("usable", "look"), rest_slow([(False, "bad"), (True, "good"), (None, "look")]), ids=str
)
def test_judgment_and_page_say_the_verdict(fit, tmp_path, usable, look):
    crane = Crane.preset("tg3637").with_drive(hoist=fit(usable))
    verdict = NONE_KNOWN if usable is None else f"{HEADLINES[usable]} {VALIDITY}"
    found = assess(crane, control.DelayedFeedback(), seeds=[1], **SHORT)
    assert any(verdict in sentence for sentence in found.sentences())
    slow = (
        "The waves' peak is at 0.133 Hz, but the hoist's drive was tested with sines of up to 0.1"
    )
    assert any(slow in sentence for sentence in found.sentences()) == (usable is not None)
    write_assessment(found, tmp_path / "assessment.html")
    page = tmp_path.joinpath("assessment.html").read_text("utf-8")
    summary, basis = page.partition('<section id="swing">')[0], page.partition('id="basis"')[2]
    for part in (summary, basis):
        for words in (verdict, UNREACHED):
            assert words.replace("'", "&#39;") in part
    assert f'<dt class="{look}">Hoist&#39;s drive' in summary
    forced = "It is based on the fit of the hoist, which is not usable."
    for words in (found.headline, summary):
        assert (forced in words) == (usable is False)
    hoist = crane.hoist.parameters.title
    assert f"hoist: {hoist}" in basis


def test_a_scene_says_the_verdict(fit, tmp_path):
    crane = Crane.preset("tg3637").with_drive(hoist=fit(False))
    write_scene(simulate(crane, OperatorCommand.rest(2.0)), tmp_path / "scene.html")
    text = tmp_path.joinpath("scene.html").read_text("utf-8")
    for words in (f"{HEADLINES[False]} {VALIDITY}", UNREACHED):
        assert words.replace("'", "&#39;") in text
