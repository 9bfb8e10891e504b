"""Live page of a drive: one HTML file in which it runs, with sliders and measured signals."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any
from zlib import compress

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis import DESIGN_VARIABLES
from swashplate.campaign import (
    DIFFERENTIATOR,
    LOW_PASS,
    SIGNALS,
    Campaign,
    Channel,
    Experiment,
    speed_of,
)
from swashplate.drive import Drive, Limit
from swashplate.errors import InputError
from swashplate.export import WASM, exported_drive, licensed, packaged, values_of
from swashplate.identification import at_instants, ignored_windows
from swashplate.identification.estimation import at_rate_of, voltage_record
from swashplate.machine.marching import Record, record_of
from swashplate.maneuvers import Maneuver
from swashplate.parameters import HasParameters, Parameter, ParameterSet, set_of
from swashplate.report.fit_report.html_page import LIVE_SCRIPTS, rendered, script_json
from swashplate.report.fit_report.runs import packed_samples
from swashplate.report.lines import SHADES, gap_rows
from swashplate.report.style import in_lines
from swashplate.tables import listed, write_text
from swashplate.units import DisplayUnit, display_unit, unit_text

Array = NDArray[np.float64]

SPAN = 4.0
"""Factor by which a slider goes below and above the present value."""
SHOWN = ("orifice", "pump", "supply_pressure", "rate_limits", "dead_zone", "spool_offset")
"""Design variables that have a slider of their own; each parameter has one too."""
BEFORE_CURRENT = Limit.DEAD_ZONE | Limit.CURRENT_RATE
"""Limits that are shaded in a panel of a current; the others are shaded in those of the pump."""
UNMEASURED = ("current", "shaft_speed")
"""Signals that are shown of a command without measured signals."""


def write_live_page(
    drive: ParameterSet | HasParameters,
    path: str | Path,
    *,
    campaign: Campaign | None = None,
    axis: str | None = None,
    command: Maneuver | None = None,
    rate: float = 512.0,
    name: str = "drive.toml",
) -> tuple[str, ...]:
    """Write the live page of a drive: one HTML file, whole or not at all, that needs no network.

    The drive runs in the reader's browser, from the equations' C source as WebAssembly. Parameters
    and design variables have sliders; the curves, their errors and the limits follow immediately.

    Parameters
    ----------
    drive : Drive, ParameterSet or a fit
        What the sliders begin at.
    path : path
        The file, which replaces an older one.
    campaign : Campaign, optional
        Its runs with a voltage as their input are shown with the drive's simulated response.
    axis : str, optional
        The axis, if the campaign has several.
    command : Maneuver, optional
        A voltage that the drive is simulated under if there is no campaign.
    rate : float
        At which the command is sampled. [Hz]
    name : str
        File that the changed values belong to, for the page's words.

    Returns
    -------
    tuple of str
        Sentences on what the page leaves out or changes.

    Raises
    ------
    InputError
        If there is nothing to simulate: no run is driven by a voltage, or neither a campaign nor a
        command is given; or the drive has a user-defined equation.
    FileError
        If the file cannot be written.

    Examples
    --------
    >>> from swashplate import Drive, maneuvers
    >>> from swashplate.report.fit_report import write_live_page
    >>> write_live_page(Drive.preset("hoist"), "hoist.html", command=maneuvers.step(9.0))
    ()
    """
    parameters = set_of(drive)
    if campaign is not None:
        tests = campaign.select(axis=axis)
        driven = [test for test in tests if test.input.kind == "voltage"]
        if not driven:
            raise InputError(
                f"{campaign.path.name} has no run that a voltage drives; a live page needs one."
            )
        parameters, sentences = at_rate_of(driven, parameters)
        left_out = [test.name for test in tests if test.input.kind != "voltage"]
        if left_out:
            sentences += (
                f"Left out, driven by something else than a voltage: {listed(left_out)}.",
            )
        runs = [run_of(at_instants(parameters, experiment)) for experiment in driven]
        page = live_page(parameters, runs, campaign.title, campaign.virtual, name)
    elif command is not None:
        record = record_of(command.sample(rate), rate, what="voltage")
        sentences = ()
        run = {**_record(record), "name": command.name, "role": "", "channels": []}
        page = live_page(parameters, [run], parameters.title or parameters.name, False, name)
    else:
        raise InputError("A live page needs the runs of a campaign, or a command to simulate.")
    write_text(page, path)
    return sentences


def live_page(
    parameters: ParameterSet, runs: Sequence[dict[str, Any]], title: str, virtual: bool, name: str
) -> str:
    """HTML of a live page with runs of `run_of`; see `write_live_page`."""
    if parameters.equations:
        raise InputError(
            f"{parameters.name} has a user-defined equation, which the WebAssembly of the package "
            "does not have: export its C source with swashplate.export.c."
        )
    exported = exported_drive()
    limits = [(1 << k, Limit[name.upper()]) for k, (_, name, _) in enumerate(exported.limits)]
    numbers = values_of(Drive(parameters), runs[0]["step"])
    values = _parameters(parameters)
    present_label = "as fitted" if any(value["main"] for value in values) else "as it is"
    content = {
        "wasm": b64encode(licensed(packaged(WASM))).decode("ascii"),
        "values": b64encode(numbers.astype("<f8").tobytes()).decode("ascii"),
        "parameters": values,
        "design_variables": _design_variables(values),
        "outputs": [{"name": output, "number": k} for k, output in enumerate(exported.names)],
        "limits": [[bit, _word(limit)] for bit, limit in limits],
        "before": present_label,
        "filter": {"low": LOW_PASS, "high": DIFFERENTIATOR},
        "unmeasured": [_signal_panel(signal) for signal in UNMEASURED],
        "runs": runs,
    }
    colours = "".join(
        f".stack .{_word(limit)} {{ fill: {SHADES[limit].color}; }}\n" for _, limit in limits
    )
    return rendered(
        "fit_report/live.html",
        LIVE_SCRIPTS,
        ("page.css", "live.css"),
        colours,
        data=script_json(content),
        title=title,
        drive=parameters.title or parameters.name,
        virtual=virtual,
        measured=any(run["channels"] for run in runs),
        fitted=present_label == "as fitted",
        before=present_label,
        limits=[(SHADES[limit].name, SHADES[limit].color) for limit in SHADES],
        file=name,
    )


def can_run(parameters: ParameterSet, experiment: Experiment) -> bool:
    """Whether a page can run a drive over the input of a run; see `write_live_page`."""
    driven = experiment.input.kind == "voltage" and not parameters.equations
    return driven and not at_rate_of([experiment], parameters)[1]


# --- parameters and design variables --------------------------------------------------------------


def _parameters(parameters: ParameterSet) -> list[dict[str, Any]]:
    """Every value of a set: its number in C, its words, and the ends of its slider."""
    names = [name for _, _, name in exported_drive().named("parameters")]
    entries = []
    for parameter in parameters.values():
        definition = parameter.definition
        # mm, bar and degrees; SI for the others
        unit = DisplayUnit(unit_text(definition.unit), 1.0)
        if definition.unit in ("m", "Pa", "rad"):
            unit = display_unit(definition.unit, 1e5 if definition.unit == "Pa" else 0.0)
        sides = ("",) if len(definition.columns) == 1 else (", positive", ", negative")
        for column, side, value in zip(definition.columns, sides, parameter.values, strict=False):
            if column not in names:
                continue  # of a user-defined equation
            entries.append(
                {
                    "number": names.index(column),
                    "symbol": parameter.symbol,
                    "column": column,
                    "block": definition.block,
                    "words": f"{definition.name}{side}",
                    "si": definition.unit,
                    "unit": unit.name,
                    "factor": unit.factor,
                    "value": value if isfinite(value) else 1e30,
                    "range": slider(parameter, value),
                    "main": parameter.status == "fitted",
                }
            )
    return entries


def slider(parameter: Parameter, value: float) -> tuple[float, float] | None:
    """Ends of a value's slider; None if no factor moves it. SI"""
    if parameter.own_bounds is not None and all(map(isfinite, parameter.own_bounds)):
        low, high = parameter.own_bounds
        return (low, high) if low < high else None
    if value == 0.0 or not isfinite(value):
        return None
    low, high = sorted((value / SPAN, value * SPAN))
    definition = parameter.definition
    return max(low, definition.lower), min(high, definition.upper)


def _design_variables(values: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Design variables with the numbers that they move and the powers with which they do."""
    variables = []
    for name in SHOWN:
        powers = DESIGN_VARIABLES[name]
        moves = []
        for value in values:
            if value["value"] in (0.0, 1e30):
                continue
            keys = {value["symbol"], value["column"]}  # the same without directions
            moves += [(value["number"], powers[key]) for key in keys if key in powers]
        if moves:
            label = name.replace("_", " ").capitalize()
            ends = (1.0 / SPAN, SPAN)
            variables.append({"name": name, "words": label, "moves": moves, "range": ends})
    return variables


# --- runs -----------------------------------------------------------------------------------------


def run_of(experiment: Experiment) -> dict[str, Any]:
    """A run that a voltage drives, with its channels that a drive simulates."""
    channels = [_measured_channel(channel) for channel in _comparable(experiment.channels.values())]
    return {
        **_record(voltage_record(experiment)),
        "name": experiment.name,
        "role": experiment.role,
        "steady": experiment.begins == "steady",
        "channels": channels,
    }


def _record(record: Record) -> dict[str, Any]:
    """A voltage as the page takes it, rounded to four bytes: far finer than any converter."""
    planes = record.values.astype("<f4").view(np.uint8).reshape(-1, 4).T.tobytes()
    return {
        "start": record.start,
        "step": record.step,
        "voltage": b64encode(compress(planes, 9)).decode("ascii"),
    }


def _comparable(channels: Iterable[Channel]) -> list[Channel]:
    """Channels that a drive simulates; a position only if its speed can be computed."""
    comparable = []
    for channel in channels:
        if channel.kind not in SIGNALS or not channel.used.any():
            continue
        if channel.is_position:
            try:
                speed_of(channel, "exact")
            except InputError:
                continue
        comparable.append(channel)
    return comparable


def _measured_channel(channel: Channel) -> dict[str, Any]:
    """A measured channel with what it is compared with."""
    signal = SIGNALS[channel.kind]
    values = channel.values
    unit = channel.unit
    name = channel.name
    if channel.is_position:
        values = speed_of(channel, "exact").speed
        unit = f"{channel.unit}/s"
        name = f"speed from {channel.name}"
    also = ""
    if signal == "current_sum":
        signal = "current_positive"
        also = "current_negative"
    panel = _signal_panel(signal, name, unit, float(np.abs(values).max(initial=0.0)))
    interval = float(np.median(np.diff(channel.time)))
    return {
        **panel,
        "also": also,
        "speed": channel.is_position,
        "time": packed_samples(channel.time, interval / 2**20),
        "measured": packed_samples(panel["factor"] * values),
        "breaks": [int(row) for row in gap_rows(channel.time)],
        "ignored": ignored_windows(channel),
    }


def _signal_panel(signal: str, name: str = "", unit: str = "", size: float = 0.0) -> dict[str, Any]:
    """A signal's panel: label, displayed unit, limits that are shaded in it."""
    unit = unit or {"current": "A", "shaft_speed": "rad/s"}[signal]
    displayed = display_unit(unit, size)
    electric = "current" in signal
    label = name or signal.replace("_", " ")
    return {
        "signal": signal,
        "name": label,
        "unit": displayed.name,
        "factor": displayed.factor,
        "label": in_lines(displayed.label(label), 24),
        "residual": in_lines(displayed.label("residual"), 14),
        "shaded": [_word(limit) for limit in Limit if bool(limit & BEFORE_CURRENT) == electric],
    }


def _word(limit: Limit) -> str:
    """A limit's name as a class of the page."""
    return str(limit.name).lower().replace("_", "-")
