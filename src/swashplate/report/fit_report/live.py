"""Live page of a drive: one HTML file in which it runs, with sliders and measured signals."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any
from zlib import compress

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis import DESIGN_VARIABLES
from swashplate.analysis import key_numbers as key_numbers_of
from swashplate.campaign import (
    DIFFERENTIATOR,
    LOW_PASS,
    SIGNALS,
    Campaign,
    Channel,
    Experiment,
    speed_of,
)
from swashplate.drive import Drive, KeyNumbers, Limit
from swashplate.errors import InputError
from swashplate.export import Exported, content_of, licensed, webassembly
from swashplate.identification import at_instants, ignored_windows
from swashplate.identification.estimation import at_rate_of, voltage_record
from swashplate.machine import Definition, Machine
from swashplate.machine.fields import is_real
from swashplate.machine.marching import Record, inputs_of
from swashplate.machine.model import full_name
from swashplate.maneuvers import Maneuver
from swashplate.parameters import HasParameters, Parameter, ParameterSet, set_of
from swashplate.report.fit_report.html_page import LIVE_SCRIPTS, html_table, rendered, script_json
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
COLOURS = [shade.color for shade in SHADES.values()]
COLOURS += ["#d9d2f0", "#d8e4a8"]
"""Of the limits of a machine; its code has a bit for no more."""
MOST_PANELS = 8
"""Signals of a machine that are shown."""
NO_LIMIT = 1e30
"""What stands for an infinite number."""
PLAIN = DisplayUnit("", 1.0)
COMMAND = "command (V)"
"""Label of a drive's input."""
UNMEASURED = ("current", "shaft_speed")
"""Signals that are shown of a command without measured signals."""


@dataclass(frozen=True)
class PageMachine:
    """A machine as a page runs it: its code and numbers, its sliders and what is shown of it."""

    title: str
    code: bytes
    """WebAssembly."""
    values: Array
    """Numbers that it begins with; see `Content.values`."""
    parameters: Sequence[Mapping[str, Any]]
    """A slider each; see `_slider`."""
    design_variables: Sequence[Mapping[str, Any]]
    outputs: Sequence[str]
    limits: Sequence[Mapping[str, Any]]
    """Bit, class, words and colour of each."""
    panels: Sequence[Mapping[str, Any]]
    """Signals that are shown of a run without channels; see `_signal_panel`."""
    file: str = ""
    """Of a drive, the file that changed values belong to."""


def write_live_page(
    drive: ParameterSet | HasParameters,
    path: str | Path,
    *,
    campaign: Campaign | None = None,
    axis: str | None = None,
    command: Maneuver | None = None,
    rate: float = 512.0,
    name: str = "drive.toml",
    key_numbers: KeyNumbers | None = None,
) -> tuple[str, ...]:
    """Write the live page of a drive: one HTML file, whole or not at all, that needs no network.

    The drive runs in the reader's browser, from the equations' C source as WebAssembly. Parameters
    and design variables have sliders; the curves, their errors and the limits follow immediately.

    Parameters
    ----------
    drive : Drive, ParameterSet or a fit
        What the sliders begin at. One with a user-defined equation is compiled, which needs the
        extra ``binaries``.
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
    key_numbers : KeyNumbers, optional
        The numbers that matter of the drive, with the intervals of its fit; by default without.

    Returns
    -------
    tuple of str
        Sentences on what the page leaves out or changes.

    Raises
    ------
    InputError
        If there is nothing to simulate: no run is driven by a voltage, or neither a campaign nor a
        command is given; or a compiler is needed and missing.
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
    if key_numbers is None:
        key_numbers = key_numbers_of(Drive(parameters))
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
        title, virtual = campaign.title, campaign.virtual
    elif command is not None:
        runs = [_run_under(Drive(parameters), {"voltage": command}, rate, {"voltage": COMMAND})]
        title, virtual, sentences = parameters.title or parameters.name, False, ()
    else:
        raise InputError("A live page needs the runs of a campaign, or a command to simulate.")
    page = drive_on_page(parameters, runs[0]["step"], name)
    content = live_page(page, runs, title, virtual=virtual, key_numbers=key_numbers)
    write_text(content, path)
    return sentences


def write_machine_page(
    machine: Machine,
    path: str | Path,
    inputs: Mapping[str, Maneuver | ArrayLike],
    rate: float = 512.0,
) -> tuple[str, ...]:
    """Write the live page of any machine: as `write_live_page`, with what its model says of it.

    Each parameter has a slider, each input that changes and each output a panel, in which the
    limits are shaded.

    Parameters
    ----------
    machine : Machine
        What the sliders begin at. It is compiled, which needs the extra ``binaries``.
    path : path
        The file, which replaces an older one.
    inputs : mapping of str to Maneuver, array_like or float
        What it is simulated under, by name; at least one is a maneuver. In SI.
    rate : float
        Samples a second. [Hz]

    Returns
    -------
    tuple of str
        Sentences on what the page leaves out.

    Raises
    ------
    InputError
        If an input is missing or none, no input is a maneuver, or there is no compiler.
    FileError
        If the file cannot be written.
    """
    run = _run_under(machine, inputs, rate, {})
    content = content_of(machine, run["step"])
    outputs = content.exported.names
    signals = [name for name in machine.model.outputs if name in outputs] or outputs
    limits = list(machine.model.limit_meanings.items())
    sentences = []
    for what, names, most in (
        ("signals", signals, MOST_PANELS),
        ("limits", [name for name, _ in limits], len(COLOURS)),
    ):
        if len(names) > most:
            sentences.append(f"Left out, beyond {most} {what}: {listed(names[most:])}.")
    shown = [
        {"bit": 1 << k, "name": f"limit-{k}", "words": meaning or name, "color": color}
        for k, ((name, meaning), color) in enumerate(zip(limits, COLOURS, strict=False))
    ]
    page = PageMachine(
        title=machine.title or machine.name,
        code=webassembly(content),
        values=content.values,
        parameters=_machine_parameters(machine, content.exported),
        design_variables=(),
        outputs=outputs,
        limits=shown,
        panels=[_panel_of(machine, name, shown) for name in signals[:MOST_PANELS]],
    )
    write_text(live_page(page, [run], page.title), path)
    return tuple(sentences)


def live_page(
    page: PageMachine,
    runs: Sequence[Mapping[str, Any]],
    title: str,
    *,
    virtual: bool = False,
    key_numbers: KeyNumbers | None = None,
) -> str:
    """HTML of a live page with runs such as those of `run_of`; see `write_live_page`."""
    present_label = "as fitted" if any(each["main"] for each in page.parameters) else "as it is"
    content = {
        "wasm": b64encode(licensed(page.code)).decode("ascii"),
        "values": b64encode(page.values.astype("<f8").tobytes()).decode("ascii"),
        "parameters": page.parameters,
        "design_variables": page.design_variables,
        "outputs": [{"name": output, "number": k} for k, output in enumerate(page.outputs)],
        "limits": [[limit["bit"], limit["name"]] for limit in page.limits],
        "before": present_label,
        "as_options": not page.file,
        "filter": {"low": LOW_PASS, "high": DIFFERENTIATOR},
        "unmeasured": page.panels,
        "runs": runs,
    }
    colours = "".join(
        f".stack .{limit['name']} {{ fill: {limit['color']}; }}\n" for limit in page.limits
    )
    return rendered(
        "fit_report/live.html",
        LIVE_SCRIPTS,
        ("page.css", "live.css"),
        colours,
        data=script_json(content),
        title=title,
        machine=page.title,
        virtual=virtual,
        measured=any(run["channels"] for run in runs),
        fitted=present_label == "as fitted",
        before=present_label,
        limits=[(limit["words"], limit["color"]) for limit in page.limits],
        variables=bool(page.design_variables),
        file=page.file,
        numbers=html_table(key_numbers.table(), "numbers") if key_numbers else "",
        said=key_numbers.sentences if key_numbers else (),
    )


def can_run(parameters: ParameterSet, experiment: Experiment) -> bool:
    """Whether a page can run a drive over the input of a run; see `write_live_page`."""
    driven = experiment.input.kind == "voltage" and not parameters.equations
    return driven and not at_rate_of([experiment], parameters)[1]


# --- machines -------------------------------------------------------------------------------------


def drive_on_page(parameters: ParameterSet, step: float, file: str) -> PageMachine:
    """A drive as a page runs it at a step [s]."""
    drive = Drive(parameters)
    content = content_of(drive, step)
    values = _drive_parameters(parameters, content.exported)
    limits = []
    for k, exported in enumerate(content.exported.limits):
        limit = Limit[exported.name.upper()]
        shade = SHADES[limit]
        limits.append(
            {"bit": 1 << k, "name": _word(limit), "words": shade.name, "color": shade.color}
        )
    return PageMachine(
        title=parameters.title or parameters.name,
        code=webassembly(content),
        values=content.values,
        parameters=values,
        design_variables=_design_variables(values),
        outputs=content.exported.names,
        limits=limits,
        panels=[_signal_panel(signal) for signal in UNMEASURED],
        file=file,
    )


def _run_under(
    machine: Machine,
    given: Mapping[str, Maneuver | ArrayLike],
    rate: float,
    labels: Mapping[str, str],
) -> dict[str, Any]:
    """A run without channels, whose inputs are in the order in which the machine's code has them.

    An input's label is its name unless `labels` has another.
    """
    model = machine.model
    inputs = {full_name(name, model.external): signal for name, signal in given.items()}
    for name in inputs:
        if name in model.input_parameters:
            raise InputError(
                f"{machine.name}: on a live page {name} is what the parameter "
                f"{model.input_parameters[name]} says: set that."
            )
    maneuvers = {name: signal for name, signal in inputs.items() if isinstance(signal, Maneuver)}
    if not maneuvers:
        raise InputError(f"{machine.name}: one of the inputs must be a maneuver.")
    records = inputs_of(machine, inputs, rate)
    run_inputs = []
    for name in model.external:
        if name in records:
            unit = _unit_of(model.input_definitions.get(name))
            label = labels.get(name, unit.label(name))
            moves = not is_real(inputs[name])
            run_inputs.append(_input(records[name], label, unit.factor, shown=moves))
    driven, maneuver = next(iter(maneuvers.items()))
    definition = model.input_definitions.get(driven)
    in_volts = definition is None or definition.unit in ("", "V")
    command = maneuver.name if in_volts else driven  # its own name is in volts
    first = next(iter(records.values()))
    return {
        "start": first.start,
        "step": first.step,
        "inputs": run_inputs,
        "name": command,
        "role": "",
        "channels": [],
    }


def _input(record: Record, label: str, factor: float = 1.0, *, shown: bool) -> dict[str, Any]:
    """An input as the page takes it, rounded to four bytes: far finer than any converter."""
    planes = record.values.astype("<f4").view(np.uint8).reshape(-1, 4).T.tobytes()
    return {
        "label": in_lines(label, 24),
        "factor": factor,
        "shown": shown,
        "values": b64encode(compress(planes, 9)).decode("ascii"),
    }


def _unit_of(definition: Definition | None) -> DisplayUnit:
    """The unit that a signal of a machine is shown in; none if the model states none."""
    return display_unit(definition.unit) if definition and definition.unit else PLAIN


def _panel_of(machine: Machine, name: str, limits: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The panel of a signal of a machine, in which all limits are shaded."""
    displayed = _unit_of(machine.model.definitions.get(name))
    return {
        "signal": name,
        "name": name,
        "unit": displayed.name,
        "factor": displayed.factor,
        "label": in_lines(displayed.label(name), 24),
        "residual": "",
        "shaded": [limit["name"] for limit in limits],
    }


# --- parameters and design variables --------------------------------------------------------------


def _drive_parameters(parameters: ParameterSet, exported: Exported) -> list[dict[str, Any]]:
    """Every value of a set: its number in C, its words, and the ends of its slider."""
    names = [name for _, _, name in exported.named("parameters")]
    entries = []
    for parameter in parameters.values():
        definition = parameter.definition
        sides = ("",) if len(definition.columns) == 1 else (", positive", ", negative")
        for column, side, value in zip(definition.columns, sides, parameter.values, strict=False):
            entry = _slider(names.index(column), definition, value, slider(parameter, value))
            entry |= {
                "symbol": parameter.symbol,
                "column": column,
                "block": definition.block,
                "words": f"{definition.name}{side}",
                "main": parameter.status == "fitted",
            }
            entries.append(entry)
    return entries


def _machine_parameters(machine: Machine, exported: Exported) -> list[dict[str, Any]]:
    """Every parameter of a machine: its number in C, its words, and the ends of its slider."""
    entries = []
    for number, (part, path, _) in enumerate(exported.named("parameters")):
        full = f"{machine.model.prefix(part)}{path}"
        definition = machine.model.parameter_definitions[full]
        value = float(machine.params[number])
        ends = _ends(definition, value)
        stated = definition.name not in (path, full)
        entries.append(
            {
                **_slider(number, definition, value, ends),
                "symbol": full,
                "column": full,
                "block": "",
                "words": f"{full}: {definition.name}" if stated else full,
                "main": False,
            }
        )
    return entries


def _slider(
    number: int, definition: Definition, value: float, ends: tuple[float, float] | None
) -> dict[str, Any]:
    """A value of the machine's code; shown in mm, bar and degrees, else in SI."""
    unit = DisplayUnit(unit_text(definition.unit), 1.0)
    if definition.unit in ("m", "Pa", "rad"):
        unit = display_unit(definition.unit, 1e5 if definition.unit == "Pa" else 0.0)
    return {
        "number": number,
        "si": definition.unit,
        "unit": unit.name,
        "factor": unit.factor,
        "value": value if isfinite(value) else NO_LIMIT,
        "range": ends,
    }


def slider(parameter: Parameter, value: float) -> tuple[float, float] | None:
    """Ends of a value's slider; None if no factor moves it. SI"""
    if parameter.own_bounds is not None and all(map(isfinite, parameter.own_bounds)):
        low, high = parameter.own_bounds
        return (low, high) if low < high else None
    return _ends(parameter.definition, value)


def _ends(definition: Definition, value: float) -> tuple[float, float] | None:
    """Ends of the slider of a value without bounds of its own; None if no factor moves it."""
    if value == 0.0 or not isfinite(value):
        return None
    low, high = sorted((value / SPAN, value * SPAN))
    return max(low, definition.lower), min(high, definition.upper)


def _design_variables(values: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Design variables with the numbers that they move and the powers with which they do."""
    variables = []
    for name in SHOWN:
        powers = DESIGN_VARIABLES[name]
        moves = []
        for value in values:
            if value["value"] in (0.0, NO_LIMIT):
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
    record = voltage_record(experiment)
    return {
        "start": record.start,
        "step": record.step,
        "inputs": [_input(record, COMMAND, shown=True)],
        "name": experiment.name,
        "role": experiment.role,
        "steady": experiment.begins == "steady",
        "channels": channels,
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
