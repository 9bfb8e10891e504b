"""Test bench: maneuvers in; logs, a campaign file and, apart, the truth out."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from platform import python_version
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.__about__ import __version__
from swashplate.campaign.rig.instruments import (
    COLUMNS,
    FULL_SCALE,
    SEVERITIES,
    Instruments,
    Severity,
    converted,
    logged,
    stream,
)
from swashplate.campaign.schema import (
    CHANNEL_KINDS,
    KINDS,
    ChannelKind,
    axis_lines,
    run_lines,
)
from swashplate.documents import toml_string
from swashplate.drive import Drive
from swashplate.equations.marching.record import SOURCE_RATE
from swashplate.errors import FileError, InputError, ParameterError
from swashplate.maneuvers import Maneuver, source_tests
from swashplate.maneuvers.pieces import positive, whole
from swashplate.simulation.result import Simulation
from swashplate.tables import write_text, write_whole

Array = NDArray[np.float64]

TRIES = 100
"""Draws after which no set of parameters within the rules is expected any more."""
COUNTS_PER_TURN = {"hoist": 400.0 * 120.0 / 19.0, "luff": 635.0 * 4.0, "slew": 81_000.0 * 7.0}
"""Counts in a turn of the output: 2526.3, 2540 and 567,000 in Kruse's tables."""
HELD_BACK = {
    "hoist": ("step +6.5 V", "step -6.5 V", "sine 6.5 V 0.1 Hz"),
    "slew": ("sine 4 V 0.1 Hz",),
    "luff": ("step +6.5 V", "sine 6.5 V 0.1 Hz"),
}
"""Kruse's tests kept for validation: those of middle size, within what the others excite."""


@dataclass(frozen=True, eq=False)
class VirtualRun:
    """One simulated test."""

    name: str
    """Of the maneuver."""
    stem: str
    """Of its file: axis and maneuver."""
    role: Literal["fit", "validate"]
    columns: Mapping[str, Array]
    """What was logged, SI: ``"time"`` [s], ``"voltage"`` [V] and the channels; NaN is an empty
    cell. Arrays of one length; rows that were lost are missing in all of them."""
    truth: Simulation
    """What really happened."""


@dataclass(frozen=True, eq=False)
class VirtualTests:
    """A simulated campaign: its logs and its truth."""

    axis: str
    nominal: Drive
    """What a fit starts from."""
    preset: str | None
    """Name of the packaged drive that `nominal` is, if it is one."""
    drive: Drive
    """What was simulated."""
    instruments: Instruments
    severity: str
    """``"clean"``, ``"realistic"``, ``"harsh"`` or ``"custom"``."""
    seed: int
    channels: tuple[ChannelKind, ...]
    counts_per_turn: float
    runs: Mapping[str, VirtualRun]
    """By the names of the maneuvers, in their order."""

    def __repr__(self) -> str:
        return (
            f"VirtualTests({self.axis!r}, {len(self.runs)} runs, {self.severity}, seed {self.seed})"
        )


def run(
    drive: str | Drive,
    maneuvers: Mapping[str, Maneuver] | Sequence[Maneuver] | None = None,
    *,
    seed: int = 1,
    severity: Severity = "realistic",
    instruments: Instruments | None = None,
    truth: Drive | None = None,
    perturb: float = 0.0,
    axis: str | None = None,
    channels: Sequence[ChannelKind] = ("rectified_current", "encoder_counts"),
    counts_per_turn: float | None = None,
    validate: Collection[str] | None = None,
) -> VirtualTests:
    """Simulate the tests of a campaign and log them.

    Parameters
    ----------
    drive : str or Drive
        Name of a packaged drive, or a drive: the one that a fit starts from.
    maneuvers : mapping or sequence of Maneuver, optional
        By default Kruse's tests of the axis.
    seed : int
        Not negative. The same seed gives the same logs, each of them whatever runs beside it.
    severity : {"clean", "realistic", "harsh"}
        How bad the instruments are, see `SEVERITIES`.
    instruments : Instruments, optional
        One's own instead.
    truth : Drive, optional
        What is simulated instead of `drive`, with refinements for example; the decay of its card
        takes over within a step.
    perturb : float
        Draw what is simulated about that drive, values within so much of its own, see `perturbed`.
        0 leaves them. [1]
    axis : {"hoist", "slew", "luff"}, optional
        Whose tests and encoder they are; by default the one that the drive is called after.
    channels : sequence of str
        Kinds of channel to log, as in a campaign file. Those other than current and counts are the
        simulated signals with white noise.
    counts_per_turn : float, optional
        Of the encoder, for one turn of the shaft; by default the axis's.
    validate : collection of str, optional
        Names of the runs that are kept for validation; by default, of Kruse's tests, those of
        middle size (`HELD_BACK`), and none of others.

    Returns
    -------
    VirtualTests
        Logs and truth in memory; `write` makes files of them.

    Raises
    ------
    InputError
        For an unknown name, a number out of range, two maneuvers of one name, or a maneuver that
        cannot be simulated at 512 Hz.
    """
    nominal = Drive.preset(drive) if isinstance(drive, str) else drive
    seed = whole("seed", seed)
    if severity not in SEVERITIES:
        raise InputError(f"severity is {severity!r}; it is one of {', '.join(SEVERITIES)}.")
    simulated = truth if truth is not None else nominal
    if perturb:
        simulated = perturbed(simulated, perturb, seed)
    # a real card's decay does not wait for the next sample of a log (docs/decisions/0008)
    simulated = Drive(replace(simulated.parameters, card_switch="split"))
    axis = axis or nominal.name
    listed = source_tests(axis) if maneuvers is None else maneuvers
    tests = dict(listed if isinstance(listed, Mapping) else ((m.name, m) for m in listed))
    if len(tests) < len(listed):
        raise InputError("Two maneuvers have the same name; give them in a mapping by name.")
    if not tests:
        raise InputError("A campaign needs at least one maneuver.")
    possible = [kind for kind in CHANNEL_KINDS if kind != "other"]
    for kind in channels:
        if kind not in possible:
            raise InputError(f"There is no channel {kind!r}; there are {', '.join(possible)}.")
    kinds = tuple(channels)
    if not kinds or len(set(kinds)) < len(kinds):
        raise InputError("channels must be one or more kinds, each once.")
    turn = COUNTS_PER_TURN.get(axis, 1.0)
    if counts_per_turn is not None:
        turn = positive("counts_per_turn", counts_per_turn)
    elif axis not in COUNTS_PER_TURN and "encoder_counts" in kinds:
        raise InputError(
            f"The encoder of '{axis}' is not known: give counts_per_turn, or as axis one of "
            f"{', '.join(COUNTS_PER_TURN)}."
        )
    held_back = HELD_BACK[axis] if validate is None and maneuvers is None else validate or ()
    for name in held_back:
        if name not in tests:
            raise InputError(f"There is no run '{name}' to validate; there are {', '.join(tests)}.")
    tools = SEVERITIES[severity] if instruments is None else instruments
    runs = {}
    for name, maneuver in tests.items():
        command = maneuver.sample(SOURCE_RATE)
        largest = float(np.abs(command).max())
        if largest > FULL_SCALE:
            raise InputError(f"The command reaches {largest:g} V, but the card takes ±10 V.")
        happened = simulated.simulate(converted(command, tools.command_bits))
        columns = logged(happened, kinds, tools, turn, seed, name)
        role: Literal["fit", "validate"] = "validate" if name in held_back else "fit"
        # as a file's name: hoist_step_+4_V, hoist_ramp_+1_V-s
        stem = re.sub(r"[^\w.+-]+", "_", f"{axis} {name}".replace("/", "-"))
        runs[name] = VirtualRun(name, stem, role, columns, happened)
    stems = [each.stem.lower() for each in runs.values()]
    if len(set(stems)) < len(stems):
        raise InputError("Two maneuvers would have the same file; give them other names.")
    return VirtualTests(
        axis,
        nominal,
        drive if isinstance(drive, str) else None,
        simulated,
        tools,
        severity if tools == SEVERITIES[severity] else "custom",
        seed,
        kinds,
        turn,
        runs,
    )


def perturbed(drive: Drive, spread: float, seed: int) -> Drive:
    """A drive whose every value is multiplied by chance.

    Parameters
    ----------
    drive : Drive
        The drive about which they are drawn.
    spread : float
        Largest deviation of a factor's logarithm, above 0 and at most 0.5. Its standard deviation
        is half of that: 0.1 gives factors of 0.90 to 1.11, most within 5 %. [1]
    seed : int
        The same seed gives the same drive.

    Returns
    -------
    Drive
        Zeros, infinite limits and parameters without effect stay as they are.

    Raises
    ------
    InputError
        If the spread is out of range, or no draw keeps the rules of a parameter set.
    """
    if not 0.0 < spread <= 0.5:
        raise InputError(f"perturb must be above 0 and at most 0.5, not {spread:g}.")
    parameters = drive.parameters
    columns = [
        column
        for parameter in parameters.values()
        if parameter.status != "inactive"
        for column in parameter.definition.columns
        if parameters.numbers[column] != 0.0 and np.isfinite(parameters.numbers[column])
    ]
    generator = stream(seed, "parameters")
    for _ in range(TRIES):
        logarithms = 0.5 * spread * generator.standard_normal(len(columns))
        while (far := np.abs(logarithms) > spread).any():
            logarithms[far] = 0.5 * spread * generator.standard_normal(int(far.sum()))
        factors = np.exp(logarithms).tolist()
        try:
            drawn = drive.scale(**dict(zip(columns, factors, strict=True)))
        except ParameterError:
            continue
        title = f"{parameters.title}; values within ±{100 * spread:g} % by seed {seed}"
        return drawn.renamed(drive.name, title)
    raise InputError(
        f"No draw of {TRIES} within ±{100 * spread:g} % keeps the rules of {drive.name}'s "
        "parameters; take a smaller spread."
    )


# --- files ----------------------------------------------------------------------------------

DRIVE_FILE = "drive.toml"
"""Parameters of the drive that was simulated, beside truth.toml; or, beside campaign.toml, those of
the one that a fit starts from."""


def write(tests: VirtualTests, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Files that a campaign leaves, and the truth beside them.

    Parameters
    ----------
    tests : VirtualTests
        What `run` simulated.
    folder : path
        New or empty: logs as CSV, named after axis and maneuver, and campaign.toml. In its folder
        ``truth`` lie truth.toml and the parameters that were simulated.
    overwrite : bool
        Allow a folder that holds something, and replace files of the same names.

    Returns
    -------
    path
        Of campaign.toml, written last: where it is, everything is.

    Raises
    ------
    FileError
        If the folder is not empty or something cannot be written.
    """
    place = Path(folder)
    try:
        if place.exists() and not place.is_dir():
            raise FileError(f"{place} is a file; name a folder.")
        if place.is_dir() and not overwrite and any(place.iterdir()):
            raise FileError(f"{place} is not empty; name a new folder, or allow overwriting.")
        (place / "truth").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{place} cannot be written: {error.strerror or error}.") from None
    for each in tests.runs.values():
        write_whole(place / f"{each.stem}.csv", partial(_write_log, tests, each))
    if tests.preset is None:
        tests.nominal.to_toml(place / DRIVE_FILE)
    tests.drive.to_toml(place / "truth" / DRIVE_FILE)
    write_text(truth_text(tests), place / "truth" / "truth.toml")
    campaign = place / "campaign.toml"
    write_text(campaign_text(tests), campaign)
    return campaign


def _write_log(tests: VirtualTests, run: VirtualRun, path: Path) -> None:
    """A CSV: an empty cell for NaN, whole numbers for an encoder that counts them."""
    import polars as pl

    refinements = ", ".join(tests.drive.parameters.refinements) or "none"
    table = pl.DataFrame(dict(run.columns), nan_to_null=True)
    counts = run.columns.get("counts")
    if counts is not None and np.array_equal(counts, np.rint(counts), equal_nan=True):
        table = table.with_columns(pl.col("counts").cast(pl.Int64))
    with path.open("wb") as file:
        note = (
            f"# virtual: simulated by swashplate {__version__}, no measurement; axis {tests.axis}, "
            f"{run.name}, instruments {tests.severity}, refinements {refinements}, "
            f"seed {tests.seed}\n"
        )
        file.write(note.encode())
        table.write_csv(file)


def campaign_text(tests: VirtualTests) -> str:
    """Text of the campaign file.

    The input is joined by straight lines, because that is what was simulated between two samples.
    """
    refinements = ", ".join(tests.drive.parameters.refinements) or "none"
    missing = ['missing = "drop"    # cells without a number'] * bool(tests.instruments.empty_cells)
    own = [
        f'drive = "{tests.preset or DRIVE_FILE}"    # the model that a fit starts from',
        'time = { column = "time", unit = "s" }',
        'start = "rest"',
    ]
    given = ['kind = "voltage"', 'column = "voltage"', 'unit = "V"', 'interpolation = "linear"']
    channels = {}
    for kind in tests.channels:
        column = COLUMNS.get(kind, kind)
        entries = [f'kind = "{kind}"', f'column = "{column}"']
        if kind == "encoder_counts":
            entries.append(f"counts_per_turn = {tests.counts_per_turn!r}    # of the shaft")
            if tests.instruments.counter_bits:
                entries.append(f"rolls_over_at = {2**tests.instruments.counter_bits}")
        else:
            entries.append(f'unit = "{KINDS[kind].units[0]}"')
        channels[column] = [*entries, *missing]
    lines = [
        f"# Virtual tests, simulated by swashplate {__version__}: nothing here was measured.",
        f"# Instruments: {tests.severity}; refinements: {refinements}; seed {tests.seed}.",
        "# What was simulated stands in truth/truth.toml: open it only after the fit.",
        f"title = {toml_string(f'Virtual tests, {tests.axis}')}",
        "virtual = true",
        "",
        *axis_lines(tests.axis, own, [*given, *missing], channels),
    ]
    for run in tests.runs.values():
        lines += run_lines(f"{run.stem}.csv", run.role)
    return "\n".join(lines)


def truth_text(tests: VirtualTests) -> str:
    """What was simulated: instruments, seed and versions; the drive has its own file."""
    from tomlkit import dumps

    content = {
        "virtual": True,
        "axis": tests.axis,
        "drive": DRIVE_FILE,
        "severity": tests.severity,
        "seed": tests.seed,
        "counts_per_turn": tests.counts_per_turn,
        "runs": list(tests.runs),
        "instruments": asdict(tests.instruments),
        "versions": {
            "swashplate": __version__,
            "numpy": version("numpy"),
            "numba": version("numba"),
            "python": python_version(),
        },
    }
    return f"# The truth behind the virtual tests beside this folder.\n{dumps(content)}"
