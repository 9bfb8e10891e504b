"""Commands that a machine gets, named maneuvers or logs, and its runs under them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swashplate.cli.parsing import KIND_NAMES, file_kind
from swashplate.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from swashplate.analysis import Trial
    from swashplate.cli.machines import OwnMachine
    from swashplate.cli.options import CommandSampling, MachineChoice, Simulating, Start
    from swashplate.drive import Drive, Simulation
    from swashplate.identification import Band
    from swashplate.logs import Log, Series
    from swashplate.machine import Run
    from swashplate.maneuvers import Maneuver

_ENDING = re.compile(r"\.[A-Za-z]\w*$")


def named_maneuver(word: str, *drives: Drive) -> Maneuver:
    """A maneuver such as ``step:9``, or the thesis's test of that name for these drives."""
    from swashplate.maneuvers import parse, source_tests
    from swashplate.parameters import AXES

    axes = [drive.name for drive in drives if drive.name in AXES]
    tests: dict[str, Maneuver] = {}
    for axis in reversed(axes):
        tests |= source_tests(axis)
    if word in tests:
        return tests[word]
    try:
        return parse(word)
    except InputError as error:
        if ":" in word or not tests:
            raise
        sentence = str(error).rstrip(".")
        near = get_close_matches(word, tests, 1) or [*tests]
        raise InputError(
            f'{sentence}; or name one of the tests of {" or ".join(axes)}, such as "{near[0]}".'
        ) from None


def at_rate(drive: Drive, rate: float) -> Drive:
    """The drive for a rate; a filter's recursion for another rate is replaced, with a note."""
    from swashplate.cli.terminal import note
    from swashplate.machine.marching import least_substeps

    filter_rate = drive.parameters.rate
    marched = rate * least_substeps(rate)
    if filter_rate is None or abs(marched / filter_rate - 1.0) < 1e-9:
        return drive
    steps = "" if marched == rate else f", computed in steps of 1/{marched:g} s,"
    note(
        f"{drive.name}: the card's filter is a recursion for {filter_rate:g} Hz; at {rate:g} "
        f"Hz{steps} the differential equation with the same poles replaces it."
    )
    return drive.at_every_rate()


def run_of(machine: MachineChoice, command: str, options: Simulating) -> tuple[str, Run]:
    """Simulate a drive, or a machine of a user's own; return the command's name and the run."""
    if machine.own is not None:
        return own_run(machine.own, command, options)
    return simulated_as(at_rate(machine.loaded_drive, options.rate), command, options)


def band_of(machine: MachineChoice, run: Run) -> Band | None:
    """The band about the speed of a run of a fitted drive; None of any other machine."""
    from swashplate.cli.parsing import fit_of
    from swashplate.drive import Simulation
    from swashplate.identification import speed_band

    if not isinstance(run, Simulation):
        return None
    drive = machine.loaded_drive
    fit = fit_of(machine.drive, drive.parameters.numbers)
    if fit is None or fit.posterior is None:
        return None
    return speed_band(drive, run, fit.verdict, fit.posterior)


def simulated_as(drive: Drive, command: str, options: Simulating) -> tuple[str, Simulation]:
    """As `simulated_run`, with the start and the measured inputs of the options."""
    return simulated_run(
        drive,
        command,
        options,
        start=options.start,
        clip=options.clip,
        measured=options.measured or (),
    )


def simulated_run(
    drive: Drive,
    command: str,
    options: CommandSampling,
    *,
    start: Start = "rest",
    clip: bool = False,
    measured: Sequence[str] = (),
) -> tuple[str, Simulation]:
    """Simulate a drive over a maneuver or the command in a file; return its name and the run."""
    if _is_file(command):
        name = Path(command).name
        log = command
        error_prefix = f"{command}: "
        series = _command_series(drive, command, options)
        values = series.values
        time = series.time
    else:
        maneuver = named_maneuver(command, drive)
        name = maneuver.name
        log = ""
        error_prefix = ""
        values = maneuver.sample(options.rate)
        time = None
    inputs = _measured_inputs(measured, log, options.time_column)
    try:
        return name, drive.simulate(
            values,
            options.rate,
            time=time,
            interpolation=options.interpolation,
            start=start,
            clip=clip,
            **inputs,
        )
    except InputError as error:
        raise InputError(f"{error_prefix}{error}") from None


def _is_file(command: str) -> bool:
    """Whether a command is a log, not a maneuver."""
    name_or_file = command.partition(":")[0]  # stairs:2/4/0 is not a path
    is_path = "/" in name_or_file or _ENDING.search(name_or_file) is not None
    return is_path or Path(command).is_file()


def _checked_log(command: str) -> Log:
    """The log that a command names; another kind of file is refused."""
    from swashplate.logs import open_log

    kind = file_kind(Path(command))
    if kind not in ("log", ""):
        raise InputError(
            f"{command} is {KIND_NAMES[kind]}, not a command: name a maneuver such as step:9, or a "
            "log."
        )
    return open_log(command)


def _check_interpolation(command: str, options: CommandSampling) -> None:
    """Refuse a log without a word on what its input is between rows."""
    if options.interpolation is None:
        raise InputError(
            f"{command} needs --interpolation linear (a straight line from row to row) or "
            "--interpolation previous (each row held until the next)."
        )


def _command_series(drive: Drive, command: str, options: CommandSampling) -> Series:
    """Read the voltage of a command from a log; refuses another kind of file.

    The column that the drive was fitted to is read as its campaign reads it.
    """
    import numpy as np

    from swashplate.cli.terminal import note
    from swashplate.errors import FileError
    from swashplate.logs import read_series, unit_of

    log = _checked_log(command)
    columns = (("--time-column", options.time_column), ("--column", options.column))
    for option, column in columns:
        try:
            log.find(column)
        except InputError as error:
            raise InputError(f"{str(error).rstrip('.')}, with {option}.") from None
    logged = drive.parameters.command
    if logged is not None and _is_column(log, options.column, logged.column):
        times = read_series(command, options.time_column, "s", time_column=options.time_column)
        unit = logged.unit or unit_of(log.find(options.column), options.column, "V")
        logged = logged._replace(unit=unit)
        volts = logged.volts(log.read([options.column])[options.column])
        if not np.isfinite(volts).all():
            row = int(np.argmin(np.isfinite(volts)))
            raise FileError(
                f"{command}: column '{options.column}' has no finite number in data row {row}."
            )
        series = times._replace(values=volts)
        note(f"{logged.sentence}.")
    else:
        series = read_series(command, options.column, "V", time_column=options.time_column)
        if logged is not None:
            note(
                f"'{options.column}' is taken as volts at the card; the fit's own command is "
                f"'{logged.column}'."
            )
    _check_interpolation(command, options)
    return series


def _is_column(log: Log, requested: str, column: str) -> bool:
    """Whether two names, with or without a unit, mean one column of a log."""
    try:
        return log.find(requested) == log.find(column)
    except InputError:
        return False


def _measured_inputs(assignments: Sequence[str], log: str, time_column: str) -> dict[str, Any]:
    """Inputs other than the voltage by name: a column of a log, or a number."""
    from swashplate.drive import MEASURED, UNITS
    from swashplate.logs import read_series

    inputs = dict[str, Any]()
    for assignment in assignments:
        name, _, text = (part.strip() for part in assignment.partition("="))
        if name not in MEASURED or not text or name in inputs:
            raise InputError(
                f"--measured {assignment}: write NAME=COLUMN, once for each of "
                f"{', '.join(MEASURED)}."
            )
        try:
            inputs[name] = float(text)
        except ValueError:
            if not log:
                raise InputError(
                    f"--measured {assignment}: a maneuver has no columns, so give a number in SI."
                ) from None
            unit = UNITS[name]
            inputs[name] = read_series(log, text, unit, time_column=time_column).values
    return inputs


# --- machines of a user's own ---------------------------------------------------------------------


def own_run(own: OwnMachine, command: str, options: Simulating) -> tuple[str, Run]:
    """Simulate a machine of a user's own over a maneuver, or over the columns of a log.

    A maneuver drives the first input that is not given otherwise; columns of a log are taken by
    the names of the inputs.
    """
    from swashplate.machine import simulate
    from swashplate.machine.marching import even_rate

    rate = options.stated_rate or own.rate
    time = None
    if not _is_file(command):
        inputs = commanded_inputs(own, command, options.measured or (), rate or options.rate)
        name = command_name(own, command, inputs)
    else:
        log = _checked_log(command)
        others = _other_inputs(own, options.measured or (), command, options)
        name = Path(command).name
        columns = _columns_of_inputs(own, log, options)
        series = {each: _series(own, command, each, columns[each], options) for each in columns}
        inputs = {**{each: read.values for each, read in series.items()}, **others}
        if not series:
            raise InputError(
                f"{command} has no column of an input of {own.machine.name}: call one "
                f"{' or '.join(own.ports.external)}, or write --measured {own.driven()}=COLUMN."
            )
        _check_interpolation(command, options)
        time = next(iter(series.values())).time
        rate = rate or even_rate(time)
        own.check_needed([*inputs], "--measured")
    run = simulate(
        own.machine,
        inputs,
        rate or options.rate,
        time=time,
        interpolation=options.interpolation,
        substeps=own.substeps,
        clip=options.clip,
        start=options.start,
        begin=own.begin,
    )
    return name, run


def commanded_inputs(
    own: OwnMachine, command: str, assignments: Sequence[str], rate: float
) -> dict[str, Any]:
    """Inputs of a machine: a maneuver of the first that is not given otherwise, and the others.

    Other maneuvers are sampled at the rate [Hz] for as long as the command lasts.
    """
    from swashplate.maneuvers import Maneuver, parse

    others = _other_inputs(own, assignments)
    driven = own.driven(others)
    if driven in others:
        raise InputError(f"--measured gives {driven}, which {command} drives: leave one out.")
    maneuver = parse(command)
    stamps = maneuver.time(rate)
    sampled = {key: other(stamps) for key, other in others.items() if isinstance(other, Maneuver)}
    inputs = {driven: maneuver, **others, **sampled}
    own.check_needed([*inputs], "--measured")
    return inputs


def command_name(own: OwnMachine, command: str, inputs: Mapping[str, Any]) -> str:
    """What a command is called: its own name is in volts."""
    driven, maneuver = next(iter(inputs.items()))
    name: str = maneuver.name
    return name if own.unit(driven) in ("", "V") else command


def _columns_of_inputs(own: OwnMachine, log: Log, options: CommandSampling) -> dict[str, str]:
    """Column of a log for each input that has one, by its name or the last word of it."""
    columns = dict[str, str]()
    for name in own.ports.external:
        requested = name
        if options.stated_column is not None and name == own.driven():
            requested = options.stated_column
        last = requested.rpartition(".")[2]
        is_only = [each.rpartition(".")[2] for each in own.ports.external].count(last) == 1
        for column in (requested, last) if is_only else (requested,):
            if name not in columns and _has(log, column):
                columns[name] = column
    if options.stated_column is not None and own.driven() not in columns:
        log.find(options.stated_column)
    return columns


def _has(log: Log, column: str) -> bool:
    try:
        log.find(column)
    except InputError:
        return False
    return True


def _series(own: OwnMachine, file: str, name: str, column: str, options: CommandSampling) -> Series:
    """A column of a log in the unit of an input; as it stands if the model states none."""
    from swashplate.logs import open_log, read_series, unit_of

    unit = own.unit(name) or unit_of(open_log(file).find(column), column, "1")
    return read_series(file, column, unit, time_column=options.time_column)


def _other_inputs(
    own: OwnMachine,
    assignments: Sequence[str],
    log: str = "",
    options: CommandSampling | None = None,
) -> dict[str, Any]:
    """Inputs that are given by name: a number, a maneuver or a column of a log."""
    from swashplate.cli.parsing import pairs_of
    from swashplate.maneuvers import parse

    inputs = dict[str, Any]()
    for name, text in pairs_of("--measured", assignments, "supply=100"):
        full = own.input_named(name.strip())
        word = text.strip()
        if word[:1].isdigit() or word[:1] in ("+", "-", "."):
            inputs |= own.constants("--measured", [f"{full}={word}"])
        elif options is not None:
            inputs[full] = _series(own, log, full, word, options).values
        else:
            inputs[full] = parse(word)
    return inputs


def window_of(
    time: NDArray[np.float64], begin: float | None, end: float | None
) -> tuple[float, float] | None:
    """The part of a record that --from and --to name; None for all of it. [s]"""
    if begin is None and end is None:
        return None
    start = float(time[0]) if begin is None else begin
    stop = float(time[-1]) if end is None else end
    return start, stop


def named_trial(drive: Drive, command: str, options: CommandSampling) -> tuple[str, Trial]:
    """Name of a command, which is a maneuver or a log, and its trial."""
    from swashplate.analysis import trial_of

    drive = at_rate(drive, options.rate)
    name, run = simulated_run(drive, command, options)
    return name, trial_of(drive, run["voltage"], options.rate)
