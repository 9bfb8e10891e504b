"""Drives that come from fits: what the verdict was is said, and a drive of no use is refused."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from swashplate import Drive
from swashplate.cli import app
from swashplate.crane import Crane, Stick, control, judge
from swashplate.crane.crane import preset_text
from swashplate.identification import Verdict, load_setup
from swashplate.identification.assessment import FitFile, StoredVerdict
from swashplate.report.scene import write_judgment, write_scene

GRADES = {
    "Usable": "Usable: predicts held-out shaft_speed within 1.1 % of its range.",
    "Usable for prediction": "Usable for prediction of steps (held-out shaft_speed within 1.3 % of "
    "its range); parameter values not to be trusted because tau is not determined.",
    "Not usable": "Not usable: residuals are 2.14 times their known measurement error.",
}
SHORT = {"length": 12.0, "start": 5.0}
VALIDITY = "Holds for steps from -9 to 9 V; never reached: the swash plate's stop Z13."
UNREACHED = (
    "No test of the hoist's drive reached Z13_plus and Z13_minus: beyond what was tested it is "
    "extrapolated."
)
"""What the verdict holds for, and what the tests left open: both halves go with every verdict."""


@pytest.fixture
def fit(tmp_path):
    """The folder of a fit of the hoist, with a verdict of a grade, or none."""

    def made(grade, name="fitted", changed=1.0):
        folder = tmp_path / name
        folder.mkdir()
        parameters = replace(
            Crane.preset("tg3637").hoist.parameters, unreached={"Z13_plus": 0.2, "Z13_minus": 0.1}
        )
        drive = Drive(parameters)
        drive.scale(Z16=changed).to_toml(folder / "drive.toml")
        verdict = grade and StoredVerdict(
            grade=grade,
            headline=GRADES[grade],
            validity=VALIDITY,
            numbers=dict(drive.parameters.numbers),
        )
        file = FitFile(
            swashplate="1",
            axis="hoist",
            campaign="campaign.toml",
            runs={},
            nominal="",
            setup=load_setup("hoist"),
            stages=(),
            profiles=(),
            folds=None,
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
    "judge": ("--seeds", "2"),
    "follow": ("--sea", "ss3"),
    "sweep": ("bearing", "--points", "0", "--seeds", "1"),
    "sectors": ("--points", "0", "--seeds", "1"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_a_fit_that_is_not_usable(fit, command):
    folder = fit("Not usable")
    refused = said(command, "tg3637", *COMMANDS[command], "--drive", f"hoist={folder}")
    assert refused.exit_code == 2, refused.output
    sentence = refused.stderr
    assert sentence.count("\n") == 1
    for word in (f"hoist={folder}", GRADES["Not usable"].rstrip("."), "fit again", "--force"):
        assert word in sentence


def test_a_cranes_file_with_such_a_fit_is_refused_too(fit, tmp_path):
    fit("Not usable")
    mine = tmp_path / "mine.toml"
    mine.write_text(preset_text("tg3637").replace('hoist = "hoist"', 'hoist = "fitted"'), "utf-8")
    refused = said("run", mine, "--length", "5")
    assert refused.exit_code == 2
    assert "Not usable" in refused.stderr
    assert said("run", mine, "--length", "5", "--force").exit_code == 0
    shown = said("show", mine)
    assert shown.exit_code == 0
    assert GRADES["Not usable"] in " ".join(shown.stdout.split())


@pytest.mark.parametrize("grade", GRADES)
@pytest.mark.parametrize("command", ["run", "follow"])
def test_the_verdict_is_said(fit, command, grade):
    force = ["--force"] if grade == "Not usable" else []
    shown = said(command, "tg3637", *COMMANDS[command], "--drive", f"hoist={fit(grade)}", *force)
    assert shown.exit_code == 0, shown.output
    for words in (f"{GRADES[grade]} {VALIDITY}", UNREACHED):
        assert words in " ".join(shown.stdout.split())


def test_a_drive_without_a_verdict_says_so(fit, tmp_path):
    crane = Crane.preset("tg3637")
    alone = tmp_path / "alone.toml"
    crane.hoist.to_toml(alone)
    shown = said("run", "tg3637", "--length", "5", "--drive", f"hoist={alone}")
    assert shown.exit_code == 0
    words = " ".join(shown.stdout.split())
    assert "no verdict on it is known, as there is no fit beside it" in words
    older = crane.with_drive(hoist=fit(None)).sources["hoist"]
    assert (older.grade, older.usable) == (None, True)
    assert "fit again" in older.verdict
    # the verdict is on the drive that was fitted, not on one that was changed by hand
    changed = crane.with_drive(hoist=fit("Usable", "changed", changed=1.1)).sources["hoist"]
    assert changed.grade is None
    assert "is not the drive" in changed.verdict
    broken = fit("Usable", "broken")
    (broken / "fit.json").write_text("{", "utf-8")
    unread = crane.with_drive(hoist=broken).sources["hoist"]
    assert unread.grade is None
    assert "fit.json is not JSON" in unread.verdict
    assert not crane.with_drive(hoist="hoist", luff=crane.luff).sources


def test_a_title_that_says_not_usable_counts_without_the_fit(tmp_path):
    crane = Crane.preset("tg3637")
    title = f"tests: fitted to 4 runs, 24 Nov 2026. {GRADES['Not usable']}"
    crane.hoist.renamed("hoist", title.rstrip(".")).to_toml(tmp_path / "mine.toml")
    refused = said("follow", "tg3637", "--drive", f"hoist={tmp_path / 'mine.toml'}")
    assert refused.exit_code == 2
    assert GRADES["Not usable"].rstrip(".") in refused.stderr


def test_in_python_the_verdict_is_data_of_the_crane(fit):
    crane, folder = Crane.preset("tg3637"), fit("Usable for prediction")
    source = crane.with_drive(hoist=folder).sources["hoist"]
    assert source == (
        str(folder / "drive.toml"),
        folder,
        "Usable for prediction",
        GRADES["Usable for prediction"],
        VALIDITY,
    )
    result = SimpleNamespace(
        drive=crane.hoist, verdict=Verdict(GRADES["Not usable"], grade="Not usable")
    )
    bad = crane.with_drive(hoist=result)
    assert not bad.sources["hoist"].usable
    # a moved lever makes another drive of the same fit
    moved = bad.upgraded("hoist", {"orifice": 1.5})
    assert moved.sources["hoist"].grade == "Not usable"
    assert not bad.with_drive(hoist="hoist").sources
    unjudged = crane.with_drive(hoist=SimpleNamespace(drive=crane.hoist)).sources["hoist"]
    assert unjudged.grade is None
    # a limit that is given a value is no longer open
    fitted = crane.with_drive(hoist=folder)
    stopped = fitted.upgraded("hoist", {"Z13": 1.1})
    assert (fitted.unreached_sentence("hoist"), stopped.unreached_sentence("hoist")) == (
        UNREACHED,
        "",
    )
    assert UNREACHED in crane.with_drive(hoist=fitted.hoist).provenance()
    assert bad.with_drive(luff=crane.luff).sources == bad.sources


@pytest.mark.parametrize("grade", GRADES)
def test_judgment_and_page_say_the_verdict(fit, tmp_path, grade):
    crane = Crane.preset("tg3637").with_drive(hoist=fit(grade))
    found = judge(crane, control.DelayedFeedback(), seeds=[1], remedies=False, **SHORT)
    assert any(GRADES[grade] in sentence for sentence in found.sentences())
    write_judgment(found, tmp_path / "judge.html")
    page = tmp_path.joinpath("judge.html").read_text("utf-8")
    summary, basis = page.partition('<section id="swing">')[0], page.partition('id="basis"')[2]
    for part in (summary, basis):
        for words in (f"{GRADES[grade]} {VALIDITY}", UNREACHED):
            assert words.replace("'", "&#39;") in part
    look = {"Usable": "good", "Not usable": "bad"}.get(grade, "look")
    assert f'<dt class="{look}">Hoist&#39;s drive' in summary
    forced = "It rests on the fit of the hoist, which is not usable." in found.headline
    assert forced == (grade == "Not usable")
    assert found.headline.replace("'", "&#39;") in summary
    hoist = crane.hoist.parameters.title
    assert f"hoist: {hoist}" in basis


def test_a_scene_says_the_verdict(fit, tmp_path):
    crane = Crane.preset("tg3637").with_drive(hoist=fit("Not usable"))
    write_scene(crane.simulate(Stick.rest(2.0)), tmp_path / "scene.html")
    text = tmp_path.joinpath("scene.html").read_text("utf-8")
    for words in (f"{GRADES['Not usable']} {VALIDITY}", UNREACHED):
        assert words.replace("'", "&#39;") in text
