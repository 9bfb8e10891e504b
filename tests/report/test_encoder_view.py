from pathlib import Path

import numpy as np
import pytest
from swashplate.report.display_units import display_unit
from swashplate.report.speed_lines import cut, reach_of, speed_handles, usable_methods

from swashplate import InputError
from swashplate.campaign import Channel, Encoder, Source, Speed
from swashplate.report.figures import plot_encoder

SOURCE = Source(Path("hoistr6.csv"), "counts")
TIME = np.arange(1025) / 512.0
DEGREES = 180.0 / np.pi


def encoder(time: np.ndarray = TIME, per_turn: float = 360.0) -> Channel:
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


def position(time: np.ndarray = TIME, noise: float | None = None) -> Channel:
    values = 0.01 * time
    weight = np.ones(time.size)
    return Channel("boom", "position", "m", time, values, weight, SOURCE, noise=noise)


def lines(ax) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {line.get_label(): line.get_data() for line in ax.lines}


def legends(figure) -> list[list[str]]:
    return [[text.get_text() for text in legend.get_texts()] for legend in figure.legends]


def test_the_staircase_and_the_line_between_its_changes() -> None:
    figure = plot_encoder(encoder(), title="Counts of 1 degree")
    upper, lower = figure.axes
    drawn = lines(upper)
    # 20 deg/s passes the edges of counts each 0.05 s, from 0.525 s on
    np.testing.assert_allclose(drawn["raw"][1], np.floor(20.0 * np.maximum(TIME - 0.5, 0.0) + 0.5))
    stair = next(line for line in upper.lines if line.get_label() == "raw")
    assert stair.get_drawstyle() == "steps-post"
    between = (TIME > 0.6) & (TIME < 1.9)
    # a change shows in the next sample at the latest, and the line starts at a change
    expected = 20.0 * (TIME[between] - 0.5) + 0.5
    assert np.abs(drawn["interpolated"][1][between] - expected).max() < 20.0 * 1.5 / 512.0
    assert upper.get_ylabel() == "angle (deg)"
    assert lower.get_ylabel() == "speed (deg/s)"
    (counts,) = upper.child_axes
    assert counts.get_ylabel() == "counts"
    figure.draw_without_rendering()
    # read backwards: 20 degrees are as high as -20 counts
    height = upper.transData.transform((0.0, 20.0))[1]
    assert counts.transData.transform((0.0, -20.0))[1] == pytest.approx(height)
    assert figure.texts[0].get_text() == "Counts of 1 degree"


def test_speeds_of_every_method_that_512_hz_allow() -> None:
    figure = plot_encoder(encoder())
    lower = figure.axes[1]
    drawn = lines(lower)
    assert {"difference", "source", "savitzky_golay"} <= drawn.keys()
    late = (TIME > 1.2) & (TIME < 1.7)
    for method in ("source", "savitzky_golay"):
        x, y = drawn[method]
        np.testing.assert_array_equal(x, TIME)
        assert np.mean(y[late]) == pytest.approx(20.0, abs=0.3)
    # a count a sample, or none: 512 deg/s or 0
    assert set(np.round(drawn["difference"][1], 6)) == {0.0, 512.0}
    # the panel is made for the smooth speeds
    assert lower.get_ylim()[1] < 100.0
    assert legends(figure) == [
        ["counts", "interpolated between changes of the count"],
        [
            "plain difference, from 0 to 512 deg/s",
            "10 and 30 Hz filters, 20.2 ms late",
            "Savitzky-Golay",
        ],
    ]


def test_a_window_shows_a_part_of_what_the_whole_record_gives() -> None:
    whole, part = plot_encoder(encoder()), plot_encoder(encoder(), window=(1.0, 1.25))
    inside = (TIME >= 1.0) & (TIME <= 1.25)
    for ax, cut_ax in zip(whole.axes, part.axes, strict=True):
        assert cut_ax.get_xlim() == (1.0, 1.25)
        for label, (x, y) in lines(cut_ax).items():
            if len(x) > 2 and label != "difference":
                np.testing.assert_array_equal(x, TIME[inside])
                np.testing.assert_array_equal(y, lines(ax)[label][1][inside])


def test_uneven_stamps_have_the_exact_filters_and_no_moving_polynomial() -> None:
    time = TIME + 4e-4 * np.sin(np.arange(TIME.size))
    figure = plot_encoder(encoder(time))
    assert legends(figure)[1][1].startswith("10 and 30 Hz filters, exact form, 21.")
    assert usable_methods(encoder(time)) == ("difference", "exact")
    assert usable_methods(encoder(TIME[::2])) == (
        "difference",
        "exact",
        "savitzky_golay",
    )


def test_a_position_has_no_counts() -> None:
    figure = plot_encoder(position())
    upper, lower = figure.axes
    assert upper.get_ylabel() == "position (mm)"
    assert lower.get_ylabel() == "speed (mm/s)"
    assert not upper.child_axes
    assert legends(figure)[0] == ["position"]


def test_lines_are_open_at_gaps() -> None:
    time = np.r_[TIME[:300], TIME[400:]]
    upper, lower = plot_encoder(encoder(time)).axes
    for ax in (upper, lower):
        for label, (_, y) in lines(ax).items():
            if label in ("raw", "interpolated", "exact"):
                assert np.flatnonzero(np.isnan(y)).tolist() == [300], label
    assert "gap" in lines(upper)


def test_the_scale_is_that_of_the_difference_only_where_it_is_alone() -> None:
    time = np.array([0.0, 1.0])
    smooth = Speed(time, np.array([1.0, 2.0]), 0.02)
    rough = Speed(time, np.array([-9.0, 9.0]), 0.0)
    assert reach_of({"difference": rough, "exact": smooth}) == (1.0, 2.0)
    assert reach_of({"difference": rough}) == (-9.0, 9.0)
    unit = display_unit("m/s", 2.0)
    words = [each.get_label() for each in speed_handles({"difference": rough}, unit, (1.0, 2.0))]
    assert words == ["plain difference, from −9000 to 9000 mm/s"]
    both = cut(Speed(np.arange(5.0), np.arange(5.0), 0.0), np.array([1.0, 3.0]))
    assert both.speed.tolist() == both.time.tolist() == [1.0, 2.0, 3.0]


def test_what_is_no_position_is_refused() -> None:
    speed = Channel("speed", "shaft_speed", "rad/s", TIME, TIME, np.ones(TIME.size), SOURCE)
    with pytest.raises(InputError, match="is a shaft_speed; this figure shows an encoder"):
        plot_encoder(speed)
    with pytest.raises(InputError, match="holds 0 samples of hoistr6.csv"):
        plot_encoder(encoder(), window=(3.0, 4.0))


def test_figures_are_legible(assert_legible) -> None:
    assert_legible(plot_encoder(encoder()))
    assert_legible(plot_encoder(position(), window=(0.5, 0.6), title="Boom"))
