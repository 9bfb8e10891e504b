"""Figures of measured tests: pages of a campaign, a close look at an encoder or an ammeter."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swashplate import InputError
from swashplate.campaign import Channel, Encoder, Experiment, InputSignal, SignalOrigin
from swashplate.identification import motion_of
from swashplate.report.figures import plot_campaign, plot_channel

SOURCE = SignalOrigin(Path("run.csv"), "a column")
TIME = np.arange(513) / 64.0


VOLTS = np.where((TIME >= 1.0) & (TIME < 6.0), 4.0, 0.0)
COMMAND = InputSignal("voltage", "V", TIME, VOLTS, "previous", SOURCE)


def channel(kind: str = "shaft_speed", unit: str = "rad/s", **more) -> Channel:
    made = Channel("speed", kind, unit, TIME, np.sin(TIME), np.ones(TIME.size), SOURCE)
    return replace(made, **more)


def experiment(*channels: Channel, **more) -> Experiment:
    named = {each.name: each for each in channels or (channel(),)}
    made = Experiment("run1", "hoist", "run1", "fit", "rest", None, COMMAND, named, "step +4 V")
    return replace(made, **more)


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
    factors, signals = (1.0, 180.0 / np.pi, 1.0, 1e-5), (COMMAND, speed, current, pressure)
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


def test_marks_say_what_is_left_out_weighted_clipped_or_missing(assert_legible) -> None:
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
    assert_legible(figure)


@pytest.mark.slow
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
    with pytest.raises(InputError, match="one experiment"):
        plot_campaign([])


FINE = np.arange(1025) / 512.0


def encoder(time: np.ndarray = FINE, per_turn: float = 360.0) -> Channel:
    """An encoder on a shaft at 20 deg/s that starts at 0.5 s, a count a degree, read backwards."""
    scale = Encoder(per_turn, 1.0, -1, None)
    counts = -np.floor(20.0 * np.maximum(time - 0.5, 0.0) * per_turn / 360.0 + 0.5)
    values, own = counts * scale.angle_per_count, {"encoder": scale, "counts": counts}
    weight = np.ones(time.size)
    return Channel("counts", "encoder_counts", "rad", time, values, weight, SOURCE, **own)


def position(time: np.ndarray = FINE, noise: float | None = None) -> Channel:
    values = 0.01 * time
    weight = np.ones(time.size)
    return Channel("boom", "position", "m", time, values, weight, SOURCE, noise=noise)


@pytest.mark.slow
def test_a_position_and_its_speed(assert_legible: Callable[[Figure], None]) -> None:
    figure = plot_channel(encoder(), title="Counts of 1 degree")
    upper, lower = figure.axes
    raw = upper.lines[0].get_ydata()
    # 20 deg/s passes the edges of counts each 0.05 s, from 0.525 s on
    np.testing.assert_allclose(raw, np.floor(20.0 * np.maximum(FINE - 0.5, 0.0) + 0.5))
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("angle (deg)", "speed (deg/s)")
    (counts,) = upper.child_axes
    figure.draw_without_rendering()
    # read backwards: 20 degrees are as high as -20 counts
    height = upper.transData.transform((0.0, 20.0))[1]
    assert counts.transData.transform((0.0, -20.0))[1] == pytest.approx(height)
    # the filtered speed sets the scale, not the jumps of neighbours
    assert lower.get_ylim()[1] < 40.0 < np.nanmax(lower.lines[1].get_ydata())
    assert_legible(figure)


def test_a_channel_and_its_window(assert_legible: Callable[[Figure], None]) -> None:
    figure = plot_channel(position(), window=(0.5, 1.0))
    assert figure.axes[0].get_ylabel() == "position (mm)"
    assert figure.axes[1].get_xlim() == pytest.approx((0.5, 1.0))
    assert_legible(figure)
    with pytest.raises(InputError, match="0 samples .* run.csv"):
        plot_channel(position(), window=(5.0, 6.0))


def test_a_channel_against_what_a_drive_does(assert_legible: Callable[[Figure], None]) -> None:
    weight = np.ones(TIME.size)
    weight[-64:] = 0.0
    values = np.sin(TIME)
    spoilt = np.where(weight == 0.0, 50.0, values)
    figure = plot_channel(channel(values=spoilt, weight=weight), values - 0.02)
    upper, lower = figure.axes
    assert (upper.get_ylabel(), lower.get_ylabel()) == (
        "shaft speed (deg/s)",
        "measured less simulated (deg/s)",
    )
    shown = lower.lines[1].get_ydata()[:-64]
    np.testing.assert_allclose(shown, np.degrees(0.02), rtol=1e-9)
    # what is ignored is shaded and does not set the scale
    assert lower.get_ylim()[1] < np.degrees(1.1)
    assert "ignored" in labels(upper)
    assert_legible(figure)
    assert len(plot_channel(channel()).axes) == 1


def test_positions_in_metres_are_of_a_rod() -> None:
    assert motion_of([experiment(position()), experiment()]) == "rod"
    assert motion_of([experiment(encoder()), experiment(position())]) == "shaft"
    assert motion_of([experiment()]) == "shaft"
    assert motion_of([experiment(channel(unit="m/s"))]) == "rod"
