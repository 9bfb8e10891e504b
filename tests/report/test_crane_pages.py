"""Pages and figures of cranes: scene, verdicts, studies."""

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from scipy import stats
from tests.report.conftest import injected

from swashplate import InputError
from swashplate.crane import (
    Crane,
    Demand,
    Followable,
    Hull,
    Operability,
    OperatorCommand,
    Scatter,
    Seaway,
    Spectrum,
    Sweep,
    TippingPoint,
    assess,
    control,
    follow,
    simulate,
)
from swashplate.crane.studies.operating import SeaCell
from swashplate.report import figures
from swashplate.report.figures.crane import seaway_label
from swashplate.report.scene import write_assessment, write_operability, write_scene
from swashplate.report.scene.pages import COLUMNS
from swashplate.report.style import BLUE, GREEN, VERMILION

MEANT = control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation()
SHORT = {"length": 60.0, "run_in": 20.0, "remedies": False, "tipping_points": False}


@pytest.fixture(scope="module")
def crane():
    return Crane.preset("tg3637")


@pytest.fixture(scope="module")
def runs(crane):
    return {
        name: simulate(
            crane,
            OperatorCommand.rest(20.0),
            sea=Seaway("ss3", seed=1),
            control=controller,
            slew_deg=90,
        )
        for name, controller in (("no control", None), ("</script><b>", MEANT))
    }


@pytest.fixture(scope="module")
def assessed(crane):
    return assess(crane, MEANT, seeds=range(3), **SHORT)


@pytest.fixture
def scene(tmp_path, runs):
    write_scene(runs, tmp_path / "scene.html")
    return tmp_path / "scene.html"


def test_scene_holds_the_runs_pictures(scene, runs):
    text = scene.read_text("utf-8")
    assert not re.search(r"(src|href)\s*=\s*[\"']?(?!data:)(https?:)?//", text)
    assert "14 of 15 quantities of the crane are assumed" in text
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


BEYOND = "the load swings beyond 30 deg"


@pytest.fixture(scope="module")
def harming(assessed):
    """The same as if the assessed variant had left the model twice, and swung more in the third."""
    left = assessed.outcomes[0][-1]._replace(rms_swing=np.nan, departure_reason=BEYOND)
    none = assessed.outcomes[2][0]
    more = assessed.outcomes[2][-1]._replace(rms_swing=1.5 * none.rms_swing)
    changed = [left, left, more]
    outcomes = tuple(
        (*seaway[:-1], last) for seaway, last in zip(assessed.outcomes, changed, strict=True)
    )
    return replace(assessed, outcomes=outcomes)


@pytest.fixture(scope="module")
def year(crane):
    """Two heights at two periods, one sea missing; headings 0 and 90."""
    scatter = Scatter.of([0.5, 0.5, 1.5], [6.0, 8.0, 8.0], [50.0, 30.0, 20.0], "Made for a test.")
    good, bad = SeaCell("", 0.2, False), SeaCell("side_lead", 2.0, True)
    none = {(row, heading): bad for row in range(3) for heading in (0.0, 90.0)}
    own = {**dict.fromkeys(none, good), (1, 90.0): SeaCell("luff orifice", 1.2, True)}
    own |= {(2, 0.0): bad, (2, 90.0): bad}
    cells = {"no control": none, "identified": own}
    hoist = (0.7, 8.0, 90.0)
    controller, headings = control.Clip(), (0.0, 90.0)
    return Operability(
        crane=crane,
        control=controller,
        scatter=scatter,
        headings=headings,
        cells=cells,
        seaway=Seaway(),
        case="The case.",
        crewed=False,
        hoist_limit=hoist,
    )


def written(write, result, folder):
    """The text of a page, whose quotes are not escaped."""
    write(result, folder / "page.html")
    return folder.joinpath("page.html").read_text("utf-8").replace("&#39;", "'")


def words_of(figure):
    found = [text.get_text() for ax in figure.axes for text in ax.texts]
    found += [legend.get_title().get_text() for legend in figure.legends]
    return " ".join(found).replace("\n", " ")


# --- pages ----------------------------------------------------------------------------------------


def test_verdicts_page_has_both_answers_with_a_light_of_their_own(tmp_path, assessed, harming):
    text = written(write_assessment, assessed, tmp_path)
    summary, _, rest = text.partition('<section id="hangs">')
    looks = {"yes": "good", "not decided": "look", "no": "bad"}
    for subject, decision, sentence in (
        ("Harm", assessed.harmless, assessed.harm_sentence()),
        ("Sufficiency", assessed.sufficient, assessed.sufficiency_sentence()),
    ):
        assert f'<dt class="{looks[decision]}">{subject}</dt>' in summary
        assert sentence in summary
    for quantity in ("off-lead", "side-lead", "dynamic factor", "place"):
        assert f'<th scope="row">{quantity}</th>' in summary
    assert "3 seaways of 1 min" in summary
    assert summary.count("<svg") == 1
    assert rest.count("<svg") == 2
    failed = written(write_assessment, harming, tmp_path)
    assert '<div class="headline bad">' in failed
    assert f"'identified' is not a valid operation in 2 of 3 seaways: {BEYOND}." in failed


@pytest.mark.slow
def test_verdicts_page_says_what_the_answer_hangs_on(tmp_path, assessed):
    point = TippingPoint("the ship's roll period", "13 s", "10.4 s", True, False)
    text = written(write_assessment, replace(assessed, tipping_points=(point,)), tmp_path)
    hangs = text.partition('<section id="hangs">')[2].partition("</section>")[0]
    for words in (
        "The load's swing has a damping of 0.5 %, assumed.",
        "The ship's roll period is 13 s, assumed.",
        "14 of 15 quantities of the crane are assumed.",
        "Limits that are assumed: swing, off-lead, side-lead",
        point.sentence(),
    ):
        assert words in hangs
    # of the limits and of the geometry, every assumed row is marked
    assert text.count("<td>assumed</td>") == 7 + 14
    assert "roll period 13 s with a damping of 6 %" in text


@pytest.mark.slow
def test_verdicts_page_of_harm_alone_says_what_was_not_asked(tmp_path, assessed):
    text = written(write_assessment, replace(assessed, questions=("harm",)), tmp_path)
    assert text.count("This was not requested") == 1
    assert "suffice" not in text.partition('<div class="headline')[2].partition("</div>")[0]


@pytest.mark.slow
def test_pages_are_one_file_each_without_an_outside_link(tmp_path, assessed, year):
    for write, result in ((write_assessment, assessed), (write_operability, year)):
        text = written(write, result, tmp_path)
        assert not re.search(r"(src|href)\s*=\s*[\"']?(https?:)?//", text)
        assert "min-width: 600px" not in text  # figures are whole on a narrow screen
        assert "14 of 15 quantities of the crane are assumed" in text


def test_operabilitys_page_has_one_figure_the_shares_and_what_is_assumed(tmp_path, year):
    text = written(write_operability, year, tmp_path)
    # 50 and half of 30 per cent can be worked; all of 20 and half of 30 cannot
    lead = "'identified' can work 65 % of the year, the crane without control 0 %."
    assert f"{lead} Most often the rest is limited by side-lead first: 20 % of the year." in text
    summary = text.partition('<section id="basis">')[0]
    assert summary.count("<svg") == summary.count("<table") == 1
    for words in ("65.0 %", "15.0 %", "20.0 %", "100.0 %"):
        assert words in summary
    for sentence in year.sentences():
        assert sentence in summary
    assert text.count("<td>assumed</td>") == 7 + 14


@pytest.mark.slow
def test_verdicts_page_shows_in_a_browser_without_errors(tmp_path, assessed, browsed):
    write_assessment(assessed, tmp_path / "assessment.html")
    assert "Limits of the drives" in browsed(tmp_path / "assessment.html")


@pytest.mark.slow
def test_nothing_runs_in_a_page_but_its_own_scripts(tmp_path, scene, assessed, year, browsed):
    assert "data-drawn=" in injected(scene, tmp_path, browsed)
    write_assessment(assessed, tmp_path / "assessment.html")
    assert "Limits of the drives" in injected(tmp_path / "assessment.html", tmp_path, browsed)
    write_operability(year, tmp_path / "year.html")
    assert "What it rests on" in injected(tmp_path / "year.html", tmp_path, browsed)


def test_scenes_that_cannot_be_are_refused(tmp_path, crane, runs):
    with pytest.raises(InputError, match="1 to 4 .* 0"):
        write_scene({}, tmp_path / "scene.html")
    longer = simulate(crane, OperatorCommand.rest(21.0))
    with pytest.raises(InputError, match="one length"):
        write_scene({**runs, "longer": longer}, tmp_path / "scene.html")
    assert not list(tmp_path.iterdir())


# --- figures --------------------------------------------------------------------------------------


def test_seaways_in_words_have_height_period_heading_and_roll():
    assert seaway_label(Seaway()) == "ss3 0.88 m, 7.5 s, abeam from starboard, roll 13 s"
    hull = Hull(100.0, 20.0, 6.0, roll_period=10.0)
    other = Seaway(Spectrum(1.2, 8.0, 3.3), heading_deg=45.0, ship=hull)
    assert seaway_label(other) == "1.2 m, 8 s, γ 3.3, waves at 45°, roll 10 s"
    assert seaway_label(Seaway(heading_deg=-180.0), height=False).startswith("peak at 7.5 s, head")


def test_figure_of_an_assessment_tells_seaways_from_the_means_interval(assessed, assert_legible):
    figure = assessed.plot()
    assert_legible(figure)
    title = figure.get_suptitle()
    assert title == "3 seaways of 1 min, ss3 0.88 m, 7.5 s, abeam from starboard, roll 13 s"
    swing = figure.axes[0]
    diamonds = [patch for patch in swing.patches if isinstance(patch, Polygon)]
    for name, points, diamond in zip(
        reversed(assessed.names), swing.collections, diamonds, strict=False
    ):
        expected = np.degrees(assessed.swing(name))
        np.testing.assert_allclose(np.sort(points.get_offsets()[:, 0]), np.sort(expected))
        # the root of the mean square, and of its interval
        squares = expected**2
        half = stats.sem(squares) * stats.t.ppf(0.975, 2)
        across = diamond.get_xy()[:, 0]
        assert across.max() == pytest.approx(np.sqrt(squares.mean() + half))
        assert across.min() == pytest.approx(np.sqrt(max(squares.mean() - half, 0.0)))
    (line,) = swing.collections[3].get_segments()
    assert line[0, 0] == pytest.approx(np.degrees(assessed.linear.values["swing"].rms))


def test_figure_of_an_assessment_counts_runs_that_left_the_model(harming, assert_legible):
    figure = harming.plot()
    assert_legible(figure)
    swing = figure.axes[0]
    ticks = [text.get_text() for text in swing.get_xticklabels()]
    assert ticks[-1] == "left the\nmodel"
    assert [text.get_text() for text in swing.texts if text.get_text() == "2"]
    cross = next(line for line in swing.lines if line.get_marker() == "x")
    largest = max(np.nanmax(np.degrees(harming.swing(name))) for name in harming.names)
    assert cross.get_xdata()[0] > largest
    # the last variant is the lowest row; the one of its seaways that stayed swings more than none
    colors = swing.collections[0].get_facecolors()
    assert to_hex(colors[-1]) == VERMILION.lower()
    rows = [text.get_text() for text in swing.get_yticklabels()]
    assert rows[0] == "identified\nworse than none: 3 of 3"
    nobody = tuple(
        tuple(one._replace(rms_swing=np.nan, departure_reason=BEYOND) for one in seaway)
        for seaway in harming.outcomes
    )
    assert_legible(replace(harming, outcomes=nobody, linear=None).plot())


def test_figure_of_an_assessment_has_shares_of_limits(assessed, crane):
    limits = assessed.plot().axes[1]
    limited = assessed.limited(assessed.assessed_variant)
    labels = [text.get_text().partition("\n")[0] for text in limits.get_yticklabels()]
    assert labels[0] == "saturation"
    assert labels[-1] == "swing"
    shown = {round(float(line.get_ydata()[0]), 2): line.get_xdata()[0] for line in limits.lines}
    for row, one in enumerate(reversed(limited)):
        if one.largest.value == one.largest.value:  # not of too few peaks
            share = one.largest.value / one.limit
            assert shown[row] == pytest.approx(np.clip(share, 0.1, limits.get_xlim()[1]))
    unlimited = replace(assessed, study=replace(assessed.study, crane=replace(crane, limits={})))
    assert len(replace(unlimited, questions=("harm",)).plot().axes) == 1


def swept(crane, over, points, values):
    """A sweep of one variant besides no control, in two seaways. [deg]"""
    both = np.radians(np.array([values, values]))
    seaways = np.stack([both, 0.5 * both], axis=-1)
    seaways[1] *= 1.1
    points = np.radians(points) if over == "bearing" else np.asarray(points)
    names, spectrum = ("no control", "identified"), np.full(len(points), 0.1)
    return Sweep(over, points, names, seaways, spectrum, crane, Seaway())


@pytest.mark.parametrize("over", ["bearing", "height", "orifice"])
def test_figures_of_sweeps_mark_where_a_run_left_the_model(over, crane, assert_legible):
    points = [0.0, 60.0, 120.0, 240.0] if over == "bearing" else [0.5, 1.0, 2.0, 3.0]
    figure = swept(crane, over, points, [2.0, 3.0, np.nan, 5.0]).plot()
    assert_legible(figure)
    words = words_of(figure)
    assert "14 of 15 quantities of the crane are assumed" in words
    assert "×: a run left the model" in words
    ax = figure.axes[0]
    crosses = [line for line in ax.lines if line.get_marker() == "x"]
    assert [len(line.get_xdata()) for line in crosses] == [1, 1]
    expected = np.radians(120.0) if over == "bearing" else 2.0
    assert crosses[0].get_xdata()[0] == pytest.approx(expected)
    line = ax.lines[0]
    assert list(np.isnan(line.get_ydata())[:4]) == [False, False, True, False]
    if over != "bearing":
        assert line.get_ydata()[0] == pytest.approx(np.sqrt(0.5 * (2.0**2 + 2.2**2)))


@pytest.mark.parametrize(
    ("points", "ends"),
    [
        ([0, 45, 90, 135, 180], (0.0, 180.0)),
        ([180, 225, 270, 360], (180.0, 360.0)),
        ([0, 90, 180, 270], (0.0, 360.0)),
    ],
)
def test_bearings_on_one_side_of_the_ship_make_half_a_circle(crane, points, ends, assert_legible):
    figure = swept(crane, "bearing", points, np.linspace(1.0, 8.0, len(points))).plot()
    assert_legible(figure)
    ax = figure.axes[0]
    assert (ax.get_thetamin(), ax.get_thetamax()) == ends


def test_what_seas_ask_has_the_colour_of_its_axis_and_is_filled_if_beyond(crane, assert_legible):
    periods = np.array([5.0, 10.0, 15.0])
    amplitude = np.outer([1.0, 2.0, 3.0], [1.0, 2.0, 0.5])
    seas = {"mine": Demand(10.0, (1.9, 4.1, 1.2)), "calm": Demand(5.0, (0.5, 0.0, 0.4))}
    figure = Followable(periods, amplitude, seas, crane, 45.0).plot()
    assert_legible(figure)
    ax = figure.axes[0]
    marks = [line for line in ax.lines if line.get_marker() in ("D", "v")]
    assert [line.get_color() for line in marks] == [BLUE, VERMILION, GREEN] * 2
    faces = [line.get_markerfacecolor() for line in marks]
    assert faces == ["white", VERMILION, GREEN, "white", "white", "white"]
    assert [line.get_marker() for line in marks] == ["D", "D", "D", "D", "v", "D"]
    assert [line.get_ydata()[0] for line in marks[:3]] == [1.9, 4.1, 1.2]
    assert "mine" in words_of(figure)
    assert_legible(follow(crane).plot())


def test_figure_of_operability_colours_each_sea_by_what_limits_it(year, assert_legible):
    figure = year.plot()
    assert_legible(figure)
    none, own = figure.axes
    assert none.get_title(loc="left") == "no control: 0 % of the year"
    assert own.get_title(loc="left") == "identified: 65 % of the year"
    legend = {text.get_text(): patch.get_facecolor() for text, patch in entries(figure)}
    assert set(legend) == {"side-lead", "luff orifice", "can be worked"}
    cells = [patch for patch in own.patches if isinstance(patch, Rectangle)]
    assert len(cells) == 3  # the sea that does not come has none
    good, half, bad = (np.array(cell.get_facecolor()[:3]) for cell in cells)
    assert (good == 1.0).all()
    np.testing.assert_allclose(bad, legend["side-lead"][:3])
    # one heading of two: paler, of the same hue
    full = np.array(legend["luff orifice"][:3])
    strength = (1.0 - half) / (1.0 - full)
    assert np.ptp(strength) < 1e-9
    assert 0.3 < strength[0] < 1.0
    assert cells[1].get_bbox().bounds == pytest.approx((7.0, 0.0, 2.0, 1.0))
    words = words_of(figure)
    assert "made for a test; 14 of 15 quantities of the crane are assumed" in words


@pytest.mark.slow
def test_figure_of_operability_has_rows_of_three_panels(year, assert_legible):
    more = {f"identified {number}": year.cells["identified"] for number in range(4)}
    figure = replace(year, cells={**year.cells, **more}).plot()
    assert_legible(figure)
    shown = [ax for ax in figure.axes if ax.axison]
    assert len(shown) == 6
    five = {name: cells for name, cells in year.cells.items() if name == "no control"} | more
    figure = replace(year, cells=five).plot()
    assert_legible(figure)
    labels = [ax.get_xlabel() for ax in figure.axes if ax.axison]
    assert labels == ["", "", *["peak period (s)"] * 3]


def entries(figure):
    (legend,) = figure.legends
    return zip(legend.get_texts(), legend.get_patches(), strict=True)


def test_figures_of_one_panel_draw_in_given_axes(crane, assessed):
    for result in (assessed, follow(crane, [5.0, 8.0, 12.0])):
        ax = Figure().subplots()
        assert result.plot(ax=ax, title="here") is ax
        assert ax.get_title(loc="left") == "here"
        assert len(ax.lines) + len(ax.collections) >= 3


def test_figure_of_runs_shows_them_by_name_what_moves_and_the_sea(crane, runs):
    calm = {name: simulate(crane, OperatorCommand.rest(20.0), slew_deg=90) for name in runs}
    figure = figures.plot_crane(calm, sea=runs)
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert labels == ["swing (deg)", "in sea (deg)", "limits"]
    names = [each.get_text() for each in figure.axes[0].get_legend().get_texts()]
    assert names == list(runs)
    command = OperatorCommand.trapezoid(slew=0.5, luff=0.5, duration=9.0, length=12.0)
    figure = simulate(crane, command).plot()
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert labels == ["swing (deg)", "slew (deg)", "boom (deg)", "limits"]
    texts = [each.get_text() for ax in figure.axes for each in ax.texts]
    assert any("14 of 15 quantities of the crane are assumed" in each for each in texts)
    with pytest.raises(InputError, match="1 to 6 .* 0"):
        figures.plot_crane({})
