"""Draws from what a fit left on disk: the whole fit with its campaign, or standard errors."""

from __future__ import annotations

from json import JSONDecodeError, loads
from pathlib import Path

from swashplate.analysis.draws import Draws, independent_drives
from swashplate.analysis.monte_carlo import drives
from swashplate.campaign.campaign import Campaign
from swashplate.documents import read_text
from swashplate.drive import Drive
from swashplate.errors import FileError, InputError
from swashplate.identification.assessment import assess
from swashplate.identification.storing import load_fit
from swashplate.parameters.definitions import CATALOGUE, COLUMNS

STORED, ESTIMATES, FITTED = "fit.json", "estimates.csv", "drive.toml"
"""Files of a fit."""


def stored_draws(
    folder: str | Path,
    *,
    drive: Drive | None = None,
    campaign: str | Path | None = None,
    draws: int = 200,
    seed: int = 0,
) -> Draws:
    """Drives that the tests allow, from the folder that a fit wrote.

    Parameters
    ----------
    folder : path
        With ``fit.json``, or with ``drive.toml`` and ``estimates.csv``, which know nothing of
        correlations.
    drive : Drive, optional
        What the draws are to belong to: refused if it is not the fitted one.
    campaign : path, optional
        The tests that were fitted; by default where ``fit.json`` says they were. They are needed
        for the whole covariance.
    draws, seed :
        As of `monte_carlo.drives`.

    Raises
    ------
    FileError, InputError, ParameterError
        If the folder holds neither, or campaign or drive are not those of the fit.
    """
    place = Path(folder)
    if (place / STORED).is_file():
        tests = _campaign_of(place / STORED) if campaign is None else Path(campaign)
        if campaign is None and not tests.is_file():
            raise InputError(
                f"{place / STORED} was fitted to {tests}, which is not there: say where the "
                "campaign is."
            )
        stored = load_fit(place / STORED, Campaign.from_toml(tests))
        _check_same(drive, stored.fit.drive, place)
        return drives(assess(stored.fit.stages), draws, seed)
    if not (place / ESTIMATES).is_file():
        raise InputError(
            f"{place} holds neither {STORED} nor {ESTIMATES}: give a folder that a fit wrote."
        )
    fitted = Drive.from_toml(place / FITTED)
    _check_same(drive, fitted, place)
    errors, left_out = _standard_errors(place / ESTIMATES)
    made = independent_drives(fitted, errors, draws, seed)
    return Draws(made.drives, made.redrawn, left_out, correlated=False)


def _check_same(drive: Drive | None, fitted: Drive, place: Path) -> None:
    if drive is None:
        return
    given, found = drive.parameters.numbers, fitted.parameters.numbers
    other = [name for name, value in found.items() if given[name] != value]
    if other:
        raise InputError(
            f"The fit in {place} is that of another drive ({', '.join(other[:3])} differ): give "
            f"the drive that it found, {place}."
        )


def _campaign_of(path: Path) -> Path:
    try:
        content = loads(read_text(path))
        return Path(content["campaign"])
    except (JSONDecodeError, KeyError, TypeError) as error:
        raise FileError(f"{path} is no stored fit: {error}.") from None


def _standard_errors(path: Path) -> tuple[dict[str, float], tuple[str, ...]]:
    """Standard errors of parameters, and the unknowns of the machine that have none."""
    import polars as pl
    from polars.exceptions import PolarsError

    try:
        table = pl.read_csv(path)
    except (OSError, PolarsError) as error:
        raise FileError(f"{path} cannot be read: {error}.") from None
    missing = {"unknown", "standard error"} - set(table.columns)
    if missing:
        raise FileError(f"{path} has no column '{min(missing)}'; give what 'swashplate fit' wrote.")
    errors: dict[str, float] = {}
    left_out = []
    for row, (name, given) in enumerate(table.select("unknown", "standard error").rows(), start=2):
        if name not in CATALOGUE and name not in COLUMNS:
            if "(" not in str(name):  # a number of one test, such as its free zero
                left_out.append(str(name))
        elif given is None:
            left_out.append(name)
        else:
            errors[name] = _number(given, path, row)
    if not errors:
        raise FileError(f"{path} has no parameter with a standard error: nothing can be drawn.")
    return errors, tuple(left_out)


def _number(text: object, path: Path, row: int) -> float:
    try:
        return float(str(text))
    except ValueError:
        raise FileError(f"{path}, row {row}: the standard error '{text}' is no number.") from None
