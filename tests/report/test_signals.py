import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from swashplate.report.shading import MOST_RUNS, SHADES, active_spans, merged
from swashplate.report.traces import MOST_POINTS, envelope

from swashplate import Drive, Limit, Simulation, maneuvers
from swashplate.report.figures import plot_simulation

LABELS = [
    "voltage\n(V)",
    "current\n(A)",
    "spool\n(mm)",
    "stroker pressure\n(kPa)",
    "swash angle\n(deg)",
    "shaft speed\n(deg/s)",
]


def shades(figure: Figure, panel: int) -> dict[str, np.ndarray]:
    """Beginnings and ends of what is shaded on a panel, by name in the legend. [s]"""
    return {
        collection.get_label(): np.array(
            [[p.vertices[:, 0].min(), p.vertices[:, 0].max()] for p in collection.get_paths()]
        )
        for collection in figure.axes[panel].collections
        if isinstance(collection, PolyCollection)
    }


def curves(figure: Figure, panel: int, samples: int) -> list[np.ndarray]:
    return [
        line.get_ydata() for line in figure.axes[panel].lines if len(line.get_ydata()) == samples
    ]


def levels(figure: Figure, panel: int) -> list[float]:
    """Heights of the dashed lines."""
    lines = figure.axes[panel].lines
    return [line.get_ydata()[0] for line in lines if line.is_dashed()]


def test_panels_follow_the_chain_and_name_their_units(step: Simulation) -> None:
    figure = plot_simulation(step)
    assert [ax.get_ylabel() for ax in figure.axes] == LABELS
    assert figure.axes[-1].get_xlabel() == "time (s)"
    assert figure.texts[0].get_text() == "hoist"
    assert plot_simulation(step, title="A step").texts[0].get_text() == "A step"


def test_lines_are_the_signals_in_the_units_of_people(step: Simulation) -> None:
    figure = plot_simulation(step)
    expected = [
        [step.voltage],
        [step.current_positive, step.current_negative],
        [1e3 * step.spool_position, 1e3 * step.orifice_opening],
        [1e-3 * step.stroker_pressure],
        [step.swash_angle * (180.0 / np.pi)],
        [step.shaft_speed * (180.0 / np.pi)],
    ]
    for panel, signals in enumerate(expected):
        drawn = curves(figure, panel, step.time.size)
        assert len(drawn) == len(signals)
        for line, signal in zip(drawn, signals, strict=True):
            np.testing.assert_allclose(line, signal, rtol=1e-14, atol=0.0)


def test_a_current_has_no_panel_of_voltage(hoist: Drive) -> None:
    figure = plot_simulation(hoist.simulate_current(0.5 * np.sin(np.arange(2000) / 300.0)))
    assert [ax.get_ylabel() for ax in figure.axes] == LABELS[1:]


@pytest.mark.parametrize(("factor", "unit"), [(1e-4, "Pa"), (1.0, "kPa"), (100.0, "MPa")])
def test_pressure_has_the_unit_that_fits(hoist: Drive, factor: float, unit: str) -> None:
    # the same motion by pressures all larger by a factor
    other = hoist.scale(Z1=1.0 / factor, Z8=factor**0.5, Z9=factor, Z15=factor)
    run = other.simulate(maneuvers.step(9.0).sample())
    figure = plot_simulation(run)
    assert figure.axes[3].get_ylabel() == f"stroker pressure\n({unit})"
    (line,) = curves(figure, 3, run.time.size)
    to_unit = {"Pa": 1.0, "kPa": 1e-3, "MPa": 1e-6}[unit]
    np.testing.assert_allclose(line, to_unit * run.stroker_pressure, rtol=1e-14, atol=0.0)


def test_lines_mark_orifices_and_stops(hoist: Drive) -> None:
    figure = plot_simulation(hoist.simulate(maneuvers.sine(9.0, 0.1).sample()))
    assert levels(figure, 1) == pytest.approx([0.27867])
    assert levels(figure, 2) == pytest.approx([0.11634, -0.15126])
    assert levels(figure, 4) == pytest.approx(np.degrees([0.27596, -0.26047]))


def test_a_stop_out_of_reach_does_not_squeeze_the_signal(hoist: Drive) -> None:
    run = hoist.simulate(maneuvers.step(0.8).sample())
    figure = plot_simulation(run)
    assert levels(figure, 4) == []
    assert figure.axes[4].get_ylim()[1] < 1.2 * np.degrees(run.swash_angle.max())


def test_a_run_of_active_samples_is_shaded_up_to_half_way_to_its_neighbours(hoist: Drive) -> None:
    run = hoist.simulate_current([0.0, 0.0, 0.5, 0.5, 0.1, 0.5, 0.5, 0.0], rate=512.0)
    expected = np.array([[-0.5, 1.5], [3.5, 4.5], [6.5, 7.5]]) / 512.0
    np.testing.assert_allclose(shades(plot_simulation(run), 0)["solenoid dead zone"], expected)


def test_every_limit_is_shaded_on_its_panels_and_named_once(all_limits: Simulation) -> None:
    figure = plot_simulation(all_limits)
    panels = {
        Limit.DEAD_ZONE: [1],
        Limit.CURRENT_RATE: [1],
        Limit.ORIFICE: [2],
        Limit.SPOOL: [2],
        Limit.RELIEF: [3],
        Limit.SWASH_STOP: [4, 5],
    }
    for limit, at in panels.items():
        name = SHADES[limit].name
        assert [panel for panel in range(6) if name in shades(figure, panel)] == at
        active = all_limits.active(limit)
        spans = shades(figure, at[0])[name]
        time = all_limits.time
        inside = ((time[:, None] >= spans[:, 0]) & (time[:, None] <= spans[:, 1])).any(axis=1)
        np.testing.assert_array_equal(inside, active)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [s.name for s in SHADES.values()]


def test_the_legend_names_only_what_acts(hoist: Drive) -> None:
    figure = plot_simulation(hoist.simulate_current(np.full(200, 0.3), start="steady"))
    assert figure.legends == []
    figure = plot_simulation(hoist.simulate_current(np.zeros(200), start="steady"))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["solenoid dead zone"]


def test_an_hour_is_drawn_by_few_points_and_few_spans(hoist: Drive) -> None:
    time = np.arange(3600 * 512) / 512.0
    run = hoist.simulate(8.0 * np.sin(0.2 * time) + 1.5 * np.sin(20.0 * time))
    figure = plot_simulation(run)
    for panel, ax in enumerate(figure.axes):
        assert max(len(line.get_xdata()) for line in ax.lines) <= MOST_POINTS + 4
        for spans in shades(figure, panel).values():
            assert len(spans) <= MOST_RUNS
    drawn = figure.axes[5].lines[-1].get_ydata()
    assert drawn.max() == np.degrees(run.shaft_speed).max()
    assert drawn.min() == np.degrees(run.shaft_speed).min()


@pytest.mark.parametrize("size", [16, 17, 100, 999, 1000])
def test_an_envelope_keeps_the_extremes_of_every_stretch(size: int) -> None:
    time = np.arange(size) / 10.0
    values = np.random.default_rng(size).normal(size=size)
    stamps, heights = envelope(time, values, most=16)
    assert stamps.size <= 16 + 4
    assert (np.diff(stamps) > 0.0).all()
    np.testing.assert_array_equal(values[np.searchsorted(time, stamps)], heights)
    assert stamps[0] == time[0]
    assert stamps[-1] == time[-1]
    stretch = -(-size // 8)
    for start in range(0, size, stretch):
        assert values[start : start + stretch].max() in heights
        assert values[start : start + stretch].min() in heights


def test_spans_are_merged_only_when_there_are_too_many() -> None:
    spans = np.array([[0.0, 1.0], [1.1, 2.0], [3.0, 4.0], [4.05, 5.0]])
    np.testing.assert_array_equal(merged(spans, 0.5, most=4), spans)
    np.testing.assert_array_equal(merged(spans, 0.5, most=3), [[0.0, 2.0], [3.0, 5.0]])


def test_a_limit_that_never_acts_has_no_spans(step: Simulation) -> None:
    assert active_spans(step, Limit.RELIEF).shape == (0, 2)


def test_a_single_sample_can_be_shown(hoist: Drive) -> None:
    plot_simulation(hoist.simulate([0.0])).draw_without_rendering()


def test_figures_are_legible(step, all_limits, hoist, assert_legible) -> None:
    assert_legible(plot_simulation(step))
    assert_legible(plot_simulation(all_limits))
    assert_legible(plot_simulation(hoist.simulate_current(0.5 * np.sin(np.arange(2000) / 300.0))))
    assert_legible(plot_simulation(Drive.preset("neutral").simulate(maneuvers.step(0.8).sample())))
