"""Drives of a crane: their forms, their sources, and the verdicts on their fits."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from swashplate.crane.axes import AXES
from swashplate.documents import parse_toml, read_text
from swashplate.drive import Drive
from swashplate.errors import ParameterError, SwashplateError
from swashplate.parameters import UNUSABLE as UNUSABLE
from swashplate.parameters import preset_names

if TYPE_CHECKING:
    from swashplate.identification import Verdict

DRIVE_FILE, FIT_FILE = "drive.toml", "fit.json"
"""Files in the folder of a fit: the drive, and the fit itself with its verdict."""


class Fitted(Protocol):
    """Result of a fit, as far as a crane uses it; its `verdict`, too, if it has one."""

    @property
    def drive(self) -> Drive:
        """The drive that was fitted."""
        ...


DriveLike = Drive | Fitted | str | Path


class DriveSource(NamedTuple):
    """Origin of the drive of an axis, and the verdict on its fit."""

    origin: str
    """Its file, or how it was given."""
    fit: Path | None
    """Folder of the fit that found it; None if there is none, or it was changed since."""
    fit_usable: bool | None
    """Whether the verdict on that fit calls it usable; None if no verdict is known."""
    verdict: str
    """Headline of the verdict, or the clause why none is known."""
    validity: str = ""
    """Sentence that says what the verdict holds for; empty if that is not known."""
    fastest_sine: float = 0.0
    """Highest frequency of the sines of its tests; 0 if that is not known. [Hz]"""

    @property
    def usable(self) -> bool:
        """Whether the fit is usable; without a verdict it counts as usable."""
        return self.fit_usable is not False

    def description(self) -> str:
        """Describe the drive's origin, the verdict on its fit and the range it holds for.

        It ends a sentence, and may go on with another one.
        """
        if self.fit_usable is None:
            return f"{self.origin}; its verdict is not known: {self.verdict}."
        return f"{self.origin}; the verdict on its fit is: {self.verdict} {self.validity}".rstrip()

    def sentence(self, axis: str) -> str:
        """The same of the drive of an axis."""
        return f"The {axis}'s drive is {self.description()}"


def drives_of(
    drive_likes: Mapping[Any, DriveLike], folder: Path
) -> tuple[dict[str, Any], dict[str, DriveSource]]:
    """Drives by axis, and the sources of those that come from a file or a fit.

    Parameters
    ----------
    drive_likes : mapping of str to drive, fit, str or path
        As `Crane.with_drive` takes them.
    folder : path
        Where files and folders of fits are looked for; packaged names go first.

    Raises
    ------
    ParameterError, FileError
        For a file that is not there or not a drive's, and a drive of another axis.
    """
    drives: dict[str, Any] = {}
    sources: dict[str, DriveSource] = {}
    for axis, drive_like in drive_likes.items():
        drive, path = _drive(drive_like, folder, axis)
        # a packaged drive or a Drive is put onto another axis knowingly, a fit or file hardly
        deliberate = isinstance(drive_like, Drive) or str(drive_like) in preset_names()
        if not deliberate and drive.name in AXES and drive.name != axis:
            raise ParameterError(
                f"{axis}: {path or 'the fit'} has a drive of the {drive.name}. If it moves the "
                f"{axis} as well, give it another name."
            )
        drives[axis] = drive
        source = _source(drive_like, drive, path)
        if source is not None:
            sources[axis] = source
    return drives, sources


def _drive(drive_like: DriveLike, folder: Path, axis: str) -> tuple[Drive, Path | None]:
    """The drive of an axis as it is given, and its file, if it has one."""
    if not isinstance(drive_like, str | Path):
        drive = getattr(drive_like, "drive", drive_like)
        if isinstance(drive, Drive):
            return drive, None
    elif str(drive_like) in preset_names():
        return Drive.preset(str(drive_like)), None
    elif (path := folder / drive_like).is_dir() or path.suffix == ".toml":
        path = path / DRIVE_FILE if path.is_dir() else path
        if path.is_file() and "runs" in parse_toml(read_text(path), str(path)):
            raise ParameterError(
                f"{axis}: {path} is a campaign: fit it first, and give the folder of the fit."
            )
        return Drive.from_toml(path), path
    raise ParameterError(
        f"{axis}: a crane's drive is a packaged one, {', '.join(preset_names())}, a .toml file, or "
        f"the result or folder of a fit, but there is no such '{drive_like}'."
    )


# --- verdicts -------------------------------------------------------------------------------------


def _source(drive_like: DriveLike, drive: Drive, path: Path | None) -> DriveSource | None:
    """Find the origin of a drive; None for a packaged one, and a `Drive` without an origin."""
    if path is not None:
        return _source_of_file(path, drive)
    if isinstance(drive_like, str | Path):
        return None
    stated = drive.parameters.doubt
    if isinstance(drive_like, Drive):
        if not stated:
            return None
        return DriveSource(f"'{drive.name}'", fit=None, fit_usable=False, verdict=stated)
    verdict = getattr(drive_like, "verdict", None)
    if verdict is None:
        return DriveSource(
            "that of a fit", fit=None, fit_usable=None, verdict="the fit was not assessed"
        )
    return _assessed_source("that of a fit", None, verdict)


def _assessed_source(origin: str, fit: Path | None, verdict: Verdict) -> DriveSource:
    """The source of a drive whose fit was assessed."""
    return DriveSource(
        origin=origin,
        fit=fit,
        fit_usable=verdict.usable,
        verdict=verdict.headline,
        validity=verdict.validity,
        fastest_sine=verdict.fastest_sine,
    )


def _source_of_file(path: Path, drive: Drive) -> DriveSource:
    """The source of a drive's file, with the verdict of the fit next to it."""
    stored = path.with_name(FIT_FILE)
    fit = None
    unknown_because = "there is no fit next to it"
    if path.name == DRIVE_FILE and stored.is_file():
        fit = path.parent
        verdict, unknown_because = _stored_verdict(stored, drive)
        if verdict is not None:
            return _assessed_source(str(path), fit, verdict)
    stated = drive.parameters.doubt
    if stated:
        return DriveSource(str(path), fit=fit, fit_usable=False, verdict=stated)
    return DriveSource(str(path), fit=fit, fit_usable=None, verdict=unknown_because)


def _stored_verdict(path: Path, drive: Drive) -> tuple[Verdict | None, str]:
    """The verdict of a stored fit on a drive; None and the clause why if it is not known."""
    # only what comes from a fit needs the identification
    from swashplate.identification import read_verdict

    try:
        stored = read_verdict(path)
    except SwashplateError as error:
        return None, f"the fit next to it cannot be read ({str(error).rstrip('.')})"
    if stored is None:
        return None, f"{path} has none: fit again"
    if stored.numbers != dict(drive.parameters.numbers):
        return None, f"it is not the drive that {path} was written with"
    return stored.verdict, ""
