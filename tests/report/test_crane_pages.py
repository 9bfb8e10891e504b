"""Pages and figures of cranes: scene, verdict, studies."""

import base64
import json
import re

import numpy as np
import pytest
from matplotlib.figure import Figure
from tests.report.conftest import injected

from swashplate import InputError
from swashplate.crane import (
    Crane,
    Seaway,
    Stick,
    control,
    follow,
    judge,
    simulate,
    sweep,
)
from swashplate.report import figures
from swashplate.report.scene import write_judgment, write_scene
from swashplate.report.scene.pages import COLUMNS

MEANT = control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation()
SHORT = {"length": 30.0, "start": 10.0}


@pytest.fixture(scope="module")
def crane():
    return Crane.preset("tg3637")


@pytest.fixture(scope="module")
def runs(crane):
    return {
        name: simulate(crane, Stick.rest(20.0), sea=Seaway("ss3", seed=1), control=law, slew_deg=90)
        for name, law in (("no control", None), ("</script><b>", MEANT))
    }


@pytest.fixture(scope="module")
def judged(crane):
    return judge(crane, MEANT, seeds=range(3), remedies=False, **SHORT)


@pytest.fixture
def scene(tmp_path, runs):
    write_scene(runs, tmp_path / "scene.html")
    return tmp_path / "scene.html"


def test_scene_holds_the_runs_pictures(scene, runs):
    text = scene.read_text("utf-8")
    assert not re.search(r"(src|href)\s*=\s*[\"']?(?!data:)(https?:)?//", text)
    assert "12 of 13 quantities of the crane are assumed" in text
    found = json.loads(re.search(r'id="data">(.*?)</script>', text)[1])
    assert [each["name"] for each in found["runs"]] == list(runs)
    code = base64.b64decode(found["runs"][1]["code"])
    pictures = np.frombuffer(code, "<f4").reshape(-1, found["columns"])
    run = runs["</script><b>"]
    step = round(found["step"] * 512)
    assert len(pictures) == len(run.out[::step])
    np.testing.assert_allclose(pictures[:, 3:6], run.load[::step], atol=1e-5)
    np.testing.assert_allclose(pictures[:, len(COLUMNS) :], run.ship[::step], atol=1e-6)


@pytest.mark.slow
def test_scene_runs_in_a_browser_without_errors(scene, runs, browsed):
    # the swing that it computes of its numbers at 10 s is that of the run
    made = browsed(scene, "#10")
    said = re.search(r"swing ([\d.]+)°, rope ([\d.]+) m", made)
    row = round(10.0 * 30.117647) * 17
    assert float(said[1]) == pytest.approx(runs["no control"].swing_deg[row], abs=0.06)
    assert float(said[2]) == pytest.approx(20.0, abs=0.06)
    assert 'data-drawn="301"' in made
    assert "<b>" not in re.sub(r"<script.*?</script>", "", made, flags=re.DOTALL)


def test_verdicts_page_says_what_the_judgment_does(tmp_path, judged):
    write_judgment(judged, tmp_path / "judge.html")
    text = tmp_path.joinpath("judge.html").read_text("utf-8")
    assert judged.verdict() in text
    assert text.count("<svg") == 3
    assert "min-width: 600px" not in text  # figures are whole on a narrow screen
    assert not re.search(r"(src|href)\s*=\s*[\"']?(https?:)?//", text)
    rms = np.degrees(judged.counted("identified").mean())
    assert f"{rms:.2f}" in text
    assert "12 of 13 quantities of the crane are assumed" in text
    assert text.count(">assumed<") == 12


@pytest.mark.slow
def test_verdicts_page_shows_in_a_browser_without_errors(tmp_path, judged, browsed):
    write_judgment(judged, tmp_path / "judge.html")
    assert "Limits of the drives" in browsed(tmp_path / "judge.html")


@pytest.mark.slow
def test_nothing_runs_in_a_page_but_its_own_scripts(tmp_path, scene, judged, browsed):
    assert "data-drawn=" in injected(scene, tmp_path, browsed)
    write_judgment(judged, tmp_path / "judge.html")
    assert "Limits of the drives" in injected(tmp_path / "judge.html", tmp_path, browsed)


def test_scenes_that_cannot_be_are_refused(tmp_path, crane, runs):
    with pytest.raises(InputError, match="shows 1 to 4 runs of a crane, not 0"):
        write_scene({}, tmp_path / "scene.html")
    longer = simulate(crane, Stick.rest(21.0))
    with pytest.raises(InputError, match="must be of one length"):
        write_scene({**runs, "longer": longer}, tmp_path / "scene.html")
    assert not list(tmp_path.iterdir())


SWEEPS = {"bearing": [0, 90, 180, 270], "height": [0.2, 0.5], "orifice": [1.0, 3.0]}


@pytest.mark.parametrize("name", ["judgment", "follow", *SWEEPS])
def test_figures_of_studies_are_legible_and_say_what_is_assumed(
    name, crane, judged, assert_legible
):
    made = judged if name == "judgment" else follow(crane, [5.0, 8.0, 12.0])
    if name in SWEEPS:
        made = sweep(crane, name, MEANT, points=SWEEPS[name], seeds=[0, 1], **SHORT)
    figure = made.plot()
    assert_legible(figure)
    words = [each.get_text() for ax in figure.axes for each in ax.texts]
    assert any("12 of 13 quantities of the crane are assumed" in each for each in words)
    first = made.headline if name == "judgment" else repr(made)
    assert made.summary().startswith(first)


def test_figures_of_one_panel_draw_in_given_axes(crane, judged):
    for made in (judged, follow(crane, [5.0, 8.0, 12.0])):
        ax = Figure().subplots()
        assert made.plot(ax=ax, title="here") is ax
        assert ax.get_title(loc="left") == "here"
        assert len(ax.lines) + len(ax.collections) >= 3


def test_figure_over_the_stick_shows_swing_and_where_the_slew_ends(crane, assert_legible):
    drives = ("volts", "ideal")
    made = sweep(crane, "stick", control.TipShaper(), points=[0.8, 1.0], drives=drives)
    figure = made.plot()
    assert_legible(figure)
    swing, ends = figure.axes
    shown = np.degrees(made.values[0, :, 0, 1])
    np.testing.assert_allclose(swing.lines[0].get_ydata(), shown)
    assert (swing.get_ylabel(), ends.get_ylabel()) == ("residual swing (deg)", "slew reached (deg)")


def test_figure_of_runs_shows_them_by_name_what_moves_and_the_sea(crane, runs):
    calm = {name: simulate(crane, Stick.rest(20.0), slew_deg=90) for name in runs}
    figure = figures.plot_crane(calm, sea=runs)
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert labels == ["swing (deg)", "in sea (deg)", "limits"]
    names = [each.get_text() for each in figure.axes[0].get_legend().get_texts()]
    assert names == list(runs)
    stick = Stick.trapezoid(slew=0.5, luff=0.5, duration=9.0, length=12.0)
    figure = simulate(crane, stick).plot()
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert labels == ["swing (deg)", "slew (deg)", "boom (deg)", "limits"]
    texts = [each.get_text() for ax in figure.axes for each in ax.texts]
    assert any("12 of 13 quantities of the crane are assumed" in each for each in texts)
    with pytest.raises(InputError, match="shows 1 to 6 runs of a crane, not 0"):
        figures.plot_crane({})
