"""Figures: lines that lose no extreme, what each shows in which units, files written whole."""

import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Annotated, NamedTuple
from xml.etree import ElementTree

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from tests.marks import rest_slow

from swashplate import Drive, FileError, FullOrderDrive, InputError, Limit, Simulation, maneuvers
from swashplate.analysis import (
    Draws,
    Trial,
    bands,
    envelope,
    improvement,
    inverse_map,
    limit_shares,
    one_at_a_time,
    trial_of,
    what_if,
)
from swashplate.full_order import compare
from swashplate.identification import Band
from swashplate.machine import Definition, Machine, Model, Run, discretised, equation, simulate
from swashplate.report import figures
from swashplate.report.figures import plot_simulation, save_figure
from swashplate.report.lines import COLUMNS, MOST_SPANS, SHADES, draw, gap_rows, thinned
from swashplate.report.style import BLUE, dress, handle, sheet
from swashplate.units import shown_in

GAP = 0.1


@pytest.mark.slow
@given(
    st.lists(st.integers(-5, 5), min_size=25, max_size=150),
    st.lists(st.sampled_from([1.0, 1.3, 20.0]), min_size=150, max_size=150),
    st.integers(3, 12),
)
def test_no_extreme_is_lost_on_either_side_of_a_gap(values, steps, columns) -> None:
    heights = np.array(values, dtype=float)
    time = np.cumsum(steps)[: heights.size]
    gaps = gap_rows(time)
    rows = thinned(time, heights, gaps, columns)
    assert (np.diff(rows) > 0).all()
    kept = np.isin(np.arange(time.size), rows)
    assert kept[[0, -1, *gaps, *(gaps + 1)]].all()
    # of each column and each piece between gaps: two extremes, two ends
    assert rows.size <= 2 * (columns + 1) + 4 * (gaps.size + 1)
    if heights.size <= 2 * columns:
        assert kept.all()
    # what is left out lies between two that are kept, less than a column away in its piece
    piece = np.searchsorted(gaps, np.arange(time.size))
    width = (time[-1] - time[0]) / columns
    for k in np.flatnonzero(~kept):
        near = kept & (np.abs(time - time[k]) < width) & (piece == piece[k])
        assert heights[near].min() <= heights[k] <= heights[near].max()


def test_a_line_is_broken_where_samples_are_missing_and_a_lonely_one_is_a_dot() -> None:
    ax = Figure().subplots()
    time = np.array([0.0, 1.0, 2.0, 9.1, 15.0, 16.0])  # two steps of more than 5 s
    draw(ax, time, time, "k", zero_order=True)
    line, dots = ax.lines
    stamps, heights = line.get_data()
    np.testing.assert_array_equal(stamps, [0.0, 1.0, 2.0, 2.0, 9.1, 9.1, 15.0, 16.0])
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(heights)), [3, 5])
    assert line.get_drawstyle() == "steps-post"
    assert [each.tolist() for each in dots.get_data()] == [[9.1], [9.1]]


SIGNATURES = {".PNG": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


@pytest.mark.parametrize("suffix", rest_slow([*SIGNATURES]))
def test_a_figure_is_written_whole_and_the_same_each_time(step, tmp_path, suffix) -> None:
    first, second = tmp_path / f"first{suffix}", tmp_path / f"second{suffix}"
    save_figure(plot_simulation(step), first)
    save_figure(plot_simulation(step), str(second))
    content = first.read_bytes()
    assert content.startswith(SIGNATURES[suffix])
    assert content == second.read_bytes()
    assert not any(word in content for word in (b"<dc:date>", b"/CreationDate", b"tEXtCreation"))
    assert sorted(tmp_path.iterdir()) == [first, second]


@pytest.mark.parametrize("name", ["figure.jpg", "figure", "figure.svgz"])
def test_a_figure_of_another_ending_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError, match=r"\.png, \.svg or \.pdf"):
        save_figure(Figure(), tmp_path / name)


@pytest.mark.slow
def test_plotting_touches_no_global_state() -> None:
    code = """
import sys
import matplotlib
from swashplate import Drive
from swashplate.report import figures

settings = [name for name in matplotlib.rcParams if name != "backend"]  # asking for it loads one
before = {name: matplotlib.rcParams[name] for name in settings}
figures.plot_simulation(Drive.preset("hoist").simulate([0.0, 1.0]))
assert "matplotlib.pyplot" not in sys.modules
assert {name: matplotlib.rcParams[name] for name in settings} == before
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("format", ["svg", "png"])
def test_names_are_drawn_as_they_are(tmp_path: Path, format: str) -> None:
    """A dollar in a name is no formula, and a control character no part of an SVG."""
    figure, (ax,) = sheet([1.0], "$\\frac{1}{$ <b>\x1b]0;x\x07 ${1}", legend=[handle("a$b$", BLUE)])
    dress(ax, "speed $\\x$ (V)", "$t")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_figure(figure, tmp_path / f"a.{format}")
    if format == "svg":
        ElementTree.parse(tmp_path / "a.svg")


VARIABLES = ("orifice", "pump", "relief")
DEGREE = 180.0 / np.pi


@pytest.fixture(scope="module")
def task(hoist: Drive) -> Trial:
    return trial_of(hoist, maneuvers.step(9.0, stop=4.0, length=5.0).sample())


@pytest.fixture(scope="module")
def made(hoist: Drive, step: Simulation, all_limits: Simulation, task: Trial) -> dict[str, Figure]:
    """Every figure of a simulation or an analysis, by its name."""
    luff, neutral = Drive.preset("luff"), Drive.preset("neutral")
    pumps = 12.396 + 0.2 * np.random.default_rng(0).normal(size=30)
    drawn = Draws(tuple(hoist.replace(Z10=each) for each in pumps), 0)
    band = bands(drawn, task)
    changed = what_if(hoist, {"orifice": 1.5, "pump": 1.5}, task)
    outcomes = ("final_speed", "rise_time", "overshoot")
    one = one_at_a_time(hoist, dict.fromkeys(VARIABLES, (0.9, 1.1)), task, outcomes=outcomes)
    inverse = inverse_map(luff)
    reference = 0.5 * np.sin(task.time)
    current = hoist.simulate_current(0.5 * np.sin(np.arange(2000) / 300.0))
    loaded = FullOrderDrive.preset("hoist").replace(load_torque=2e3)
    both = compare(loaded, loaded.drive.simulate(maneuvers.step(9.0, length=8.0).sample()))
    response = hoist.frequency_response(np.geomspace(0.05, 5.0, 12), [1.0, 9.0])
    return {
        "simulation": figures.plot_simulation(step),
        "one sample": figures.plot_simulation(hoist.simulate([0.0])),
        "all limits": figures.plot_simulation(all_limits),
        "by current": figures.plot_simulation(current),
        "neutral": figures.plot_simulation(neutral.simulate(maneuvers.step(0.8).sample())),
        "full order": figures.plot_full_order(both),
        "comparison": figures.plot_comparison({"hoist": step, "by current": current}),
        "envelope": figures.plot_envelope(envelope(hoist)),
        "timeline": figures.plot_limit_timeline(all_limits),
        "whatif": figures.plot_whatif(changed, bands={"as it is": band}),
        "tornado": figures.plot_tornado(one),
        "map": figures.plot_compensation(inverse),
        "improvement": figures.plot_compensation(inverse, improvement(luff, reference)),
        "bode": figures.plot_bode(response, linear=hoist.linearize(4.0)),
    }


@pytest.mark.slow
def test_everything_can_be_read(made, assert_legible) -> None:
    for figure in made.values():
        assert_legible(figure)


def labels(figure: Figure) -> list[str]:
    return [ax.get_ylabel().replace("\n", " ") for ax in figure.axes]


def lines(figure: Figure, panel: int) -> list[np.ndarray]:
    """Curves of a panel, without the levels that it marks."""
    return [
        np.asarray(line.get_ydata())
        for line in figure.axes[panel].lines
        if len(line.get_xdata()) > 2
    ]


def legend(figure: Figure) -> list[str]:
    found = figure.axes[0].get_legend()
    return [] if found is None else [text.get_text() for text in found.get_texts()]


def shades(figure: Figure, panel: int) -> dict[str, np.ndarray]:
    """Beginning and end of each shaded stretch, by its name."""
    return {
        each.get_label(): np.array([path.vertices[[0, 1], 0] for path in each.get_paths()])
        for each in figure.axes[panel].collections
        if not each.get_label().startswith("_")
    }


@pytest.mark.slow
def test_the_chain_from_command_to_speed(made: dict[str, Figure], step: Simulation) -> None:
    expected = {
        "voltage (V)": [step.voltage],
        "current (A)": [step.current_positive, step.current_negative],
        "spool (mm)": [1e3 * step.spool_position, 1e3 * step.orifice_opening],
        "stroking pressure (bar)": [1e-5 * step.stroker_pressure],
        "swash angle (deg)": [DEGREE * step.swash_angle],
        "shaft speed (deg/s)": [DEGREE * step.shaft_speed],
    }
    figure = made["simulation"]
    assert labels(figure) == list(expected)
    for panel, signals in enumerate(expected.values()):
        for drawn, signal in zip(lines(figure, panel), signals, strict=True):
            np.testing.assert_allclose(drawn, signal, rtol=1e-12)
    assert labels(made["by current"])[0] == "current (A)"


@pytest.mark.slow
def test_units_of_choice_hold_for_figures(step: Simulation) -> None:
    with shown_in(["rpm", "kPa"]):
        figure = figures.plot_simulation(step)
    assert labels(figure)[3::2] == ["stroking pressure (kPa)", "shaft speed (rpm)"]
    np.testing.assert_allclose(lines(figure, 5)[0], 30.0 / np.pi * step.shaft_speed, rtol=1e-12)
    assert labels(figures.plot_simulation(step))[5] == "shaft speed (deg/s)"


@pytest.mark.slow
def test_every_limit_is_shaded_where_it_acts(made, all_limits: Simulation) -> None:
    figure, time = made["all limits"], all_limits.time
    panels = {Limit.DEAD_ZONE: [1], Limit.CURRENT_RATE: [1], Limit.ORIFICE: [2], Limit.SPOOL: [2]}
    panels |= {Limit.RELIEF: [3], Limit.SWASH_STOP: [4, 5]}
    for limit, at in panels.items():
        name = SHADES[limit].name
        assert [panel for panel in range(6) if name in shades(figure, panel)] == at
        spans = shades(figure, at[0])[name]
        inside = ((time[:, None] >= spans[:, 0]) & (time[:, None] <= spans[:, 1])).any(axis=1)
        np.testing.assert_array_equal(inside, all_limits.active(limit))
    assert legend(figure) == [shade.name for shade in SHADES.values()]


def test_orifices_and_stops_are_marked_where_the_signal_comes_near(hoist: Drive) -> None:
    figure = figures.plot_simulation(hoist.simulate(maneuvers.sine(9.0, 0.1).sample()))

    def levels(panel: int, of: Figure) -> list[float]:
        return [
            float(line.get_ydata()[0])
            for line in of.axes[panel].lines
            if len(line.get_xdata()) == 2 and line.get_linestyle() == "--"
        ]

    assert levels(2, figure) == pytest.approx([0.11634, -0.15126])
    assert levels(4, figure) == pytest.approx(np.degrees([0.27596, -0.26047]))
    low = figures.plot_simulation(hoist.simulate(maneuvers.step(0.8).sample()))
    assert levels(4, low) == []


@pytest.mark.slow
def test_a_long_run_is_drawn_by_few_points_and_few_spans(hoist: Drive) -> None:
    time = np.arange(900 * 512) / 512.0
    run = hoist.simulate(8.0 * np.sin(0.2 * time) + 1.5 * np.sin(20.0 * time))
    figure = figures.plot_simulation(run)
    for panel, ax in enumerate(figure.axes):
        assert max(len(line.get_xdata()) for line in ax.lines) <= 2 * COLUMNS + 4
        assert all(len(spans) <= MOST_SPANS for spans in shades(figure, panel).values())
    assert lines(figure, 5)[0].max() == pytest.approx(DEGREE * run.shaft_speed.max())


def test_a_comparison_shows_what_differs(step: Simulation, hoist: Drive) -> None:
    faster = hoist.scale(Z10=1.5).simulate(step.voltage)
    figure = figures.plot_comparison({"hoist": step, "faster": faster}, title="both")
    assert legend(figure) == ["hoist", "faster"]
    (difference,) = lines(figure, 2)
    expected = DEGREE * (faster.shaft_speed - step.shaft_speed)
    np.testing.assert_allclose(difference, expected, atol=1e-9)
    with pytest.raises(InputError, match="one simulation"):
        figures.plot_comparison({})


def test_the_timeline_has_a_row_for_each_limit(made, all_limits) -> None:
    rows = made["timeline"].axes[2]
    names = [label.get_text() for label in rows.get_yticklabels()]
    assert names == [shade.name for shade in SHADES.values()]
    share = 100.0 * np.mean(all_limits.active(Limit.ORIFICE))
    assert f"{share:.1f} %" in [text.get_text() for text in rows.texts]
    with pytest.raises(InputError, match="the run has"):
        figures.plot_limit_timeline(all_limits, reference=[0.0])


def test_the_timeline_and_the_table_agree_on_the_dead_zone(hoist: Drive, step: Simulation) -> None:
    """At rest nothing is asked that the dead zone could hold back."""
    table = limit_shares(hoist, step["voltage"]).table().of("t")
    (share,) = [table.texts(row)[1] for row in table.rows if row.cells[0] == "dead zone"]
    rows = figures.plot_limit_timeline(step).axes[2]
    names = [label.get_text() for label in rows.get_yticklabels()]
    assert rows.texts[names.index(SHADES[Limit.DEAD_ZONE].name)].get_text() == share
    assert 100.0 * step.active(Limit.DEAD_ZONE).mean() > 10.0 > float(share.split()[0])


def test_speeds_before_and_after(made: dict[str, Figure]) -> None:
    figure = made["whatif"]
    tops = sorted(float(each.max()) for each in lines(figure, 1))
    assert tops[-1] == pytest.approx(294.0, abs=0.05)
    names = ["as it is", "orifice x 1.5", "pump x 1.5", "changed", "reference"]
    assert legend(figure) == names
    assert labels(figure)[3] == "about the median (deg/s)"


def test_the_strongest_lever_is_at_the_top(made: dict[str, Figure]) -> None:
    speed, rise, still = made["tornado"].axes[:3]
    assert speed.get_yticklabels()[-1].get_text() == "pump"
    assert rise.get_yticklabels()[-1].get_text() == "orifice"
    ends = sorted(bar.get_x() + bar.get_width() for bar in speed.patches)
    assert (ends[0], ends[-1]) == pytest.approx((176.4, 215.6), abs=0.05)
    for ax in (speed, rise, still):
        # the number in a panel's heading is where its bars begin, in the unit of its axis
        outcome, number = ax.get_title("left").split(", ")
        assert ax.get_xlabel() == f"{outcome} ({number.split()[1]})"
        base = ax.lines[-1].get_xdata()[0]
        assert float(number.split()[0]) == pytest.approx(base, abs=0.005)
    assert "no design variable changes it" in [text.get_text() for text in still.texts]


def test_lines_of_a_sweep_are_the_response(made: dict[str, Figure], hoist: Drive) -> None:
    figure = made["bode"]
    assert labels(figure) == ["gain ((deg/s)/V)", "phase (deg)", "distortion (%)"]
    swept = hoist.frequency_response(np.geomspace(0.05, 5.0, 12), [1.0, 9.0])
    for row in range(2):
        there = swept.has_motion[row]
        expected = DEGREE * swept.gain[row]
        np.testing.assert_allclose(lines(figure, 0)[row][there], expected[there])
    assert legend(figure) == ["1 V", "9 V", "small motions about 4 V"]
    assert not swept.has_motion.all()
    assert "\n".join(swept.sentences_on_no_motion()) in [
        text.get_text() for text in figure.axes[0].texts
    ]
    by_current = hoist.linearize(current=0.5)
    with pytest.raises(InputError, match="voltage to shaft_speed"):
        figures.plot_bode(swept, linear=by_current)


# --- a user-defined model -------------------------------------------------------------------------


class Masses(NamedTuple):
    stiffness: float = 40.0


class Motion(NamedTuple):
    position: Annotated[float, Definition("position of the first mass", "m", lower=-5.0)]
    speed: Annotated[float, Definition("speed", "m/s", lower=-2.0, upper=2.0)]
    current: float  # not the current of a drive, whose unit it must not get
    speed_2: float


class Signals(NamedTuple):
    pressure: Annotated[float, Definition("chamber pressure", "Pa", lower=0.0, upper=21e6)]
    temperature: Annotated[float, Definition("oil temperature", "K")]
    spring: float


class Acting(NamedTuple):
    relief: bool
    cavitation: bool


Force = Annotated[float, Definition("force", "N", upper=1e4)]


@equation
def spring(state: Motion, p: Masses) -> float:
    return p.stiffness * (state.position - state.current)


@equation
def chamber(state: Motion, p: Masses) -> Signals:
    force = spring(state, p)
    return Signals(5e6 + 4e6 * force, 320.0 + state.position, force)


@equation
def masses(state: Motion, force: Force, p: Masses) -> Motion:
    pull = spring(state, p)
    return Motion(state.speed, force - pull - state.speed, state.speed_2, pull - state.speed_2)


@equation
def acting(signals: Signals) -> Acting:
    return Acting(signals.pressure > 12e6, signals.pressure < 0.0)


SHAKER = Model(
    "shaker", Masses, Motion, discretised(masses, "midpoint"), sample=chamber, limits=acting
)


def shaken(**changes: object) -> Run:
    command = maneuvers.sine(5.0, 0.4)
    return simulate(Machine(replace(SHAKER, **changes), Masses()), {"force": command}, 100.0)


def levels(ax: Axes) -> list[float]:
    """Where a panel marks limits."""
    return [float(line.get_ydata()[0]) for line in ax.lines if line.get_linestyle() == "--"]


@pytest.mark.slow
def test_a_user_defined_model_is_shown_with_what_it_declares(assert_legible) -> None:
    run = shaken()
    figure = run.plot()
    assert_legible(figure)
    assert figure.get_suptitle() == "shaker: sine 5 V 0.4 Hz"
    # outputs on the left, states on the right; what declares nothing has its name
    left, right = figure.axes[::2], figure.axes[1::2]
    assert left[0].get_position().x1 < right[0].get_position().x0
    assert labels(figure)[::2] == [
        "force (N)",
        "chamber pressure (bar)",
        "oil temperature (K)",
        "spring",
    ]
    assert labels(figure)[1::2] == [
        "position of the first mass (mm)",
        "speed (mm/s)",
        "current",
        "speed 2",
    ]
    assert [ax.get_xlabel() for ax in left] == ["", "", "", "time (s)"]
    assert [ax.get_xlabel() for ax in right] == ["", "", "", "time (s)"]
    np.testing.assert_allclose(lines(figure, 2)[0], 1e-5 * run["pressure"])
    # limits that signals come near to, and stretches in which one acts
    assert levels(left[0]) == []
    assert levels(left[1]) == pytest.approx([0.0, 210.0])
    assert levels(right[1]) == pytest.approx([-2000.0, 2000.0])
    shown = {text.get_text() for text in left[0].get_legend().get_texts()}
    assert (
        shown
        == {name for name in run.limit_names if run.active(name).any()}
        == {
            "relief",
            "cavitation",
        }
    )
    # far from zero, an ordinate does not begin there
    assert left[2].get_ylim()[0] > 300.0


def test_few_signals_of_a_user_defined_model_stand_in_one_column(assert_legible) -> None:
    run = shaken(outputs=("pressure", "position"))
    figure = run.plot(window=(2.0, 6.0), title="Shaker test")
    assert_legible(figure)
    assert figure.get_suptitle() == "Shaker test"
    assert [label.split(" (")[0] for label in labels(figure)] == [
        "force",
        "chamber pressure",
        "position of the first mass",
    ]
    assert figure.axes[-1].get_xlim() == (2.0, 6.0)
    ax = Figure().subplots()
    assert run.plot("pressure", ax=ax, title="here") is ax
    assert (ax.get_ylabel(), ax.get_xlabel()) == ("chamber pressure (bar)", "time (s)")
    # a column of a table has a name, too, but is not a maneuver
    column = pl.Series("force", run["force"])
    again = simulate(Machine(SHAKER, Masses()), {"force": column}, 100.0)
    assert again.title == "shaker"
    np.testing.assert_array_equal(again["pressure"], run["pressure"])


def test_a_model_whose_types_only_a_function_knows_is_shown_by_its_names() -> None:
    class Gain(NamedTuple):
        gain: float

    class Level(NamedTuple):
        level: float

    @equation
    def filled(state: "Level", inflow: "float", p: "Gain", h: float) -> "Level":
        return Level(state.level + h * p.gain * inflow)

    tank = Model("tank", Gain, Level, filled)
    figure = simulate(Machine(tank, Gain(2.0)), {"inflow": np.ones(9)}, 10.0).plot()
    assert labels(figure) == ["inflow", "level"]


def test_a_band_lies_about_the_speed() -> None:
    """Drawn from its lower to its upper end, and named in the legend."""
    run = Drive.preset("hoist").simulate(maneuvers.step(4.0))
    half_width = np.linspace(0.0, 0.5, run.time.size)
    band = Band(run.time, run.shaft_speed, half_width, 10.0)
    figure = plot_simulation(run, band=band)
    speed = figure.axes[-1]
    (drawn,) = speed.collections
    heights = drawn.get_paths()[0].vertices[:, 1]
    ends = np.degrees([band.lower, band.upper])
    assert heights.min() == pytest.approx(ends.min())
    assert heights.max() == pytest.approx(ends.max())
    low, high = speed.get_ylim()
    assert low < ends.min() < ends.max() < high
    assert "band of 95 %" in [text.get_text() for text in figure.findobj(Text)]
