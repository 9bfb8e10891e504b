from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from swashplate.report.campaign_marks import IGNORED, MASKED

from swashplate import Drive, InputError, Simulation, maneuvers
from swashplate.campaign import Channel, Source
from swashplate.report.figures import plot_current
from swashplate.report.style import FAINT, INK

SOURCE = Source(Path("hoistr13.csv"), "current")


@pytest.fixture(scope="module")
def sine(hoist: Drive) -> Simulation:
    return hoist.simulate(maneuvers.sine(6.5, 0.1).sample())


def ammeter(run: Simulation, every: int = 1, error: float = 0.0, **entries) -> Channel:
    """The ammeter of a run, off by an error."""
    time = run.time[::every]
    values = (run.current_positive + run.current_negative)[::every] + error
    return Channel(
        **{
            "name": "current",
            "kind": "rectified_current",
            "unit": "A",
            "time": time,
            "values": values,
            "weight": np.ones(time.size),
            "source": SOURCE,
            **entries,
        }
    )


def lines(ax) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {line.get_label(): line.get_data() for line in ax.lines}


def shaded(ax, label: str) -> list[tuple[float, float]]:
    return [
        (path.vertices[:, 0].min(), path.vertices[:, 0].max())
        for each in ax.collections
        if each.get_label() == label
        for path in each.get_paths()
    ]


def legend(figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def by_hand(run: Simulation) -> np.ndarray:
    """Instants at which the signed current passes zero, between two samples or over several."""
    sign = np.sign(run.current)
    rows = np.flatnonzero(sign)
    turns = np.flatnonzero(sign[rows[1:]] != sign[rows[:-1]])
    return 0.5 * (run.time[rows[turns]] + run.time[rows[turns + 1]])


def test_sum_of_both_currents_is_compared_and_the_difference_is_below(sine: Simulation) -> None:
    every = 4
    figure = plot_current(ammeter(sine, every, error=0.02), sine)
    upper, lower = figure.axes
    expected = (sine.current_positive + sine.current_negative)[::every]
    drawn = lines(upper)
    for label, values in (("measured", expected + 0.02), ("simulated", expected)):
        x, y = drawn[label]
        # 3841 samples are drawn by their extremes
        np.testing.assert_allclose(y, values[np.searchsorted(sine.time[::every], x)], atol=1e-12)
    assert drawn["simulated"][1].max() == expected.max()
    assert upper.get_ylabel() == "|I₊| + |I₋| (A)"
    assert lower.get_ylabel() == "difference (mA)"
    np.testing.assert_allclose(lines(lower)["all"][1], 20.0, atol=1e-9)
    assert [text.get_text() for text in lower.texts] == [
        "measured less simulated, RMS 20 mA outside of what is shaded"
    ]
    assert figure.texts[0].get_text() == "current, measured and simulated (hoist)"


def test_samples_around_zero_crossings_are_masked_and_do_not_count(sine: Simulation) -> None:
    width = 0.4
    measured = ammeter(sine)
    crossings = by_hand(sine)
    assert crossings.size == 5
    near = np.abs(measured.time[:, None] - crossings).min(axis=1) < 0.5 * width - 0.01
    values = measured.values.copy()
    values[near] += 0.3
    values[~near] += 0.01
    figure = plot_current(ammeter(sine, values=values), sine, mask_width=width)
    upper, lower = figure.axes
    for ax in (upper, lower):
        spans = shaded(ax, MASKED.name)
        assert [0.5 * (a + b) for a, b in spans] == pytest.approx(crossings, abs=0.01)
        assert [b - a for a, b in spans] == pytest.approx([width] * 5, abs=0.02)
    share = 100.0 * 5.0 * width / (sine.time[-1] - sine.time[0])
    assert legend(figure)[2] == f"masked around zero crossings ({share:.2g} % of the samples)"
    counted = lines(lower)["counted"]
    np.testing.assert_allclose(counted[1][~np.isnan(counted[1])], 10.0, atol=1e-9)
    assert np.isnan(counted[1]).sum() == 5
    assert np.nanmax(lines(lower)["all"][1]) == pytest.approx(300.0)
    # its scale is that of what counts
    assert lower.get_ylim()[1] == pytest.approx(11.2)
    colors = {line.get_label(): to_hex(line.get_color()) for line in lower.lines}
    assert (colors["all"], colors["counted"]) == (FAINT, INK)


def test_ignored_samples_are_shaded_apart_from_masked_ones(step: Simulation) -> None:
    weight = np.where(step.time < 0.78, 0.0, 1.0)
    values = step.current_positive + step.current_negative + np.where(step.time < 0.78, 1.0, 0.0)
    figure = plot_current(ammeter(step, values=values, weight=weight), step)
    half = 0.5 / 512.0
    # stamp 399 is the last before 0.78 s
    assert shaded(figure.axes[0], IGNORED.name) == [pytest.approx((-half, 399 / 512.0 + half))]
    assert not shaded(figure.axes[0], MASKED.name)
    share = 100.0 * 400 / step.time.size
    assert legend(figure)[2:] == [
        "masked around zero crossings (0 % of the samples)",
        f"ignored ({share:.2g} %)",
    ]
    (words,) = (text.get_text() for text in figure.axes[1].texts)
    assert words.startswith("measured less simulated, RMS 0 mA")


def test_all_count_and_none_counts(step: Simulation) -> None:
    (words,) = (text.get_text() for text in plot_current(ammeter(step), step).axes[1].texts)
    assert words == "measured less simulated, RMS 0 mA"
    none = plot_current(ammeter(step, weight=np.zeros(step.time.size)), step)
    assert not none.axes[1].texts
    assert "counted" not in lines(none.axes[1])


def test_only_what_both_have_within_the_window_is_shown(sine: Simulation) -> None:
    longer = np.arange(-512, 40 * 512) / 512.0
    measured = ammeter(sine, time=longer, values=np.ones(longer.size), weight=np.ones(longer.size))
    assert plot_current(measured, sine).axes[1].get_xlim() == (0.0, sine.time[-1])
    part = plot_current(measured, sine, window=(10.9, 11.2))
    x, _ = lines(part.axes[0])["measured"]
    inside = longer[(longer >= 10.9) & (longer <= 11.2)]
    assert (x[0], x[-1]) == part.axes[1].get_xlim() == (inside[0], inside[-1])
    # a crossing just outside masks what lies within
    (crossing,) = (each for each in by_hand(sine) if 10.9 < each < 11.2)
    beside = plot_current(measured, sine, window=(crossing + 0.02, crossing + 1.0))
    (span,) = shaded(beside.axes[0], MASKED.name)
    assert span[1] == pytest.approx(crossing + 0.05, abs=0.01)


def test_lines_are_open_at_gaps(sine: Simulation) -> None:
    kept = (sine.time < 3.0) | (sine.time > 4.0)
    whole = ammeter(sine)
    measured = ammeter(
        sine, time=whole.time[kept], values=whole.values[kept], weight=whole.weight[kept]
    )
    upper, lower = plot_current(measured, sine).axes
    for y in (lines(upper)["measured"][1], lines(upper)["simulated"][1], lines(lower)["all"][1]):
        assert np.isnan(y).sum() == 1
    assert "gap" in lines(upper)


def test_other_channels_and_records_apart_are_refused(sine: Simulation) -> None:
    with pytest.raises(InputError, match="is a signed_current; this figure compares"):
        plot_current(ammeter(sine, kind="signed_current"), sine)
    with pytest.raises(InputError, match="samples of hoistr13.csv"):
        plot_current(ammeter(sine, time=sine.time + 100.0), sine)


def test_figures_are_legible(sine: Simulation, assert_legible) -> None:
    weight = np.where(sine.time < 0.78, 0.0, 1.0)
    assert_legible(plot_current(ammeter(sine, error=0.01, weight=weight), sine))
    assert_legible(plot_current(ammeter(sine, 7), sine, window=(10.0, 12.0), title="Zoom"))
