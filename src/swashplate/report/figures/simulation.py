"""Figures of simulations: one with all its signals, and several compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from math import inf, isfinite
from typing import TYPE_CHECKING, NamedTuple, overload

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from swashplate.drive import Limit, Simulation
from swashplate.errors import InputError
from swashplate.full_order import SIGNAL_UNITS, FullOrderSimulation, OrderComparison
from swashplate.machine import Definition, Run
from swashplate.maneuvers import Maneuver
from swashplate.report.lines import (
    COLUMNS,
    SHADES,
    Array,
    Shade,
    draw,
    fit_time,
    rows_within,
    shade,
    shade_handle,
    stretches,
)
from swashplate.report.style import (
    BLUE,
    GREY,
    INK,
    LINE,
    NORMAL,
    POINTS_PER_INCH,
    ROW,
    THIN,
    VERMILION,
    MarginLabel,
    dress_given,
    in_lines,
    label_below,
    label_margin,
    legend_rows,
    legend_within,
    put_text,
    sheet,
    signed,
    stroke_handles,
    strokes,
    zero_line,
)
from swashplate.results import GivenAxes
from swashplate.units import display_unit

if TYPE_CHECKING:
    from swashplate.identification import Band

Flags = NDArray[np.int8]
Stops = tuple[float, float]

WIDE, NARROW = 1.9, 0.9
"""Widths of two lines that lie on one another for long. [pt]"""
NEAR = 0.3
"""A line that marks a limit is shown if the signal goes at least this share of the way to it."""
FAINT = 0.25
"""Opacity of a band."""
FAR = 0.3
"""A signal whose range is less than this share of its largest value stays far from zero."""

# --- one simulation -------------------------------------------------------------------------------


class Curve(NamedTuple):
    """A signal of a panel; its name if there is more than one."""

    values: Array
    color: str
    name: str = ""
    width: float = LINE


class Mark(NamedTuple):
    """A level that the signal should be compared with."""

    level: float
    label: str


class Panel(NamedTuple):
    """Content of one panel: signals in SI, drawn in the units that people read."""

    label: str
    si: str
    traces: tuple[Curve, ...]
    limits: tuple[tuple[Shade, Array], ...] = ()
    """Looks of limits with the stretches in which they act."""
    marks: tuple[Mark, ...] = ()
    height: float = 1.3
    least: float = 0.0
    """Range that is shown at least, SI, so that rounding looks like nothing."""
    from_zero: bool = True
    """Whether zero is shown however far the signals stay from it."""
    between: tuple[Array, Array] | None = None
    """Both ends of a band about the signal, SI."""


def plot_simulation(
    simulation: Simulation,
    *,
    band: Band | None = None,
    window: tuple[float, float] | None = None,
    title: str | None = None,
) -> Figure:
    """Figure of the drive's signals over time, with the active limits shaded.

    Parameters
    ----------
    simulation : Simulation
        What to show. Voltage has a panel only if the simulation was driven by one.
    band : Band, optional
        Of a fitted drive: where the machine's own speed lies.
    window : (float, float), optional
        First and last instant to show [s].

    Raises
    ------
    InputError
        If the window holds fewer than two samples.

    Examples
    --------
    >>> from swashplate import Drive, maneuvers
    >>> from swashplate.report.figures import plot_simulation
    >>> figure = plot_simulation(Drive.preset("hoist").simulate(maneuvers.step(9.0)))
    >>> figure.savefig("step.png")
    """
    pump = simulation.pump
    run = simulation

    def acting(*limits: Limit) -> tuple[tuple[Shade, Array], ...]:
        return tuple((SHADES[limit], stretches(run.time, run.active(limit))) for limit in limits)

    spool = _spool(run.spool_position, run.orifice_opening, (pump.Z16_plus, -pump.Z16_minus))
    swash = _swash(run.swash_angle, (pump.Z13_plus, -pump.Z13_minus))
    current = (
        Curve(run.current_positive, BLUE, "positive"),
        Curve(run.current_negative, VERMILION, "negative"),
    )
    # without a dead zone no current is within it, although its flag stands at exactly 0 A
    dead_zone = (Mark(pump.Z17, f"dead zone {pump.Z17:.2f} A"),) if pump.Z17 else ()
    electric = acting(Limit.CURRENT_RATE)
    if pump.Z17:
        electric = acting(Limit.DEAD_ZONE, Limit.CURRENT_RATE)
    panels = [
        Panel("current", "A", current, electric, dead_zone),
        spool._replace(limits=acting(Limit.ORIFICE, Limit.SPOOL)),
        Panel(
            "stroking pressure", "Pa", (Curve(run.stroker_pressure, BLUE),), acting(Limit.RELIEF)
        ),
        swash._replace(limits=acting(Limit.SWASH_STOP)),
        Panel(
            "shaft speed",
            "rad/s",
            (Curve(run.shaft_speed, BLUE),),
            acting(Limit.SWASH_STOP),
            between=None if band is None else (band.lower, band.upper),
        ),
    ]
    if run.voltage is not None:
        panels.insert(0, Panel("voltage", "V", (Curve(run.voltage, INK),)))
    rows = rows_within(run.time, window, run.name)
    return _chain(panels, run.time, run.name if title is None else title, rows)


# --- signals of any run ---------------------------------------------------------------------------

MANY = 6
"""Panels that stand one below the other; of more, states have a column of their own."""
ALONE, PANEL = 2.4, 1.3
"""Height of the only panel, and of one of several. [inch]"""
LETTERS = 20
"""Of a line of an ordinate's label, at most."""
LOOKS = ("#f9d58b", "#c3e2f6", "#e3a5c5", "#b5e0cb", "#f3b79b", "#ededed")
"""Colours of the limits of a user-defined model."""


@overload
def plot_signals(
    run: Run,
    signals: Sequence[str],
    *,
    ax: None = None,
    label: str = "",
    window: tuple[float, float] | None = None,
    title: str | None = None,
) -> Figure: ...


@overload
def plot_signals(
    run: Run,
    signals: Sequence[str],
    *,
    ax: GivenAxes,
    label: str = "",
    window: tuple[float, float] | None = None,
    title: str | None = None,
) -> GivenAxes: ...


def plot_signals(
    run: Run,
    signals: Sequence[str],
    *,
    ax: Axes | Sequence[Axes] | None = None,
    label: str = "",
    window: tuple[float, float] | None = None,
    title: str | None = None,
) -> Figure | Axes | Sequence[Axes]:
    """Figure of some signals of a run over time, a panel each, or in given axes.

    A user-defined model says what they are: their `Definition` has words and unit of the ordinate
    and the range, whose ends are drawn if the signal comes near to them. Stretches in which a limit
    of the model acts are shaded in each panel; if several act, the last that the model names is
    seen. In given axes neither range nor limits are drawn.

    Parameters
    ----------
    run : Run
        What to show: of a drive, a full-order drive or a user-defined model.
    signals : sequence of str
        Names, as of ``run[name]``. Of more than six, the model's states stand in a second column.
    ax : matplotlib axes or sequence of them, optional
        One for each signal; by default a new figure's.
    label : str
        Of the curves: each panel gets a legend of all labelled curves in it.
    window : (float, float), optional
        First and last instant to show. [s]
    title : str, optional
        In the place of the run's name and command; axes that are given have none by default.

    Returns
    -------
    Figure, or `ax` as it was given

    Raises
    ------
    InputError
        For a signal that the run has not, another number of axes, or a window with fewer than two
        samples.
    """
    rows = rows_within(run.time, window, run.name)
    if ax is not None:
        _draw_given(run, signals, ax, label, rows, title)
        return ax
    shades = _limit_shades(run)
    limits = tuple(
        (limit_shade, stretches(run.time, run.active(name))) for name, limit_shade in shades.items()
    )
    panels = {name: _panel(run, name, label, rows)._replace(limits=limits) for name in signals}
    columns = _columns(run, panels)
    longest = max(map(len, columns.values()))
    height = PANEL if len(panels) > 1 else ALONE
    legend = _legend(list(panels.values()), tuple(shades.values()))
    figure, axes = sheet(
        [height] * longest,
        run.title if title is None else title,
        legend=legend,
        lines=len(columns) - 1,
        columns=len(columns),
    )
    for number, (heading, column) in enumerate(columns.items()):
        column_axes = axes[number * longest : (number + 1) * longest]
        for panel_axes, panel in zip(column_axes, column, strict=False):
            _draw_panel(panel_axes, panel._replace(height=height), run.time, rows)
        above = 4.0 + POINTS_PER_INCH * ROW * (legend_rows(legend) if legend else 0)
        if heading:
            put_text(column_axes[0], heading, (0.0, 1.0), (0.0, above), color=GREY)
        last = column_axes[len(column) - 1]
        last.tick_params(labelbottom=True)
        label_below(last, "time (s)")
        for unused in column_axes[len(column) :]:
            unused.remove()
    fit_time(axes[0], run.time[rows])
    return figure


def _columns(run: Run, panels: Mapping[str, Panel]) -> dict[str, list[Panel]]:
    """Panels of signals by the heading of their column: one without, or states apart."""
    states = run.instance.ports.state_signals
    columns = {
        "inputs and outputs": [panel for name, panel in panels.items() if name not in states],
        "states": [panel for name, panel in panels.items() if name in states],
    }
    if len(panels) > MANY and all(columns.values()):
        return columns
    return {"": list(panels.values())}


def _draw_given(
    run: Run,
    signals: Sequence[str],
    ax: Axes | Sequence[Axes],
    label: str,
    rows: slice,
    title: str | None,
) -> None:
    """Draw signals in axes of a caller, which may have curves already."""
    curves = []
    labels = []
    for name in signals:
        values = run[name][rows]
        definition = _definition(run, name)
        unit = display_unit(definition.unit, float(np.abs(values).max()) or inf)
        curves.append(unit.factor * values)
        labels.append(unit.label(definition.name))
    axes = dress_given(ax, title, labels, "time (s)", what="signals")
    for panel, values in zip(axes, curves, strict=True):
        panel.plot(run.time[rows], values, label=label or None)
        # with those of the lines that were there before
        if label:
            legend_within(panel, panel.get_legend_handles_labels()[0])


def _panel(run: Run, signal: str, label: str, rows: slice) -> Panel:
    """Panel of one signal, with the ends of its range."""
    values = run[signal]
    definition = _definition(run, signal)
    unit = display_unit(definition.unit, float(np.abs(values[rows]).max()) or inf)
    marks = tuple(
        Mark(end, f"limit {unit.factor * end:.4g} {unit.name}".rstrip().replace("-", "−"))
        for end in (definition.lower, definition.upper)
        if isfinite(end)
    )
    color = INK if signal in run.records else BLUE
    panel_label = in_lines(definition.name, LETTERS)
    trace = Curve(values, color, label)
    return Panel(panel_label, definition.unit, (trace,), marks=marks, from_zero=False)


def _definition(run: Run, signal: str) -> Definition:
    """Definition of a signal: of a user-defined model its own, of a drive from `SIGNAL_UNITS`."""
    name = signal.replace("_", " ")
    if isinstance(run, Simulation | FullOrderSimulation):
        return Definition(name, SIGNAL_UNITS.get(signal, ""))
    return run.instance.ports.definitions.get(signal, Definition(name, ""))


def _limit_shades(run: Run) -> dict[str, Shade]:
    """Looks of the limits of a user-defined model by name; a drive's stand in its chain."""
    if isinstance(run, Simulation | FullOrderSimulation):
        return {}
    colors = cycle(LOOKS)
    return {name: Shade(next(colors), name.replace("_", " ")) for name in run.limit_names}


# --- two models of one drive ----------------------------------------------------------------------


def plot_full_order(comparison: OrderComparison, *, title: str | None = None) -> Figure:
    """Figure of both models over one command: speeds, their difference, and what lies between.

    Parameters
    ----------
    comparison : OrderComparison
        Result of `swashplate.full_order.compare`. Limits that hold are shaded.
    """
    full = comparison.full
    machine = full.plant.machine

    def stretches_of(limit: Limit, flags: Flags) -> tuple[tuple[Shade, Array], ...]:
        return ((SHADES[limit], stretches(comparison.time, flags != 0)),)

    if comparison.voltage is None:
        command = Panel("current", "A", (Curve(full.current, INK),))
    else:
        command = Panel("voltage", "V", (Curve(comparison.voltage, INK),))
    if comparison.moves:
        percent = 100.0 * comparison.error / comparison.top_speed
        error = Panel("difference", "% of top", (Curve(percent, INK),))
    else:
        error = Panel("difference", "rad/s", (Curve(comparison.error, INK),))
    speeds = (
        # if the two are the same, the wide line shows on both sides of the narrow one
        Curve(full.shaft_speed, BLUE, "five states", WIDE),
        Curve(comparison.reduced_speed, VERMILION, "one state", NARROW),
    )
    openings = (machine.orifice_opening_plus, -machine.orifice_opening_minus)
    stops = (machine.swash_stop_plus, -machine.swash_stop_minus)
    pressure = (Curve(full.stroker_pressure, BLUE),)
    drop = (Curve(full.motor_pressure_drop, BLUE),)
    spool = _spool(full.spool_position, full.orifice_opening, openings)
    swash = _swash(full.swash_angle, stops)
    relief = stretches_of(Limit.RELIEF, full.relief_hold)
    panels = [
        command,
        Panel("shaft speed", "rad/s", speeds, height=1.8),
        error,
        spool._replace(limits=stretches_of(Limit.SPOOL, full.spool_hold)),
        swash._replace(limits=stretches_of(Limit.SWASH_STOP, full.plate_hold)),
        Panel("stroking pressure", "Pa", pressure, relief, least=1e5),
        Panel("motor\npressure drop", "Pa", drop, least=1e5),
    ]
    return _chain(panels, comparison.time, full.name if title is None else title)


def _spool(position: Array, opening: Array, ends: Stops) -> Panel:
    unit = display_unit("m", 0.0)
    marks = (Mark(x, f"orifice {signed(unit.factor * x, 2)} {unit.name}") for x in ends)
    traces = (
        Curve(position, BLUE, "position", WIDE),
        Curve(opening, VERMILION, "opening", NARROW),
    )
    return Panel("spool", "m", traces, marks=tuple(marks))


def _swash(angle: Array, stops: Stops) -> Panel:
    marks = (Mark(x, f"stop {signed(float(np.degrees(x)), 1)}°") for x in stops)
    return Panel("swash angle", "rad", (Curve(angle, BLUE),), marks=tuple(marks))


def _chain(panels: Sequence[Panel], time: Array, title: str, rows: slice = slice(None)) -> Figure:
    """The panels one under another, with a legend of the limits that act anywhere."""
    legend = _legend(panels, tuple(SHADES.values()))
    figure, axes = sheet([panel.height for panel in panels], title, below="time (s)", legend=legend)
    for ax, panel in zip(axes, panels, strict=True):
        _draw_panel(ax, panel, time, rows)
    fit_time(axes[-1], time[rows])
    return figure


def _legend(panels: Sequence[Panel], shades: Sequence[Shade]) -> list[Patch]:
    """Handles of the shades of limits that act in one of the panels, in the order given."""
    acting = set[Shade]()
    for panel in panels:
        acting.update(look for look, spans in panel.limits if spans.size)
    handles = [shade_handle(shade) for shade in shades if shade in acting]
    if any(panel.between is not None for panel in panels):
        handles.append(Patch(color=VERMILION, alpha=FAINT, linewidth=0.0, label="band of 95 %"))
    return handles


def _draw_panel(ax: Axes, panel: Panel, time: Array, rows: slice) -> None:
    """Draw signals over time, with the limits that act and the marks that they come near to.

    The ordinate begins at zero, unless signals stay far from it and the panel need not show it.
    """
    for look, spans in panel.limits:
        shade(ax, spans, look)
    largest = max(float(np.abs(trace.values[rows]).max()) for trace in panel.traces)
    unit = display_unit(panel.si, max(largest, panel.least) or inf)
    name, factor = unit
    label = f"{panel.label}\n({name})" if name else panel.label
    ax.set_ylabel(label, fontsize=NORMAL, color=INK)
    zero_line(ax)
    curves = [factor * trace.values[rows] for trace in panel.traces]
    bands = [factor * end[rows] for end in panel.between or ()]
    low = min(float(curve.min()) for curve in (*curves, *bands))
    high = max(float(curve.max()) for curve in (*curves, *bands))
    if bands:
        lower, upper = bands
        ax.fill_between(
            time[rows], lower, upper, color=VERMILION, alpha=FAINT, linewidth=0.0, zorder=1.2
        )
    labels = []
    for mark in panel.marks:
        level = factor * mark.level
        if (high if level > 0.0 else -low) >= NEAR * abs(level):
            ax.axhline(level, color=GREY, linewidth=THIN, dashes=(5.0, 3.0), zorder=1.5)
            labels.append(MarginLabel(level, mark.label, GREY))
    ends = [low, high, *(label.height for label in labels)]
    if panel.from_zero or not 0.0 < high - low < FAR * max(abs(low), abs(high)):
        ends.append(0.0)
    span = max(ends) - min(ends)
    spare = max(0.09 * span, 0.5 * (factor * panel.least - span)) or 1.0
    ax.set_ylim(min(ends) - spare, max(ends) + spare)
    for trace, values in zip(panel.traces, curves, strict=True):
        draw(ax, time[rows], values, trace.color, width=trace.width)
        if trace.name:
            labels.append(MarginLabel(float(values[-1]), trace.name, trace.color))
    label_margin(ax, labels, panel.height)


# --- a command ------------------------------------------------------------------------------------

JUST_BEFORE = 1e-6
"""Part of a maneuver's length before a jump at which the voltage before it is drawn."""


@overload
def plot_maneuver(maneuver: Maneuver, *, ax: None = None, title: str | None = None) -> Figure: ...


@overload
def plot_maneuver(maneuver: Maneuver, *, ax: GivenAxes, title: str | None = None) -> GivenAxes: ...


def plot_maneuver(
    maneuver: Maneuver,
    *,
    ax: Axes | Sequence[Axes] | None = None,
    title: str | None = None,
) -> Figure | Axes | Sequence[Axes]:
    """Figure of the voltage of a maneuver over time.

    Parameters
    ----------
    maneuver : Maneuver
        What to show.
    ax : matplotlib axes, optional
        Where to draw; by default in a new figure.

    Returns
    -------
    Figure, or `ax` as it was given
    """
    starts = np.array([start for start, _ in maneuver.pieces])
    before_steps = starts[starts > 0.0] - JUST_BEFORE * maneuver.length
    even = np.linspace(0.0, maneuver.length, COLUMNS)
    time = np.union1d(even, np.concatenate([starts, before_steps]))
    if ax is None:
        title_text = maneuver.name if title is None else title
        figure, (panel,) = sheet([2.4], title_text, ["voltage (V)"], "time (s)")
    else:
        (panel,) = dress_given(ax, title, ["voltage (V)"], "time (s)", what="panel")
    zero_line(panel)
    draw(panel, time, maneuver(time), INK)
    fit_time(panel, time)
    return figure if ax is None else ax


# --- several simulations of one command -----------------------------------------------------------


def plot_comparison(simulations: Mapping[str, Simulation], *, title: str | None = None) -> Figure:
    """Figure of the speeds of several drives under the same command, and of their differences.

    Parameters
    ----------
    simulations : mapping
        Name to simulation. The first is what the others are compared with. A command that is not
        the first one's is drawn in the colour of its simulation.

    Raises
    ------
    InputError
        If there is no simulation.
    """
    if not simulations:
        raise InputError("A comparison needs at least one simulation.")
    stroke_by_name = strokes(simulations)
    speed = display_unit("rad/s")
    title_text = "Shaft speed under the same command" if title is None else title
    legend = stroke_handles(stroke_by_name)
    heights = [1.2, 2.6, 1.6] if len(simulations) > 1 else [1.2, 2.6]
    volts = all(simulation.voltage is not None for simulation in simulations.values())
    labels = ["voltage (V)" if volts else "current (A)", speed.label("shaft speed")]
    labels.append(speed.label("difference"))
    figure, axes = sheet(heights, title_text, labels, "time (s)", legend=legend)
    for ax in axes:
        zero_line(ax)
    (reference, first), *_ = simulations.items()
    commands = [
        simulation.current if simulation.voltage is None or not volts else simulation.voltage
        for simulation in simulations.values()
    ]
    for (name, run), command in zip(simulations.items(), commands, strict=True):
        color, dashes = stroke_by_name[name]
        time = run.time
        if run is first:
            draw(axes[0], time, command, INK, zorder=3.0)
        elif not np.array_equal(commands[0], command):
            draw(axes[0], time, command, color, dashes=dashes)
        draw(axes[1], time, speed.factor * run.shaft_speed, color, dashes=dashes)
        common = (first.time >= time[0]) & (first.time <= time[-1])
        if run is not first and common.any():
            at = first.time[common]
            difference = np.interp(at, run.time, run.shaft_speed) - first.shaft_speed[common]
            draw(axes[2], at, speed.factor * difference, color, dashes=dashes)
    if len(simulations) > 1:
        label = f"speed minus that of {reference}"
        put_text(axes[2], label, (0.0, 1.0), color=stroke_by_name[reference].color)
    fit_time(axes[-1], *(simulation.time for simulation in simulations.values()))
    return figure
