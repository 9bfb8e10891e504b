"""The result of an identification: a fit, its campaign and verdict; its folder on disk."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from functools import cached_property
from html import escape
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, Field, model_validator
from tomlkit import dumps

from swashplate.__about__ import __version__
from swashplate.campaign import Between, Campaign, Experiment
from swashplate.documents import read_json
from swashplate.drive import Drive, KeyNumbers, RunKeywords
from swashplate.entries import Document, FileTable
from swashplate.errors import DomainError, FileError, InputError, MissingFileError
from swashplate.identification import tables
from swashplate.identification.band import Band, speed_band
from swashplate.identification.diagnostics.verdict import REQUIRED, Verdict, assess_fit
from swashplate.identification.estimation.drive_model import limits_unreached
from swashplate.identification.estimation.fit_problem import (
    Parameters,
    problem_of,
    smooth,
    with_estimates,
)
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.posterior import Posterior
from swashplate.identification.estimation.problem import Problem
from swashplate.identification.estimation.setup import FitSetup, setup_text
from swashplate.identification.estimation.solving import Solution
from swashplate.identification.estimation.unknowns import Unknown, Unknowns
from swashplate.identification.fitting import Estimated, Fit, fingerprint
from swashplate.identification.optimum import Interval, Optimum
from swashplate.identification.statistics.experiment_design import Commands, commands_each_way
from swashplate.identification.statistics.intervals import Estimate, estimates_of, intervals_of
from swashplate.identification.statistics.left_open import posterior_of
from swashplate.identification.statistics.profiles import Profile
from swashplate.identification.validation import RunQuality, predict
from swashplate.locks import locked
from swashplate.machine.marching import SOURCE_RATE, Start
from swashplate.maneuvers import Maneuver
from swashplate.parameters import (
    FITTED_DRIVE,
    FITTED_NUMBERS,
    NEUTRAL,
    LoggedCommand,
    Motion,
    ParameterSet,
    dump_set,
    read_set,
)
from swashplate.progress import working
from swashplate.results import folded, listing
from swashplate.tables import Table, write_text

if TYPE_CHECKING:
    import polars

SETUP_FILE, ESTIMATES, STORED = "setup.toml", "estimates.csv", "fit.json"
"""In a fit's folder, next to the drive or the model's numbers: the fit setup, the table of
estimates, and what the fit keeps of itself."""


@dataclass(frozen=True, eq=False)
class Identification(Estimated):
    """Result of `identify`: a fitted drive or user-defined model, and what it is worth.

    Estimates are there by name. Intervals and verdict are computed when they are first asked for,
    or read from the folder that a result was loaded from.

    Examples
    --------
    >>> from swashplate import Identification, identify, maneuvers, rig
    >>> tests = rig.run("hoist", {"step": maneuvers.step(9.0), "sine": maneuvers.sine(9.0, 0.1)})
    >>> file = rig.write(tests, "measured")
    >>> result = identify(file, "hoist", {"Z8": (0.5, 2), "Z16": (0.5, 2)})
    >>> low, high = result["Z8"].interval
    >>> low < result["Z8"].value < high
    True
    >>> [path.name for path in result.save("fitted")]
    ['drive.toml', 'setup.toml', 'estimates.csv', 'fit.json']
    >>> Identification.load("fitted")["Z8"].value == result["Z8"].value
    True
    """

    campaign: Campaign
    fit: Fit
    """What was estimated, and from what it began."""
    profiles: Sequence[Profile] = ()
    notes: Mapping[str, str] = field(default_factory=dict)
    """Versions, seed, campaign."""
    required: float = REQUIRED
    """Largest error of a prediction over the range of its signal. [1]"""
    stored: StoredVerdict | None = field(default=None, repr=False)
    """The verdict that the fit's folder holds."""

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """Every number of the machine by name, estimated or fixed, and those of single runs."""
        return self.fit.estimates

    def to_polars(self) -> polars.DataFrame:
        """What was estimated, one row for each parameter, SI; what ``estimates.csv`` holds.

        Columns are parameter, unit, nominal, value, lower and upper (ends of the 95 %
        interval), standard_error and status.
        """
        return tables.all_estimates(self.fit).to_polars()

    @cached_property
    def drive(self) -> Drive:
        """The fitted drive, in which each parameter says whether it was fitted or fixed.

        Raises
        ------
        InputError
            If a user-defined model was fitted: its numbers are those of ``fit.parameters``.
        """
        return Drive(replace(self.fit.drive.parameters, **self._origins()))

    @property
    def held_out(self) -> tuple[Experiment, ...]:
        """Runs of the axis that were held out."""
        fitted = self.fit.runs
        names = {run.name for run in fitted}
        held_out = self.campaign.select(axis=fitted[0].axis, role="validate")
        return tuple(run for run in held_out if run.name not in names)

    @cached_property
    def predicted(self) -> tuple[RunQuality, ...]:
        """Runs of the axis that were held out, predicted."""
        return predict(self.fit.parameters, self.held_out, self.posterior)

    @cached_property
    def posterior(self) -> Posterior:
        """What the fit leaves open of the machine's numbers; nothing if that is not known."""
        if self.stored is not None and self.stored.posterior is not None:
            return self.stored.posterior
        try:
            return posterior_of(self.fit)
        except InputError:  # no more samples than unknowns
            return Posterior((), np.zeros((0, 0)))

    @cached_property
    def verdict(self) -> Verdict:
        """What it can be used for."""
        if self.stored is not None and self.stored.holds_for(self):
            return self.stored.verdict
        with working("Judging the fit"):
            return assess_fit(
                self.fit,
                self.predicted,
                required=self.required,
                posterior=self.posterior,
            )

    def band(
        self,
        voltage: ArrayLike | Maneuver,
        rate: float = SOURCE_RATE,
        *,
        start: Start = "rest",
        **keywords: Unpack[RunKeywords],
    ) -> Band:
        """Simulate the fitted drive, with the band in which the machine's own speed lies.

        Parameters
        ----------
        voltage, rate, start, **keywords :
            As of `Drive.simulate`.

        Returns
        -------
        Band
            Speed, and both ends of a band of 95 %.

        Raises
        ------
        InputError
            As `Drive.simulate`; for a user-defined model; and if no run of the fit measured how the
            shaft moves.
        """
        drive = self.fit.drive
        run = drive.simulate(voltage, rate, start=start, **keywords)
        band = speed_band(drive, run, self.verdict, self.posterior)
        if band is None:
            raise InputError("No run of the fit moved: nothing is known of the error of a speed.")
        return band

    @cached_property
    def key_numbers(self) -> KeyNumbers | None:
        """The numbers that matter of the drive, with 95 % intervals; None of a user-defined model.

        See `swashplate.analysis.key_numbers`.
        """
        if self.fit.setup.part == "model":
            return None
        if self.stored is not None and self.stored.numbers == dict(self.fit.parameters.numbers):
            return self.stored.key_numbers
        # by name, as it stands above this package
        answers = import_module("swashplate.analysis")
        with working("Computing the numbers that matter"):
            return cast(
                "KeyNumbers", answers.numbers_of_fit(self.drive, self.fit, self.verdict.predictions)
            )

    def tables(self) -> list[Table]:
        """Numbers that matter, stated errors, estimates, profiles, runs."""
        part_tables = [table for part in parts_of(self) for table in part.tables]
        return [*_number_tables(self), self.verdict.table(), *part_tables]

    def summary(self) -> str:
        """Text: the verdict and the numbers that matter, then the tables of the command ``fit``."""
        single = "\n".join(tables.single_runs_line(self.fit))
        numbers = [*map(str, _number_tables(self)), *(self.key_numbers or _NONE).sentences]
        parts = [self.verdict.summary(), "\n".join(numbers), *map(str, parts_of(self)), single]
        return "\n\n".join(part for part in parts if part)

    def _repr_html_(self) -> str:
        parts, estimates, details = parts_of(self), "", ""
        for part in parts:
            if part.opened:
                estimates += "".join(table._repr_html_() for table in part.tables)
            visible_tables = () if part.opened else part.tables
            details += folded(part.title, visible_tables, [*part.remarks, *part.sentences])
        for line in tables.single_runs_line(self.fit):
            estimates += f"<p>{escape(line)}</p>"
        numbers = "".join(table._repr_html_() for table in _number_tables(self))
        numbers += listing((self.key_numbers or _NONE).sentences)
        return f"{self.verdict.html(numbers + estimates)}{details}"

    @property
    def headline(self) -> str:
        """The verdict in one sentence."""
        return self.verdict.headline

    @property
    def sentences(self) -> tuple[str, ...]:
        """What the verdict says besides its answers."""
        return self.verdict.sentences

    def report(self, path: str | Path, *, truth: Drive | ParameterSet | None = None) -> Path:
        """Write the report: one HTML file, whole or not at all, that needs no network.

        Parameters
        ----------
        path : path
            The file, which replaces an older one.
        truth : Drive or ParameterSet, optional
            What virtual tests were simulated with; it is shown next to the estimates.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        # by name, as it stands above this package
        pages = import_module("swashplate.report.fit_report")
        true = truth.parameters if isinstance(truth, Drive) else truth
        pages.write_fit_report(self, path, truth=true)
        return Path(path)

    def save(self, folder: str | Path) -> tuple[Path, ...]:
        """Write the folder that `load`, `Drive.from_toml` and every command read.

        Of a drive these are ``drive.toml`` and the fit setup ``setup.toml``, of a
        user-defined model its numbers, ``parameters.toml``; of both ``estimates.csv`` and
        ``fit.json``. Samples stay in the campaign; a fingerprint of each run is stored. Older files
        of these names are replaced, each whole or not at all.

        Returns
        -------
        tuple of Path
            The files in the order in which they were written.

        Raises
        ------
        FileError
            If one cannot be written, or another process, or another thread, is writing a fit into
            the folder.
        """
        place = Path(folder)
        with locked(place):
            return self._written(place)

    def _written(self, place: Path) -> tuple[Path, ...]:
        """See `save`."""
        parameters = self.fit.parameters
        if isinstance(parameters, ModelSetup):
            numbers = {name: float(value) for name, value in parameters.numbers.items()}
            files = {FITTED_NUMBERS: dumps({parameters.name: numbers})}
        else:
            files = {
                FITTED_DRIVE: dump_set(self.drive.parameters),
                SETUP_FILE: setup_text(self.fit.setup),
            }
        for name, text in files.items():
            write_text(text, place / name)
        self.write(place / ESTIMATES)
        stored = self._stored(place).model_dump_json(indent=1, by_alias=True)
        write_text(stored + "\n", place / STORED)
        return tuple(place / name for name in (*files, ESTIMATES, STORED))

    @classmethod
    def load(
        cls,
        path: str | Path,
        campaign: str | Path | Campaign | None = None,
        *,
        model: str | Path | ModelSetup | None = None,
        threads: int | None = None,
    ) -> Identification:
        """Read back what `save` or ``swashplate fit`` wrote, without fitting again.

        Parameters
        ----------
        path : path
            The folder, or a file in it.
        campaign : path or Campaign, optional
            The tests that were fitted; by default where the fit found them.
        model : ModelSetup or path, optional
            The user-defined model that was fitted, or the Python file that states it; the folder
            does not have it.
        threads : int, optional
            As of `fit`.

        Raises
        ------
        FileError
            If there is no fit, the campaign is not there any more, or another version of the
            package wrote it.
        InputError
            If a run of the campaign is not as it was; the sentence names it.
        """
        place = Path(path)
        file = place.with_name(STORED) if place.is_file() else place / STORED
        if not file.is_file():
            raise MissingFileError(
                f"There is no {STORED} in {file.parent}: give a folder that 'swashplate fit' or "
                "Identification.save wrote."
            )
        if isinstance(model, str | Path):
            model = ModelSetup.from_file(model)
        return _loaded(file, campaign, model, threads)

    def _stored(self, folder: Path) -> FitFile:
        """What ``fit.json`` holds in a folder."""
        start = self.fit.nominal
        return FitFile(
            swashplate=__version__,
            axis=self.fit.runs[0].axis,
            campaign=_seen_from(folder, self.campaign.path),
            runs={run.name: fingerprint(run) for run in self.fit.runs},
            interpolation=self.fit.runs[0].input.interpolation,
            nominal=dict(start.numbers) if isinstance(start, ModelSetup) else dump_set(start),
            setup=self.fit.setup,
            unknowns=self.fit.problem.unknowns.items,
            solution=self.fit.solution,
            starts=self.fit.starts,
            intervals=intervals_of(self.fit),
            profiles=tuple(self.profiles),
            notes=dict(self.notes),
            verdict=StoredVerdict(
                verdict=self.verdict,
                numbers=dict(self.fit.parameters.numbers),
                required=self.required,
                held_out={run.name: fingerprint(run) for run in self.held_out},
                posterior=self.posterior,
                key_numbers=self.key_numbers,
            ),
        )

    def _origins(self) -> dict[str, Any]:
        """Title and motion of the fitted set, and where each of its parameters comes from.

        Of a fitted one the source is campaign, date and 95 % interval; of a fixed one that of the
        set which the fit began from. The title of one that is not usable says so. A machine that
        began at the start for any machine is called like its axis. Estimates and limits that no
        run reached are computed for this.
        """
        fitted_set = self.fit.drive.parameters
        nominal = self.fit.nominal
        assert isinstance(nominal, ParameterSet)
        today = f"{date.today():%d %b %Y}"
        ends = _interval_words(self.fit, fitted_set)
        parameters = dict(fitted_set.parameters)
        for symbol, parameter in parameters.items():
            if symbol in ends:
                source = f"{self.campaign.path.name}, {today}; 95 %: {'; '.join(ends[symbol])}"
                parameters[symbol] = replace(parameter, status="fitted", source=source)
            elif parameter.status != "inactive":
                earlier_source = nominal.parameters.get(symbol, parameter).source
                source = f"{nominal.name}: {earlier_source}" if earlier_source else nominal.name
                parameters[symbol] = replace(parameter, status="fixed", source=source)
        fitted = len(self.fit.problem.experiments)
        title = f"{self.campaign.title}: fitted to {fitted} runs, {today}"
        if not self.verdict.usable:
            title += f". {self.verdict.headline.rstrip('.')}"
        return {
            "name": self.fit.runs[0].axis if fitted_set.name == NEUTRAL else fitted_set.name,
            "title": title,
            "parameters": parameters,
            "motion": motion_of(self.fit.runs),
            "unreached": self._unreached(),
            "tested": tested_commands(self.fit.runs),
            "command": logged_command(self.campaign, self.fit.runs[0].axis),
        }

    def _unreached(self) -> dict[str, float]:
        """Limits that the fitted runs do not reach; none of a drive that cannot be simulated."""
        try:
            return limits_unreached(self.fit.runs, self.fit.drive.parameters)
        except (DomainError, InputError):
            return {}


def parts_of(result: Identification) -> list[tables.FitPart]:
    """Sentences of a fit besides its verdict, in the order in which the command prints it."""
    fit = result.fit
    notes = [overview.sentence for overview in result.campaign.overviews]
    notes += [f"{run.name}: {sentence}." for run in fit.runs for sentence in run.notes]
    doubts = [f"! {sentence}" for sentence in fit.doubts]
    parts = [tables.FitPart("Runs", (), (), notes), tables.FitPart("Doubts", (), doubts)]
    parts.append(tables.estimates_part(fit))
    if result.profiles:
        sentences = [sentence for profile in result.profiles for sentence in profile.sentences()]
        table = tables.profiles_table(result.profiles, fit)
        parts.append(tables.FitPart("Profile likelihoods", [table], (), sentences))
    parts.append(tables.fixed_part(fit))
    fitted = tables.runs_tables(fit.qualities)
    parts.append(tables.FitPart("Errors of fitted runs", fitted, heading="Runs that were fitted"))
    if result.predicted:
        errors = tables.runs_tables(result.predicted)
        heading = "Runs that were held out and predicted"
        parts.append(tables.FitPart("Errors of held-out runs", errors, heading=heading))
    return [part for part in parts if part.tables or part.remarks or part.sentences]


def tested_commands(runs: Iterable[Experiment]) -> Commands | None:
    """Largest command each way of some runs, magnitudes, 0 for a way that none goes. [V]

    To three digits, as more are the log's noise; None if no run is driven by a voltage.
    """
    plus, minus = commands_each_way(
        (float(run.input.values.min()), float(run.input.values.max()))
        for run in runs
        if run.input.kind == "voltage"
    )
    return (float(f"{plus:.3g}"), float(f"{minus:.3g}")) if plus or minus else None


def logged_command(campaign: Campaign, axis: str) -> LoggedCommand | None:
    """How the logs of a campaign's axis hold the command, unless as the volts of the card."""
    entry = campaign.axes[axis].input if axis in campaign.axes else None
    if entry is None or entry.kind != "voltage":
        return None
    command = LoggedCommand(entry.column, entry.unit or "", entry.scale, entry.offset, entry.sign)
    return None if command.is_voltage else command


def _number_tables(result: Identification) -> list[Table]:
    """Table of the numbers that matter; none of a user-defined model."""
    return [] if result.key_numbers is None else [result.key_numbers.table()]


_NONE = KeyNumbers("", (0.0, 0.0), ())
"""Those of a machine that has none."""


def motion_of(runs: Iterable[Experiment]) -> Motion:
    """What the drive of some runs moves: a rod if all positions were measured in m.

    Without positions, a rod if all speeds are in m/s.
    """
    channels = [channel for run in runs for channel in run.channels.values()]
    units = {channel.unit for channel in channels if channel.is_position}
    units = units or {channel.unit for channel in channels if channel.kind == "shaft_speed"}
    return "rod" if units and units <= {"m", "m/s"} else "shaft"


def _interval_words(fit: Optimum, fitted: ParameterSet) -> dict[str, list[str]]:
    """Intervals of the fitted parameters in words, by symbol."""
    texts_by_symbol: dict[str, list[str]] = {}
    for estimate, unknown in zip(estimates_of(fit), fit.problem.unknowns, strict=True):
        if unknown.kind == "force":
            forces = ("Z19", "Z20", "Z21", "Z22")
            texts_by_symbol |= {symbol: ["from the fitted forces"] for symbol in forces}
        elif unknown.run is None:
            ends = " to ".join(filter(None, estimate.ends()))
            for target in (target for target in unknown.targets if target in fitted.numbers):
                side = target.rpartition("_")[2]
                side = f"{side} " if side in ("plus", "minus") else ""
                symbol = fitted.definitions.find(target).symbol
                texts_by_symbol.setdefault(symbol, []).append(f"{side}{ends}")
    return texts_by_symbol


def _seen_from(folder: Path, path: Path) -> str:
    """A path as it is found from a folder, so that both may be moved together."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive of Windows
        return str(path.resolve())


def versions() -> dict[str, str]:
    """Versions of this package and of Python."""
    return {"swashplate": __version__, "Python": platform.python_version()}


# --- files ----------------------------------------------------------------------------------------


class StoredVerdict(FileTable):
    """The verdict on the fit when it was stored, and what it rests on."""

    verdict: Verdict
    numbers: dict[str, float]
    """Of the drive or model that it is about."""
    required: float = REQUIRED
    """See `Identification`."""
    held_out: dict[str, str] = Field({})
    """Name to fingerprint of each run that was held out."""
    posterior: Posterior | None = None
    """What the fit leaves open of its numbers; None in a file that does not have it."""
    key_numbers: KeyNumbers | None = None
    """The numbers that matter of the drive; None of a user-defined model."""

    def holds_for(self, result: Identification) -> bool:
        """Whether it is the verdict on these numbers, requirement and runs held out."""
        return (
            self.required == result.required
            and self.numbers == dict(result.fit.parameters.numbers)
            and self.held_out == {run.name: fingerprint(run) for run in result.held_out}
        )


class FitFile(Document):
    """The whole file."""

    swashplate: str
    axis: str
    campaign: str
    """Path of the campaign file, from the folder of this one."""
    runs: dict[str, str]
    """Name to fingerprint of each run that was fitted, in their order."""
    interpolation: Between = "linear"
    """What the input is between samples, as the fit took it."""
    nominal: str | dict[str, float]
    """What the fit began from: a drive's parameter file, or the numbers of a user-defined model."""
    setup: FitSetup
    unknowns: tuple[Unknown, ...]
    """With what their priors are worth."""
    solution: Solution
    starts: tuple[Solution, ...]
    intervals: tuple[Interval, ...] | None = None
    """Of the unknowns; None if they were never computed."""
    profiles: tuple[Profile, ...]
    notes: dict[str, str]
    verdict: StoredVerdict | None = None
    """None in a file of a version that did not store it."""

    @model_validator(mode="before")
    @classmethod
    def _of_an_earlier_version(cls, content: Any) -> Any:
        if isinstance(content, Mapping) and "stages" in content:
            raise ValueError("it is a fit in stages, of an earlier version: fit again")
        return content

    @model_validator(mode="after")
    def _fitted(self) -> FitFile:
        if not self.runs:
            raise ValueError("it names no run that was fitted: fit again")
        return self


class _VerdictAlone(BaseModel):
    """What every version's file has of a verdict."""

    verdict: StoredVerdict | None = None


def read_verdict(path: str | Path) -> StoredVerdict | None:
    """The verdict that a stored fit had, without its campaign; None if the file has none.

    A `FileError` or `ParameterError` if the file is not one that `Identification.save` wrote.
    """
    return read_json(path, _VerdictAlone, strict=False).verdict


def _loaded(
    path: Path,
    tests: str | Path | Campaign | None,
    model: ModelSetup | None,
    threads: int | None,
) -> Identification:
    """See `Identification.load`."""
    file = read_json(path, FitFile, strict=False)
    if file.swashplate != __version__:
        raise FileError(
            f"{path} was written by swashplate {file.swashplate}, this is {__version__}: fit again."
        )
    campaign = _campaign_of(path, file, tests)
    runs = _runs_of(path, file, campaign)
    nominal = _nominal_of(path, file, model, runs)
    problem = _stored_problem(path, file, nominal, runs, threads)
    result = Fit(
        setup=file.setup,
        nominal=nominal,
        runs=runs,
        problem=problem,
        solution=file.solution,
        parameters=with_estimates(smooth(nominal), problem, file.solution.vector),
        starts=file.starts,
        stored=file.intervals,
    )
    return Identification(
        campaign,
        result,
        profiles=_profiles_of(path, file, problem),
        notes=file.notes,
        required=REQUIRED if file.verdict is None else file.verdict.required,
        stored=file.verdict,
    )


def _campaign_of(path: Path, file: FitFile, tests: str | Path | Campaign | None) -> Campaign:
    """The campaign of a stored fit, by default the one that it names."""
    if tests is None:
        tests = Path(os.path.normpath(path.parent / file.campaign))
        if not tests.is_file():
            raise MissingFileError(
                f"{path} was fitted to {tests}, which does not exist: name the campaign."
            )
    campaign = tests if isinstance(tests, Campaign) else Campaign.from_toml(tests)
    if all(run.input.settled for run in campaign if run.axis == file.axis):
        return campaign
    return campaign.with_interpolation(file.axis, file.interpolation)


def _runs_of(path: Path, file: FitFile, campaign: Campaign) -> tuple[Experiment, ...]:
    """The runs of a stored fit; refused unless they are as they were when it was fitted."""
    runs = {run.name: run for run in campaign}
    for name, mark in file.runs.items():
        if name not in runs:
            raise InputError(
                f"{path} was fitted to the run '{name}', which {campaign.path} does not have: give "
                "the campaign of the fit, or fit again."
            )
        if fingerprint(runs[name]) != mark:
            raise InputError(
                f"The run '{name}' of {campaign.path} has changed since {path} was fitted (its "
                "samples, weights or ignored windows differ): name the campaign that was fitted, "
                "or fit again."
            )
    return tuple(runs[name] for name in file.runs)


def _nominal_of(
    path: Path, file: FitFile, model: ModelSetup | None, runs: Sequence[Experiment]
) -> Parameters:
    """Start of a stored fit."""
    if isinstance(file.nominal, str):
        return read_set(file.nominal, str(path))
    if model is None:
        raise InputError(
            f"{path} is the fit of a user-defined model, which it does not contain: give the "
            "model, in Python as model=, on the command line as --model FILE."
        )
    nominal = model.nominal(runs)
    if nominal.setup != file.setup:
        raise InputError(f"{path} belongs to another model or other bounds: fit again.")
    return nominal


def _stored_problem(
    path: Path,
    file: FitFile,
    nominal: Parameters,
    runs: Sequence[Experiment],
    threads: int | None,
) -> Problem:
    """The problem of a stored fit; refused unless it has the unknowns that were stored."""
    problem = problem_of(file.setup, smooth(nominal), runs, threads=threads)
    lengths = {file.solution.vector.size, len(file.unknowns)}
    if file.intervals is not None:
        lengths.add(len(file.intervals))
    has_same_unknowns = _identities(file.unknowns) == _identities(problem.unknowns)
    if not has_same_unknowns or len(lengths) > 1:
        raise FileError(f"{path} has other parameters than its fit setup: fit again.")
    unknowns = Unknowns(file.unknowns)
    low, high = unknowns.bounds
    rounding = 1e-6 * (high - low)
    vector = file.solution.vector
    if np.any(vector < low - rounding) or np.any(vector > high + rounding):
        raise FileError(f"{path} ends outside its bounds: fit again.")
    return replace(problem, unknowns=unknowns)


def _identities(unknowns: Iterable[Unknown]) -> list[tuple[str, str | None, str, str | None]]:
    return [(unknown.name, unknown.run, unknown.kind, unknown.channel) for unknown in unknowns]


def _profiles_of(path: Path, file: FitFile, problem: Problem) -> list[Profile]:
    """The stored profiles with their unknowns."""
    profiles = list[Profile]()
    for profile in file.profiles:
        if not 0 <= profile.index < len(problem.unknowns):
            raise FileError(f"{path} has a profile of a parameter that it does not have.")
        name, unknown = problem.unknowns.names[profile.index], problem.unknowns.items[profile.index]
        profiles.append(replace(profile, name=name, unknown=unknown))
    return profiles
