"""A fit on disk is the fit, and is refused where it no longer belongs to its campaign."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.identification.given import FEW, put
from tests.marks import rest_slow

from swashplate import Campaign, Drive, FileError, InputError, ParameterError
from swashplate.identification import Fit, Identification, Profile, Solution, fit
from swashplate.identification.fitting import fingerprint
from swashplate.identification.statistics.interval_ends import Point
from swashplate.locks import locked

STARTS = (
    Solution(np.array([0.3, 0.4]), 3.0, 10, True, False, "done"),
    Solution(np.ones(2), np.inf, 1, False, False, "left", number=1),
)


@pytest.fixture(scope="module")
def campaign(short_campaign: Campaign) -> Campaign:
    """A step each way."""
    return replace(short_campaign, experiments=short_campaign.experiments[2:])


@pytest.fixture(scope="module")
def fitted(campaign: Campaign) -> Fit:
    found = fit(Drive.preset("hoist").parameters, campaign.experiments, FEW)
    return replace(found, starts=STARTS)


@pytest.fixture
def path(campaign: Campaign, fitted: Fit, tmp_path: Path) -> Path:
    Identification(campaign, fitted).save(tmp_path)
    return tmp_path / "fit.json"


def test_a_fit_comes_back_as_it_was(path: Path, campaign: Campaign, fitted: Fit) -> None:
    stored = Identification.load(path, campaign)
    # others read it, too: it is JSON without numbers of its own
    content = json.loads(path.read_text("utf-8"), parse_constant=lambda word: pytest.fail(word))
    assert content["starts"][1]["cost"] == "Infinity"
    assert stored.fit.runs == stored.campaign.experiments
    assert [run.input.interpolation for run in stored.fit.runs] == [
        run.input.interpolation for run in fitted.runs
    ]
    assert stored.fit.setup == fitted.setup
    assert stored.fit.nominal == fitted.nominal
    assert stored.fit.parameters == fitted.parameters
    for one, other in zip(stored.fit.starts, fitted.starts, strict=True):
        assert (one.number, one.cost) == (other.number, other.cost)
        np.testing.assert_array_equal(one.vector, other.vector)
    assert stored.fit.values == fitted.values
    costs = [each.problem.cost(each.solution.vector) for each in (stored.fit, fitted)]
    assert costs[0] == costs[1]
    for name, value in vars(fitted.solution).items():
        assert np.array_equal(getattr(stored.fit.solution, name), value), name


COMPUTED = (
    "statistics.intervals.effects_of",
    "statistics.intervals.uncertainty",
    "assessment.assess_fit",
)


def test_what_is_stored_is_not_computed_again(path, campaign, fitted, monkeypatch) -> None:
    before = Identification(campaign, fitted)
    drive, verdict = before.drive, before.verdict

    def refuse(*_: object, **__: object) -> None:
        pytest.fail("computed")

    for name in COMPUTED:
        monkeypatch.setattr(f"swashplate.identification.{name}", refuse)
    # a value needs no interval, neither of a fit nor of its folder
    bare = replace(fitted)
    assert bare["Z10"].value == before["Z10"].value
    stored = Identification.load(path, campaign)
    for name in before:
        assert stored[name] == before[name]
    assert stored["Z10"].standard_error
    assert stored.drive == drive
    assert stored.verdict == verdict
    first = path.read_text("utf-8")
    stored.save(path.parent)
    assert path.read_text("utf-8") == first


@pytest.mark.slow
def test_what_is_not_stored_is_computed_when_it_is_asked_for(path, campaign, fitted) -> None:
    before = Identification(campaign, fitted)
    content = json.loads(path.read_text("utf-8"))
    del content["intervals"]
    del content["verdict"]
    path.write_text(json.dumps(content), "utf-8")
    older = Identification.load(path, campaign)
    assert older["Z10"] == before["Z10"]
    assert older.verdict == before.verdict


@pytest.mark.slow
def test_a_verdict_is_of_its_requirement_and_its_held_out_runs(short_campaign, tmp_path) -> None:
    *fitted_to, held_out = short_campaign.experiments
    held_out = replace(held_out, role="validate")
    tests = replace(short_campaign, experiments=(*fitted_to, held_out))
    found = fit(Drive.preset("hoist"), tests, FEW)
    strict = Identification(tests, found, required=1e-6)
    strict.save(tmp_path)
    stored = Identification.load(tmp_path, tests)
    assert stored.required == 1e-6
    assert stored.verdict == strict.verdict
    assert not stored.verdict.predicts
    assert replace(stored, required=0.9).verdict.predicts
    assert any(each.held_out for error in stored.verdict.predictions for each in error.classes)
    alone = Identification.load(tmp_path, replace(tests, experiments=tuple(fitted_to)))
    assert not alone.predicted
    assert not any(each.held_out for error in alone.verdict.predictions for each in error.classes)


def test_two_do_not_save_into_one_folder_at_once(campaign, fitted, tmp_path) -> None:
    result = Identification(campaign, fitted)
    with locked(tmp_path / "fitted"), ThreadPoolExecutor(1) as threads:
        other = threads.submit(result.save, tmp_path / "fitted")
        with pytest.raises(OSError, match="fitted .*another folder"):
            other.result()
        result.save(tmp_path / "fitted")  # who has the lock can
    assert Identification.load(tmp_path / "fitted", campaign)["Z10"] == result["Z10"]


def test_profiles_and_notes_come_back(tmp_path, campaign, fitted) -> None:
    points = tuple(Point(x, 3.0 + x * x, np.array([x, 0.5])) for x in (-0.1, 0.0, 0.1))
    name, ends = fitted.problem.unknowns.names[0], ("crossed", "bound")
    profile = Profile(0, 3.0, points, 1.0, -0.1, None, ends, points[0], name)
    path = tmp_path / "fit.json"
    result = Identification(campaign, fitted, profiles=[profile], notes={"seed": "3"})
    result.save(tmp_path)
    stored = Identification.load(path, campaign)
    assert stored.notes == {"seed": "3"}
    (back,) = stored.profiles
    assert back.name == profile.name
    assert back.rise == profile.rise
    assert (back.lower, back.upper) == (-0.1, None)
    assert [each.cost for each in back.points] == [each.cost for each in points]
    assert np.array_equal(back.points[2].vector, points[2].vector)
    assert back.better is not None

    content = json.loads(path.read_text("utf-8"))
    content["profiles"][0]["index"] = 99
    path.write_text(json.dumps(content), "utf-8")
    with pytest.raises(FileError, match="profile of a parameter that it does not have"):
        Identification.load(path, campaign)


def test_fit_and_campaign_may_be_moved_together(
    short_campaign: Campaign, campaign: Campaign, fitted: Fit, tmp_path: Path
) -> None:
    tests, moved = tmp_path / "tests", tmp_path / "moved"
    shutil.copytree(short_campaign.path.parent, tests)
    there = replace(campaign, path=tests / "campaign.toml")
    Identification(there, fitted).save(tests / "fitted")
    tests.rename(moved)
    assert Identification.load(moved / "fitted").campaign.path == moved / "campaign.toml"


def test_another_campaign_is_refused(path: Path, campaign: Campaign) -> None:
    first, second = campaign.experiments
    alone = replace(campaign, experiments=(first,))
    with pytest.raises(InputError, match="run '.*'"):
        Identification.load(path, alone)
    current = second["current"]
    current = replace(current, weight=current.weight * (current.time > 0.1))
    ignored = replace(second, channels={**second.channels, "current": current})
    assert fingerprint(ignored) != fingerprint(second)
    changed = replace(campaign, experiments=(first, ignored))
    with pytest.raises(InputError, match="changed since .*fit.json"):
        Identification.load(path, changed)


POISON = {
    "cut": (lambda text: text[:-100], "is not JSON"),
    "another key": (put('"axis"', '"ax"'), "'ax'.*'axis' is meant"),
    "other parameters": (put('"Z10"', '"Z3"', 1), "other parameters than its fit setup: fit again"),
    "another kind": (put('"kind": "parameter"', '"kind": "force"', 1), "other parameters"),
    "other version": (put('"swashplate": "[^"]*"', '"swashplate": "9.9"'), "9.9"),
    "text for a vector": (put(r'"vector": \[[^]]+\]', '"vector": "abc"'), "finite numbers"),
    "far from its bounds": (
        put(r'"vector": \[[^]]+\]', '"vector": [1e308, 1e308, 1e308, 1e308, 1e308]', 1),
        "outside its bounds: fit again",
    ),
    "of several stages": (put("^{", '{"stages": [],'), "fit in stages.* fit again"),
    "no run": (put(r'"runs": {[^}]+}', '"runs": {}'), "no run .* fit again"),
    "wrong length": (put(r'"vector": \[[^]]+\]', '"vector": [1.0]', 1), "other parameters"),
    "too few intervals": (put(r'("intervals": \[)[^]]+\],', r"\1", 1), "other parameters"),
    "a number for the drive": (put('"nominal": ', '"nominal": 3, "was": '), "nominal"),
}


@pytest.mark.parametrize(("poison", "sentence"), rest_slow([*POISON.values()], 3), ids=POISON)
def test_a_poisoned_file_ends_in_a_sentence(path, campaign, poison, sentence) -> None:
    path.write_text(poison(path.read_text("utf-8")), "utf-8")
    with pytest.raises((FileError, ParameterError), match=f"fit.json.*{sentence}") as caught:
        Identification.load(path, campaign)
    assert len(str(caught.value)) < 500
