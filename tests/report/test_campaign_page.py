from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.offsetbox import TextArea

from swashplate import InputError
from swashplate.campaign import Channel, Encoder, Experiment, InputSignal, Source
from swashplate.report.figures import plot_campaign
from swashplate.report.style import BLUE, INK

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
    found = [area.get_text() for ax in figure.axes for area in ax.findobj(TextArea)]
    return [f"{run} | {words}" for run, words in zip(found[::2], found[1::2], strict=True)]


def test_rows_are_runs_and_columns_signals_in_the_units_people_read() -> None:
    speed = channel()
    pressure = channel("stroker_pressure", "Pa", name="p", values=1e5 * TIME)
    current = channel("rectified_current", "A", name="ammeter", values=np.abs(np.sin(TIME)))
    angle = channel("swash_angle", "rad", name="swash")
    (figure,) = plot_campaign([experiment(speed, current, pressure, angle)], title="Trials")
    axes = figure.axes
    heads = [[text.get_text() for text in ax.texts[:2]] for ax in axes]
    assert heads == [
        ["input", "voltage (V)"],
        ["speed", "shaft speed (deg/s)"],
        ["ammeter", "rectified current (A)"],
        ["p", "stroker pressure (bar)"],
        ["swash", "swash angle (deg)"],
    ]
    degree = 180.0 / np.pi
    factors = (1.0, degree, 1.0, 1e-5, degree)
    signals = (command(), speed, current, pressure, angle)
    for ax, signal, factor in zip(axes, signals, factors, strict=True):
        np.testing.assert_array_equal(line(ax).get_xdata(), signal.time)
        np.testing.assert_allclose(line(ax).get_ydata(), factor * signal.values, rtol=1e-14)
    assert figure.texts[0].get_text() == "Trials: hoist"
    assert [ax.get_xlabel() for ax in axes] == ["time (s)"] * 5


def test_the_heading_says_what_run_it_is() -> None:
    slow = channel(time=TIME[::4])
    late = np.r_[TIME[:100], TIME[100:] + 2.5]
    runs = [
        experiment(),
        experiment(slow, run="run2", role="validate"),
        experiment(run="run3", input=command(late)),
        experiment(
            slow,
            channel(name="b", time=TIME[::64]),
            channel(name="jitter", time=TIME + 1e-5 * np.sin(37.0 * TIME)),
            run="run4",
        ),
    ]
    (figure,) = plot_campaign(runs)
    assert headings(figure) == [
        "run1 | step +4 V  ·  for the fit  ·  64 Hz",
        "run2 | step +4 V  ·  for validation  ·  input 64 Hz  ·  speed 16 Hz",
        "run3 | step +4 V  ·  for the fit  ·  64 Hz  ·  a gap of 2.52 s",
        "run4 | step +4 V  ·  for the fit  ·  1 to 64 Hz",
    ]


def test_a_line_is_open_at_a_gap_which_is_pointed_at() -> None:
    time = np.r_[TIME[:100], TIME[150:]]
    (figure,) = plot_campaign([experiment(channel(time=time), input=command(time))])
    for ax in figure.axes:
        x, y = (np.asarray(data, dtype=float) for data in line(ax).get_data())
        assert np.flatnonzero(np.isnan(y)).tolist() == [100]
        assert x[99] == x[100] == time[99]
        assert x[101] == time[100]
        (pointer,) = (each for each in ax.lines if each.get_label() == "gap")
        np.testing.assert_allclose(pointer.get_xdata(), [0.5 * (time[99] + time[100])])
    assert "gap in the stamps" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_what_is_ignored_is_shaded_on_the_input_and_where_a_channel_has_no_weight() -> None:
    weight = np.where(TIME <= 0.78, 0.0, 1.0)
    weight[(TIME >= 3.0) & (TIME <= 4.0)] = 0.0
    run = experiment(channel(weight=weight), ignored=((-np.inf, 0.78, "plussing transient"),))
    (figure,) = plot_campaign([run])
    on_input, on_channel = (
        [path.vertices[:, 0] for path in shading.get_paths()]
        for ax in figure.axes
        for shading in ax.collections
        if shading.get_label() == "ignored"
    )
    assert [(x.min(), x.max()) for x in on_input] == [(0.0, 0.78)]
    half = 0.5 / 64.0
    assert [(x.min(), x.max()) for x in on_channel] == [
        (-half, 49 / 64.0 + half),
        (3.0 - half, 4.0 + half),
    ]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "ignored: plussing transient"
    ]


def test_weights_clipping_and_a_plain_channel_are_marked_each_for_itself() -> None:
    weight = np.ones(TIME.size)
    weight[64:80] = 10.0
    weighted = channel(name="weighted", weight=weight)
    clipped = channel(name="clipped", values=np.minimum(np.sin(TIME), 0.5), limits=(-2.0, 0.5))
    (figure,) = plot_campaign([experiment(weighted, clipped, channel())])
    _, on_weighted, on_clipped, plain = figure.axes
    assert "weight" in labels(on_weighted)
    assert "×10" in [text.get_text() for text in on_weighted.texts]
    assert "clipped" in labels(on_clipped)
    bars = next(each for each in on_clipped.collections if each.get_label() == "clipped")
    levels = np.concatenate([segment[:, 1] for segment in bars.get_segments()])
    np.testing.assert_allclose(levels, 0.5 * 180.0 / np.pi)
    assert not labels(plain) & {"weight", "clipped", "ignored", "gap"}


def test_a_column_has_one_scale_and_positions_have_it_about_their_own_middle() -> None:
    runs = [
        experiment(
            channel(values=size * np.sin(TIME)), channel("position", "m", name="x", values=x)
        )
        for size, x in ((1.0, 0.1 * TIME), (0.1, 5.0 + 0.01 * TIME))
    ]
    (figure,) = plot_campaign(runs)
    first, second = figure.axes[:3], figure.axes[3:]
    assert first[0].get_ylim() == second[0].get_ylim()
    assert first[1].get_ylim() == second[1].get_ylim()
    (low, high), (other_low, other_high) = first[2].get_ylim(), second[2].get_ylim()
    assert high - low == pytest.approx(other_high - other_low)
    # millimetres: half of 0 to 0.8 m, and 5 m and half of 0 to 0.08 m
    assert 0.5 * (low + high) == pytest.approx(400.0)
    assert 0.5 * (other_low + other_high) == pytest.approx(5040.0)


def test_encoders_are_angles_and_others_are_called_as_in_the_log() -> None:
    encoder = Encoder(2526.3, 1.0, 1, None)
    counts = channel(
        "encoder_counts", "rad", name="counts", encoder=encoder, counts=np.floor(100.0 * TIME)
    )
    other = channel("other", "%", name="duty")
    (figure,) = plot_campaign([experiment(counts, other)])
    assert [ax.texts[1].get_text() for ax in figure.axes[1:]] == [
        "encoder's angle (deg)",
        "a column (%)",
    ]


def test_what_a_run_does_not_have_is_said_and_other_units_have_their_own_column() -> None:
    (figure,) = plot_campaign([experiment(), experiment(channel(unit="m/s"), run="b")])
    said = [[text.get_text() for text in ax.texts] for ax in figure.axes]
    assert "shaft speed (deg/s)" in said[1]
    assert "shaft speed (mm/s)" in said[2]
    assert "not measured" in said[2]
    assert "not measured" in said[4]
    assert "not measured" not in said[1] + said[5]


def test_eight_runs_fit_on_a_page_and_every_axis_has_its_own() -> None:
    runs = [experiment(run=f"run{number}") for number in range(13)]
    runs.insert(3, experiment(axis="slew"))
    figures = plot_campaign(runs)
    assert [figure.texts[0].get_text() for figure in figures] == [
        "Measured tests: hoist, page 1 of 2",
        "Measured tests: hoist, page 2 of 2",
        "Measured tests: slew",
    ]
    assert [len(headings(figure)) for figure in figures] == [8, 5, 1]


def test_commands_are_staircases_where_they_are_held() -> None:
    (figure,) = plot_campaign([experiment(), experiment(input=command(interpolation="linear"))])
    held, straight = figure.axes[:2], figure.axes[2:]
    assert [to_hex(line(ax).get_color()) for ax in held] == [INK.lower(), BLUE.lower()]
    assert line(held[0]).get_drawstyle() == "steps-post"
    assert line(straight[0]).get_drawstyle() == line(held[1]).get_drawstyle() == "default"


def test_an_ignored_spike_leaves_the_scale_to_the_rest() -> None:
    """A channel of 1 rad/s and one sample of 100 rad/s, ignored in one run and not in the other."""
    values, weight = np.where(TIME > 2.0, 1.0, 0.0), np.ones(TIME.size)
    values[50], weight[50] = 100.0, 0.0
    (figure,) = plot_campaign([experiment(channel(values=values, weight=weight))])
    assert figure.axes[1].get_ylim()[1] < 1.2 * np.degrees(1.0)
    (figure,) = plot_campaign([experiment(channel(values=values))])
    assert figure.axes[1].get_ylim()[1] > np.degrees(100.0)


def test_a_long_record_is_light_and_keeps_its_extremes() -> None:
    time = np.arange(1_000_000) / 512.0
    values = np.sin(time)
    values[654_321] = 5.0
    (figure,) = plot_campaign([experiment(channel(time=time, values=values), input=command(time))])
    drawn = np.asarray(line(figure.axes[1]).get_ydata())
    assert drawn.size < 3000
    assert drawn.max() == 5.0 * np.degrees(1.0)


def test_nothing_to_show_is_refused() -> None:
    with pytest.raises(InputError, match="at least one experiment"):
        plot_campaign([])


def crowded(run: str, signals: Mapping[str, str]) -> Experiment:
    weight = np.ones(TIME.size)
    weight[TIME <= 0.78] = 0.0
    weight[64:80] = 10.0
    time = np.r_[TIME[:200], TIME[300:]]
    channels = [
        channel(kind, "rad/s", name=name, time=time, weight=np.r_[weight[:200], weight[300:]])
        for name, kind in signals.items()
    ]
    return experiment(
        *channels,
        run=run,
        input=command(time, limits=(-4.0, 4.0)),
        ignored=((0.0, 0.78, "plussing transient"),),
    )


def test_pages_are_legible_however_many_signals(assert_legible) -> None:
    many = {f"a rather long name of signal {n}": "shaft_speed" for n in range(5)}
    for signals in ({"speed": "shaft_speed"}, many):
        runs = [crowded(f"steps_boom_0928_{number}", signals) for number in range(3)]
        (figure,) = plot_campaign(runs, title="Excavator")
        assert_legible(figure)


def test_panels_do_not_lie_over_one_another() -> None:
    (figure,) = plot_campaign([crowded(f"run{n}", {"a": "other", "b": "other"}) for n in range(3)])
    boxes = [ax.get_tightbbox() for ax in figure.axes[::3]]
    figure.draw_without_rendering()
    assert all(upper.y0 >= lower.y1 for upper, lower in pairwise(boxes))
