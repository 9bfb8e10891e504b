"""Figures of measured tests: pages of a campaign, a close look at an encoder or an ammeter."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swashplate import Drive, InputError, Simulation, maneuvers
from swashplate.campaign import Channel, Encoder, Experiment, InputSignal, Source
from swashplate.report.figures import plot_campaign, plot_current, plot_encoder

SOURCE = Source(Path("run.csv"), "a column")
TIME = np.arange(513) / 64.0


def command(time: np.ndarray = TIME, **entries) -> InputSignal:
    values = np.where((time >= 1.0) & (time < 6.0), 4.0, 0.0)
    return InputSignal(
        **{
            "kind": "voltage",
            "unit": "V",
            "time": time,
            "values": values,
            "interpolation": "previous",
            "source": SOURCE,
            **entries,
        }
    )


def channel(kind: str = "shaft_speed", unit: str = "rad/s", **entries) -> Channel:
    time = entries.pop("time", TIME)
    return Channel(
        **{
            "name": entries.pop("name", "speed"),
            "kind": kind,
            "unit": unit,
            "time": time,
            "values": np.sin(time),
            "weight": np.ones(time.size),
            "source": SOURCE,
            **entries,
        }
    )


def experiment(*channels: Channel, **entries) -> Experiment:
    return Experiment(
        **{
            "name": "run1",
            "axis": "hoist",
            "run": "run1",
            "role": "fit",
            "start": "rest",
            "start_pressure": None,
            "input": command(),
            "channels": {each.name: each for each in channels or (channel(),)},
            "stated_maneuver": "step +4 V",
            **entries,
        }
    )


def line(ax: Axes):
    """The line of the signal: the last one drawn over time."""
    return [each for each in ax.lines if len(each.get_xdata()) > 2][-1]


def labels(ax: Axes) -> set[str]:
    return {each.get_label() for each in (*ax.collections, *ax.lines)}


def headings(figure) -> list[str]:
    found = [text.get_text() for ax in figure.axes for text in ax.texts]
    return [f"{run} | {words}" for run, words in pairwise(found) if "  ·  " in words]


def words(figure: Figure) -> list[str]:
    """All words of legends."""
    boxes = [*figure.legends, *(ax.get_legend() for ax in figure.axes)]
    return [text.get_text() for box in boxes if box is not None for text in box.get_texts()]


def test_rows_are_runs_and_columns_signals_in_the_units_people_read() -> None:
    speed = channel()
    pressure = channel("stroker_pressure", "Pa", name="p", values=1e5 * TIME)
    current = channel("rectified_current", "A", name="ammeter", values=np.abs(np.sin(TIME)))
    (figure,) = plot_campaign([experiment(speed, current, pressure)], title="Trials")
    assert [ax.get_title("left").split("\n") for ax in figure.axes] == [
        ["input", "voltage (V)"],
        ["speed", "shaft speed (deg/s)"],
        ["ammeter", "rectified current (A)"],
        ["p", "stroker pressure (bar)"],
    ]
    factors, signals = (1.0, 180.0 / np.pi, 1.0, 1e-5), (command(), speed, current, pressure)
    for ax, signal, factor in zip(figure.axes, signals, factors, strict=True):
        np.testing.assert_array_equal(line(ax).get_xdata(), signal.time)
        np.testing.assert_allclose(line(ax).get_ydata(), factor * signal.values, rtol=1e-14)
    assert figure.get_suptitle() == "Trials: hoist"


def test_the_heading_says_what_run_it_is() -> None:
    late = np.r_[TIME[:100], TIME[100:] + 2.5]
    runs = [
        experiment(),
        experiment(channel(time=late), name="run2", run="run2", role="validate"),
    ]
    (figure,) = plot_campaign(runs)
    first, second = headings(figure)
    assert first == "run1 | step +4 V  ·  for the fit  ·  64 Hz"
    assert second.startswith("run2 | step +4 V  ·  for validation")
    assert "a gap of 2.52 s" in second


def test_marks_say_what_is_left_out_weighted_clipped_or_missing(
    assert_legible: Callable[[Figure], None],
) -> None:
    weight = np.ones(TIME.size)
    weight[100:200], weight[300:320] = 0.0, 10.0
    late = np.r_[TIME[:400], TIME[400:] + 1.0]
    speed = channel(weight=weight, limits=(-0.9, 0.9), time=late, values=np.sin(TIME))
    run = experiment(speed, ignored=((TIME[100], TIME[199], "valve stuck"),))
    (figure,) = plot_campaign([run])
    assert words(figure) == [
        "ignored: valve stuck",
        "weight, relative to the largest",
        "at the end of the instrument's range",
        "gap in the stamps",
    ]
    assert labels(figure.axes[1]) >= {"ignored", "weight", "clipped", "gap in the stamps"}
    assert "×10" in [text.get_text() for text in figure.axes[1].texts]
    assert_legible(figure)


def test_an_ignored_spike_leaves_the_scale_to_what_counts() -> None:
    values, weight = np.sin(TIME), np.ones(TIME.size)
    values[50], weight[50] = 99.0, 0.0
    (figure,) = plot_campaign([experiment(channel(values=values, weight=weight))])
    assert figure.axes[1].get_ylim()[1] < 2.0 * 180.0 / np.pi


def test_pages_of_eight_runs_and_axes_apart(assert_legible: Callable[[Figure], None]) -> None:
    runs = [experiment(name=f"r{k}", run=f"r{k}") for k in range(9)]
    runs.append(experiment(name="s", run="s", axis="slew"))
    pages = plot_campaign(runs, title="Trials")
    assert [page.get_suptitle() for page in pages] == [
        "Trials: hoist, page 1 of 2",
        "Trials: hoist, page 2 of 2",
        "Trials: slew",
    ]
    assert_legible(pages[0])
    with pytest.raises(InputError, match="at least one experiment"):
        plot_campaign([])


def test_a_channel_that_a_run_lacks_is_said() -> None:
    other = experiment(channel("swash_angle", "rad", name="swash"), name="b", run="b")
    (figure,) = plot_campaign([experiment(), other])
    assert sum("not measured" in [t.get_text() for t in ax.texts] for ax in figure.axes) == 2


FINE = np.arange(1025) / 512.0


def encoder(time: np.ndarray = FINE, per_turn: float = 360.0) -> Channel:
    """An encoder on a shaft at 20 deg/s that starts at 0.5 s, a count a degree, read backwards."""
    scale = Encoder(per_turn, 1.0, -1, None)
    counts = -np.floor(20.0 * np.maximum(time - 0.5, 0.0) * per_turn / 360.0 + 0.5)
    return Channel(
        name="counts",
        kind="encoder_counts",
        unit="rad",
        time=time,
        values=counts * scale.angle_per_count,
        weight=np.ones(time.size),
        source=SOURCE,
        encoder=scale,
        counts=counts,
    )


def position(time: np.ndarray = FINE, noise: float | None = None) -> Channel:
    values = 0.01 * time
    weight = np.ones(time.size)
    return Channel("boom", "position", "m", time, values, weight, SOURCE, noise=noise)


def drawn(ax: Axes) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {each.get_label(): each.get_data() for each in ax.lines}


def test_the_staircase_and_the_line_between_its_changes(
    assert_legible: Callable[[Figure], None],
) -> None:
    figure = plot_encoder(encoder(), title="Counts of 1 degree")
    upper, lower = figure.axes
    found = drawn(upper)
    # 20 deg/s passes the edges of counts each 0.05 s, from 0.525 s on
    np.testing.assert_allclose(found["raw"][1], np.floor(20.0 * np.maximum(FINE - 0.5, 0.0) + 0.5))
    between = (FINE > 0.6) & (FINE < 1.9)
    # a change shows in the next sample at the latest, and the line starts at a change
    expected = 20.0 * (FINE[between] - 0.5) + 0.5
    assert np.abs(found["interpolated"][1][between] - expected).max() < 20.0 * 1.5 / 512.0
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("angle (deg)", "speed (deg/s)")
    (counts,) = upper.child_axes
    figure.draw_without_rendering()
    # read backwards: 20 degrees are as high as -20 counts
    height = upper.transData.transform((0.0, 20.0))[1]
    assert counts.transData.transform((0.0, -20.0))[1] == pytest.approx(height)
    # the smooth speeds set the scale; how far the plain difference goes stands in the legend
    assert lower.get_ylim()[1] < 40.0
    assert any(each.startswith("plain difference, from ") for each in words(figure))
    assert_legible(figure)


def test_a_position_and_its_window(assert_legible: Callable[[Figure], None]) -> None:
    figure = plot_encoder(position(), window=(0.5, 1.0))
    assert figure.axes[0].get_ylabel() == "position (mm)"
    assert figure.axes[1].get_xlim() == pytest.approx((0.5, 1.0))
    assert_legible(figure)
    with pytest.raises(InputError, match="holds 0 samples of run.csv"):
        plot_encoder(position(), window=(5.0, 6.0))
    with pytest.raises(InputError, match="shows an encoder or a position"):
        plot_encoder(channel())


@pytest.fixture(scope="module")
def sine(hoist: Drive) -> Simulation:
    return hoist.simulate(maneuvers.sine(6.5, 0.1).sample())


def ammeter(run: Simulation, error: float = 0.0, **entries) -> Channel:
    """The ammeter of a run, off by an error."""
    values = run.current_positive + run.current_negative + error
    entries = {"name": "current", "time": run.time, "values": values, **entries}
    weight = np.ones(run.time.size)
    return channel("rectified_current", "A", **{"weight": weight, **entries})


def test_a_current_against_the_simulated_one(
    sine: Simulation, assert_legible: Callable[[Figure], None]
) -> None:
    weight = np.ones(sine.time.size)
    weight[-512:] = 0.0
    figure = plot_current(ammeter(sine, 0.02, weight=weight), sine)
    upper, lower = figure.axes
    assert upper.get_ylabel() == "|I₊| + |I₋| (A)"
    assert lower.get_ylabel() == "difference (mA)"
    _, y = drawn(lower)["counted"]
    np.testing.assert_allclose(y[np.isfinite(y)], 20.0, rtol=1e-9)
    assert labels(upper) >= {"ignored", "masked", "measured", "simulated"}
    # each zero crossing of the signed current lies in a mask
    crossings = np.flatnonzero(np.diff(np.sign(sine.current[np.abs(sine.current) > 0.05])))
    masks = [each for each in upper.collections if each.get_label() == "masked"]
    assert sum(len(each.get_paths()) for each in masks) >= crossings.size
    assert "RMS 20 mA outside of what is shaded" in lower.texts[0].get_text()
    assert_legible(figure)
    with pytest.raises(InputError, match="this figure compares a rectified_current"):
        plot_current(channel(), sine)
    with pytest.raises(InputError, match="choose one that holds two"):
        plot_current(ammeter(sine), sine, window=(50.0, 60.0))
