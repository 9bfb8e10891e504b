"""Each figure of the source is there, with curves that hit Kruse's numbers."""

import re

import numpy as np
import pytest
from reproduction.build import ALL, reproduce
from reproduction.catalogue import FIGURES
from reproduction.content import Curve, Diagram, Figure, Reproduction
from reproduction.errata import ERRATA

from swashplate import Drive, InputError, maneuvers


@pytest.fixture
def captions(source_text: str) -> dict[str, str]:
    return dict(re.findall(r"^FIGURE (\d+\.\d+) (.+)$", source_text, re.MULTILINE))


def curves(figure: Figure) -> dict[str, Curve]:
    assert not isinstance(figure.content, Diagram)
    return {curve.name: curve for panel in figure.content for curve in panel.curves}


def by_number(reproduction: Reproduction) -> dict[str, Figure]:
    return {each.number: each for each in reproduction.figures}


def test_every_figure_of_the_chapters_is_in_the_catalogue(captions: dict[str, str]) -> None:
    wanted = [number for number in captions if number[0] in "47"] + ["9.1"]
    assert [each.number for each in FIGURES] == wanted
    assert len(wanted) == 46


def test_each_shows_the_log_and_the_maneuver_of_its_caption(captions: dict[str, str]) -> None:
    for shown in FIGURES:
        caption = captions[shown.number]
        assert re.findall(r"\w+\.dat", shown.logs) == re.findall(r"\w+\.dat", caption)
        numbers = re.search(r", ?(\d[\d.]*) ?V/sec Ramp|([\d.]+)V,? ", caption)
        if numbers and len(shown.tests) == 1:
            volts = float(numbers[1] or numbers[2])
            assert float(re.findall(r"[\d.]+", shown.tests[0])[0]) == volts
        hertz = re.search(r"([\d.]+)Hz", caption)
        if hertz:
            assert shown.tests[0].endswith(f" {hertz[1]} Hz")


def test_figure_9_1_reaches_the_stated_speeds(small: Reproduction) -> None:
    figure = by_number(small)["9.1"]
    speed = curves(figure)["orifice and flow × 1.5"].values
    assert speed.max() == pytest.approx(294.0, abs=0.5)
    assert speed.min() == pytest.approx(-277.5, abs=0.5)
    before = curves(figure)["published set"].values
    assert (before.max(), before.min()) == pytest.approx((196.0, -185.0), abs=0.05)
    assert "+294 and −277 deg/s" in figure.caption


def test_an_axis_names_all_that_is_drawn_on_it(small: Reproduction) -> None:
    """A scaled command stands on another quantity's axis, whose label says so."""
    scaled = 0
    for figure in small.figures:
        for panel in () if isinstance(figure.content, Diagram) else figure.content:
            for words in (c.name for c in panel.curves if c.name.startswith("voltage")):
                assert panel.ordinate.endswith(f",\n{words}"), figure.number
                scaled += 1
    assert scaled > 3


def test_the_source_s_filters_delay_the_speed() -> None:
    """1/a + 1/b = 21.2 ms, half a sample less or more: figure 7.6 against the plain simulation."""
    (figure,) = reproduce(only=["figure 7.6"]).figures
    shown = curves(figure)["simulated"]
    plain = np.degrees(Drive.preset("hoist").simulate(maneuvers.step(4.0).sample()).shaft_speed)
    late = np.interp(60.0, shown.values[:1200], shown.time[:1200]) - np.interp(
        60.0, plain[:1200], shown.time[:1200]
    )
    assert late == pytest.approx(0.0212, abs=0.0015)


def test_inside_figures_show_the_chain_and_its_limits(small: Reproduction) -> None:
    figure = by_number(small)["7.14"]
    assert len(figure.content) == 6
    inside = curves(figure)
    assert inside["swash plate"].values.max() == pytest.approx(np.degrees(0.27596))
    assert inside["effective opening"].values.min() == pytest.approx(-0.15126)
    levels = [level.height for panel in figure.content for level in panel.levels]
    assert levels == pytest.approx([0.11634, -0.15126, np.degrees(0.27596), -np.degrees(0.26047)])


def test_rexroth_figures_are_the_plain_luff_drive(small: Reproduction) -> None:
    figure = by_number(small)["7.28"]
    assert list(curves(figure)) == ["ramp +1 V/s", "step +4 V", "step +6.5 V", "step +9 V"]
    speed = curves(figure)["step +9 V"]
    settled = np.degrees(Drive.preset("luff").steady_speed(9.0))
    assert np.interp(5.9, speed.time, speed.values) == pytest.approx(settled, rel=1e-3)
    assert not figure.virtual


@pytest.mark.slow
def test_all_curves_are_finite_and_all_errata_known(everything: Reproduction) -> None:
    assert [each.number for each in everything.figures] == [each.number for each in FIGURES]
    for figure in everything.figures:
        assert set(figure.errata) <= set(ERRATA)
        assert figure.title
        assert figure.caption
        if isinstance(figure.content, Diagram):
            keys = {node.key for node in figure.content.nodes}
            assert all({arrow.start, arrow.end} <= keys for arrow in figure.content.arrows)
            continue
        for panel in figure.content:
            for curve in panel.curves:
                assert curve.time.shape == curve.values.shape
                assert np.isfinite(curve.values).all()
                assert (np.diff(curve.time) > 0.0).all()
    virtual = {each.number for each in everything.figures if each.virtual}
    assert virtual == {"7.2", *(f"7.{number}" for number in range(21, 28))}


def test_an_unknown_part_is_one_sentence() -> None:
    with pytest.raises(InputError, match=r"figure 4\.99 .* there are "):
        reproduce(only=["figure 4.99"])
    with pytest.raises(InputError, match=r"seed .* -1"):
        reproduce(seed=-1, only=[])
    assert len(ALL) == 46 + 15
