"""Arguments and options that several commands share, and groups of them that belong together.

Each is a type with its option: a parameter `plot: FigureFile = None` is the option --plot. A
parameter whose type is one of the groups here stands for the group's fields; see `command`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from swashplate.cli.commands import Output
from swashplate.cli.terminal import check_writable, note
from swashplate.errors import InputError
from swashplate.tables import FIGURE, TABLE, Form
from swashplate.units import show_rod

if TYPE_CHECKING:
    from swashplate.cli.machines import OwnMachine
    from swashplate.drive import Drive

Interpolation = Literal["linear", "previous"]
Start = Literal["rest", "steady"]

NO_VALUE = " "
"""Metavar of a switch; without one, its help shows <bool>."""
STANDARD_RATE = 512.0
"""Samples a second unless others are asked for. [Hz]"""
VOLTAGE = "voltage"
"""Column of a drive's command in a log, by default."""
CAMPAIGN = Path("campaign.toml")
LOG_FORMATS = ".csv and other text, .parquet, .mat, .h5, .tdms or .mf4"


def new_file(form: Form, help: str, *, metavar: str = "FILE") -> Any:
    """Option for a file that a command writes.

    A file that cannot be written, or that exists and is not to be replaced, is refused before
    anything is computed: the command needs the option `Force`.
    """

    def check(context: typer.Context, path: Path | None) -> Path | None:
        check_writable(path, form, force=context.params["force"])
        return path

    check.writes = Output()  # type: ignore[attr-defined]  # see `commands`: never onto an input
    return typer.Option(metavar=metavar, help=help, callback=check)


def new_folder(help: str, *files: str, beside: str = "") -> Any:
    """Option for a folder that a command writes files into, by names or patterns.

    Without one it is that of the argument `beside`.
    """

    def check(path: Path | None) -> Path | None:
        return path

    check.writes = Output(files, beside)  # type: ignore[attr-defined]  # as above
    return typer.Option(metavar="DIR", help=help, callback=check)


def force_option(help: str) -> Any:
    """Option --force; it is read before the options for files, which depend on it."""
    return typer.Option("--force", metavar=NO_VALUE, help=help, is_eager=True)


Force = Annotated[bool, force_option("Replace existing files.")]
TableFile = Annotated[
    Path | None, new_file(TABLE, "Write all numbers in SI units: .csv or .parquet.")
]
FigureFile = Annotated[Path | None, new_file(FIGURE, "Draw a figure: .png, .svg or .pdf.")]
SetFile = Annotated[
    Path | None,
    new_file(
        Form("a parameter file", (".toml",)),
        "Write the changed drive as a parameter file.",
        metavar="SET.toml",
    ),
]

CampaignArgument = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN.toml", help="Campaign file, in the folder of its logs.")
]
DriveArgument = Annotated[
    str,
    typer.Argument(
        metavar="AXIS|SET.toml",
        help="Packaged drive (listed by 'swashplate show'), parameter file, or folder of a fit.",
    ),
]
MachineArgument = Annotated[
    str,
    typer.Argument(
        metavar="AXIS|SET.toml|FILE.py",
        help=(
            "Packaged drive (listed by 'swashplate show'), parameter file, folder of a fit, or a "
            "machine of your own: valve.py, or valve.py:NAME for one of several. That file is "
            "executed."
        ),
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help=(
            "Value of a parameter: Z16=1.2e-4 in SI units, Z16=1.2e-4/1.5e-4 for plus and minus, "
            "Z16_plus=0.12mm with a unit; of a machine of your own by path; may be repeated."
        ),
    ),
]
ScaleOption = Annotated[
    list[str] | None,
    typer.Option(
        "--scale",
        metavar="NAME=FACTOR",
        help=(
            "Factor on a parameter or design variable, applied after --set: Z16=1.5, orifice=1.5; "
            "may be repeated."
        ),
    ),
]
CommandArgument = Annotated[
    str,
    typer.Argument(
        metavar="MANEUVER|FILE",
        help=(
            'Maneuver, such as step:9 or "step +9 V", or a log with columns of time and voltage: '
            f"{LOG_FORMATS}. A column may state its unit: 'time \\[ms]'."
        ),
    ),
]

OptionalCommand = Annotated[
    str | None,
    typer.Argument(metavar="MANEUVER|FILE", help="Maneuver or log, as in 'swashplate simulate'."),
]

AxisOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="Axis; needed if the campaign has several.")
]
ModelFile = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.py",
        help=(
            "Python file that defines a model and its free parameters. The file is executed: use "
            "only one that you trust."
        ),
    ),
]
SetupOption = Annotated[
    str | None,
    typer.Option(
        metavar="SETUP.toml",
        help="Parameters to estimate (default: every number of the drive, known to 30 %).",
    ),
]
InitialDrive = Annotated[
    str | None,
    typer.Option(
        "--from", metavar="AXIS|SET.toml", help="Initial drive (default: the campaign's)."
    ),
]
RequiredOption = Annotated[
    float,
    typer.Option(
        "--require",
        metavar="X",
        min=0.0,
        help="Largest acceptable prediction error, in % of the signal's range.",
    ),
]
SeedOption = Annotated[int, typer.Option(metavar="N", min=0, help="Random seed.")]
DaskOption = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Address of a Dask scheduler: tcp://HOST:PORT."),
]
ManeuverOrLog = Annotated[
    str,
    typer.Option(
        metavar="MANEUVER|FILE",
        help='Command: a maneuver, such as step:9 or "step +9 V", or a log.',
    ),
]
VariablesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--variable",
        metavar="NAME[=LOW/HIGH]",
        help=(
            "Design variable or parameter, alone or with its lowest and highest factor; may be "
            "repeated. 'swashplate whatif --variables' lists them."
        ),
    ),
]
OutputOption = Annotated[
    list[str] | None,
    typer.Option(
        "--output",
        metavar="NAME",
        help="Signal of a machine of your own (default: its outputs); may be repeated.",
    ),
]
StepRate = Annotated[
    float | None,
    typer.Option(
        metavar="HZ", help="Steps a second of a machine of your own (default: as simulated)."
    ),
]
RateOption = Annotated[float, typer.Option(metavar="HZ", help="Sampling rate, 10 to 100000 Hz.")]


@dataclass(frozen=True)
class DriveChoice:
    """A drive as the command line names it, with values set and then scaled."""

    drive: DriveArgument
    values: SetOption = None
    factors: ScaleOption = None

    @cached_property
    def named_drive(self) -> Drive:
        """The drive as it is named."""
        from swashplate.cli.parsing import drive_of

        return drive_of(self.drive)

    @cached_property
    def loaded_drive(self) -> Drive:
        """The drive."""
        from swashplate.cli.parsing import changed_drive

        drive = changed_drive(self.named_drive, self.values or (), self.factors or ())
        if drive.parameters.motion == "rod":
            show_rod()
        return drive

    @property
    def title(self) -> str:
        """Its name for a heading; one from a file of another name goes by that, too."""
        path = Path(self.drive)
        name = self.loaded_drive.name
        return name if path.stem == name else f"{path.name or self.drive} ({name})"

    @property
    def changes(self) -> list[str]:
        """A line for each parameter that is not as its file has it."""
        from swashplate.cli.parsing import changes_between

        return changes_between(self.named_drive.parameters, self.loaded_drive.parameters)

    def warn(self) -> None:
        """Say what speaks against the drive's fit, and which limits its tests left open."""
        self.warn_of_fit()
        self._warn_unreached()

    def warn_of_fit(self) -> None:
        """Say what speaks against the drive's fit, as its verdict has it."""
        from swashplate.cli.parsing import doubt_of

        doubt = doubt_of(self.drive, self.named_drive)
        if doubt:
            note(f"! The fit of this drive says: {doubt}")

    def _warn_unreached(self) -> None:
        sentence = self.loaded_drive.parameters.unreached_sentence()
        if sentence:
            note(f"! {sentence}")

    def note(self, heading: str, *, unreached: bool = True) -> None:
        """Print a heading, what is changed, and which limits the drive's tests left open."""
        for line in (heading, *self.changes):
            note(line)
        if unreached:
            self._warn_unreached()


@dataclass(frozen=True)
class MachineChoice(DriveChoice):
    """A drive, or a machine of a user's own, as the command line names it, with values changed."""

    drive: MachineArgument
    model: ModelFile = None

    @cached_property
    def _named(self) -> OwnMachine | Drive:
        """What is named, as its file has it."""
        from swashplate.cli.machines import machine_in
        from swashplate.cli.parsing import drive_of, machine_word

        word = machine_word(self.drive, self.model)
        return drive_of(self.drive) if word is None else machine_in(word)

    @cached_property
    def own(self) -> OwnMachine | None:
        """The machine of a user's own; None if a drive is named, which has more to say."""
        from swashplate.cli.machines import OwnMachine, changed

        named = self._named
        if not isinstance(named, OwnMachine):
            return None
        return changed(named, self.values or (), self.factors or ())

    @cached_property
    def named_drive(self) -> Drive:
        """The drive as it is named."""
        from swashplate.cli.machines import OwnMachine

        named = self._named
        assert not isinstance(named, OwnMachine)
        return named

    @property
    def title(self) -> str:
        """Its name for a heading."""
        return super().title if self.own is None else self.own.title

    @property
    def changes(self) -> list[str]:
        """A line for each number that is not as its file has it."""
        return super().changes if self.own is None else [*self.own.changes]

    def _warn_unreached(self) -> None:
        if self.own is None:
            super()._warn_unreached()

    def warn(self) -> None:
        """Say what speaks against a drive; nothing is known of a machine of a user's own."""
        if self.own is None:
            super().warn()

    def warn_of_fit(self) -> None:
        """Say what speaks against a drive's fit; nothing is known of a machine of a user's own."""
        if self.own is None:
            super().warn_of_fit()

    def refuse_without(self, lacking: str, **options: object) -> None:
        """Refuse options that are given, by name, as something lacks that they need."""
        for name, value in options.items():
            if value:
                raise InputError(f"--{name.replace('_', '-')} needs {lacking}.")

    def refuse(self, **options: object) -> None:
        """Refuse options that are given, by name, as they have no meaning for this machine."""
        other = "a machine of your own" if self.own is None else "a drive"
        for name, value in options.items():
            if value:
                option = f"--{name.replace('_', '-')}"
                raise InputError(f"{option} is for {other}; leave it out for {self.title}.")


@dataclass(frozen=True)
class CommandSampling:
    """Options for sampling a command, and for reading it if it is a file."""

    stated_rate: Annotated[
        float | None,
        typer.Option(
            "--rate",
            metavar="HZ",
            help="Sampling rate, 10 to 100000 Hz.",
            show_default=f"{STANDARD_RATE:g} for a drive",
        ),
    ] = None
    interpolation: Annotated[
        Interpolation | None,
        typer.Option(help="Input between rows: linear, or zero-order hold. Required with a FILE."),
    ] = None
    time_column: Annotated[
        str, typer.Option(metavar="NAME", help="Column of the time in FILE.")
    ] = "time"
    stated_column: Annotated[
        str | None,
        typer.Option(
            "--column",
            metavar="NAME",
            help="Column in FILE of the voltage, or of the first input.",
            show_default=VOLTAGE,
        ),
    ] = None

    @property
    def rate(self) -> float:
        """Samples a second. [Hz]"""
        return STANDARD_RATE if self.stated_rate is None else self.stated_rate

    @property
    def column(self) -> str:
        """Column of the voltage."""
        return self.stated_column or VOLTAGE

    def __post_init__(self) -> None:
        """Refuse a rate out of range, before anything is sampled."""
        from swashplate.machine.marching import least_substeps

        least_substeps(self.rate)


@dataclass(frozen=True)
class Simulating(CommandSampling):
    """Options for sampling a command and simulating it."""

    start: Annotated[
        Start, typer.Option(help="Start from rest at 0 V, or settled at the first voltage.")
    ] = "rest"
    clip: Annotated[
        bool,
        typer.Option(
            "--clip",
            metavar=NO_VALUE,
            help="Clip a command beyond its range, of a drive ±10 V, instead of refusing it.",
        ),
    ] = False
    measured: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=COLUMN",
            help=(
                "Further input as a column of FILE, or as a number in SI units: pump_speed (1 at "
                "the speed of Z10), load_torque or supply_pressure of a drive, any of a machine "
                "of your own; may be repeated."
            ),
        ),
    ] = None
