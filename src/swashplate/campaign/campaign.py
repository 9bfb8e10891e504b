"""Campaigns: a file that says what logs hold, and the experiments that are read from them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import schema
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.campaign.reading import (
    Columns,
    read_channel,
    read_input,
    wanted_columns,
    windows,
)
from swashplate.campaign.recognition import recognise
from swashplate.campaign.samples import ambiguous_gaps, unwrap_counts
from swashplate.campaign.schema import applying, ends, inside
from swashplate.documents import parse_toml, read_text, validated
from swashplate.errors import InputError
from swashplate.logs import Log, open_log
from swashplate.results import Result, figures
from swashplate.tables import Column as Head
from swashplate.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swashplate.drive import Drive

Array = NDArray[np.float64]
AnySignal = TypeVar("AnySignal", InputSignal, Channel)

LISTED = 12
"""Runs that a sentence names."""


@dataclass(frozen=True, eq=False)
class Campaign(Result):
    """Experiments on one machine, SI. Iterate it, or take one by its name.

    Examples
    --------
    >>> tests = Campaign.from_toml("harbour/campaign.toml")
    >>> tests["hoistr6"]["counts"].values
    """

    path: Path
    """The campaign file."""
    title: str
    virtual: bool
    """Whether the tests are simulated."""
    axes: Mapping[str, schema.Axis]
    experiments: tuple[Experiment, ...]
    ignored: tuple[str, ...] = ()
    """Runs with the role ``"ignore"``, whose logs were not opened."""

    @classmethod
    def from_toml(cls, path: str | Path, *, logs: str | Path | None = None) -> Campaign:
        """Read a campaign file and its logs.

        Parameters
        ----------
        path : path
            The campaign file.
        logs : path, optional
            Folder of the logs; by default that of the campaign file.

        Raises
        ------
        FileError
            If a file cannot be read; the sentence names file, row and column.
        ParameterError
            If an entry of the campaign file is wrong; the sentence names it.
        InputError
            If a column is missing, a unit wrong or a name taken twice.
        """
        file = read_campaign_file(path)
        folder = Path(path).parent if logs is None else Path(logs)
        experiments, ignored = list[Experiment](), list[str]()
        names = run_names(path, file)
        for number, (name, run) in enumerate(zip(names, file.runs, strict=True), 1):
            if run.role == "ignore":
                ignored.append(name)
                continue
            place = f"{path}: run {number} ({run.file})"
            log = open_log(folder / run.file, options=file.format)
            tested = axes_of(place, run, file.axes)
            for part in windows(tested.values(), log, run.span):
                experiments += read_run(place, name, run, file.axes, part)
        title = file.title or Path(path).resolve().parent.name
        return cls(Path(path), title, file.virtual, file.axes, tuple(experiments), tuple(ignored))

    def table(self) -> Table:
        """Its experiments: axis, role, maneuver, length and channels."""
        columns = (Head("run"), Head("axis"), Head("role"), Head("maneuver"))
        made = Table(self.title, (*columns, Head("s", ".4g"), Head("channels", wrap=True)))
        for each in self:
            made.add(
                each.name,
                each.axis,
                each.role,
                each.maneuver,
                each.duration,
                ", ".join(each.channels),
            )
        return made

    def plot(self, **how: Any) -> list[Figure]:
        """Figures of all runs, as of `swashplate.report.figures.plot_campaign`."""
        drawn: list[Figure] = figures().plot_campaign(self, **{"title": self.title, **how})
        return drawn

    def __iter__(self) -> Iterator[Experiment]:
        return iter(self.experiments)

    def __len__(self) -> int:
        return len(self.experiments)

    def __repr__(self) -> str:
        return f"Campaign({self.title!r}, {len(self)} experiments on {', '.join(self.axes)})"

    def __getitem__(self, name: str | int) -> Experiment:
        """An experiment by its name, or by its number from 0.

        Raises
        ------
        InputError
            If there is none of that name.
        IndexError
            If there are not so many.
        """
        if isinstance(name, int):
            return self.experiments[name]
        for each in self.experiments:
            if each.name == name:
                return each
        if any(name == run or name.startswith(f"{run} ") for run in self.ignored):
            raise InputError(f"{self.path}: the run '{name}' has the role 'ignore'.")
        names = [each.name for each in self.experiments]
        near = get_close_matches(name, names, 1)
        meant = f" (did you mean {near[0]}?)" if near else ""
        known = ", ".join(names[:LISTED])
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        raise InputError(f"{self.path} has no run '{name}'{meant}; it has {known}{more}.")

    def select(
        self, *, axis: str | None = None, role: schema.Role | None = None
    ) -> tuple[Experiment, ...]:
        """Its experiments of an axis, of a role, or both.

        Raises
        ------
        InputError
            If there is no such axis or role.
        """
        if axis is not None and axis not in self.axes:
            raise InputError(f"{self.path} has no axis '{axis}'; it has {', '.join(self.axes)}.")
        if role is not None and role not in get_args(schema.Role):
            raise InputError(
                f"There is no role '{role}': runs have {', '.join(get_args(schema.Role))}."
            )
        return tuple(
            each
            for each in self.experiments
            if axis in (None, each.axis) and role in (None, each.role)
        )

    def drive(self, axis: str) -> Drive:
        """The drive that an axis names.

        Raises
        ------
        InputError
            If there is no such axis, or it names no drive.
        FileError, ParameterError
            If the drive's parameter file is wrong.
        """
        from swashplate.drive import Drive

        self.select(axis=axis)
        name = self.axes[axis].drive
        if name is None:
            raise InputError(f'{self.path}: [axes.{axis}] names no drive; add drive = "hoist".')
        if name.lower().endswith(".toml"):
            return Drive.from_toml(self.path.parent / name)
        return Drive.preset(name)


def json_schema() -> str:
    """JSON Schema of a campaign file, for editors that complete and check while one writes."""
    made = schema.CampaignFile.model_json_schema(by_alias=True)
    made["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    made["title"] = "swashplate campaign"
    return json.dumps(made, indent=2) + "\n"


def read_campaign_file(path: str | Path) -> schema.CampaignFile:
    """Contents of a campaign file, without its logs.

    Raises
    ------
    FileError
        If it cannot be read or is not TOML.
    ParameterError
        If an entry is wrong; the sentence names it.
    """
    origin = str(path)
    return validated(parse_toml(read_text(path), origin), schema.CampaignFile, origin)


def run_names(path: str | Path, file: schema.CampaignFile) -> list[str]:
    """Names of the runs in their order, each its own.

    Raises
    ------
    InputError
        If two are the same.
    """
    names = [run.name or Path(run.file).stem for run in file.runs]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}: two runs are called '{name}'; give each a name of its own.")
    return names


# --- a run ----------------------------------------------------------------------------------------


def read_run(
    place: str, name: str, run: schema.Run, axes: Mapping[str, schema.Axis], log: Log
) -> Iterator[Experiment]:
    """Experiments of a run of a name, one for each axis that it tests, and one more for each split.

    `place` is the run, for sentences about the campaign file.

    Raises
    ------
    FileError, InputError, ParameterError
        For the first thing that is wrong; the sentence names file, column and row.
    """
    tested = axes_of(place, run, axes)
    columns = Columns(log, [each for axis in tested.values() for each in wanted_columns(axis)])
    for key, axis in tested.items():
        full = f"{name} {key}" if len(axes) > 1 else name
        yield from _experiments(full, name, key, run, axis, columns)


def axes_of(place: str, run: schema.Run, axes: Mapping[str, schema.Axis]) -> dict[str, schema.Axis]:
    """The axes that a run tests, with what differs in it."""
    for name in (*run.only, *run.axes):
        if name not in axes:
            raise InputError(
                f"{place} names the axis '{name}', but the axes are {', '.join(axes)}."
            )
    tested = {}
    for name in run.only or axes:
        axis, origin = axes[name], f"{place}: axes.{name}"
        changes = dict(run.axes.get(name, {}))
        given = changes.get("channels")
        for key, change in given.items() if isinstance(given, Mapping) else ():
            new = isinstance(change, Mapping) and "kind" in change
            if key not in axis.channels and not new:
                raise InputError(
                    f"{origin} changes the channel '{key}', but the axis has "
                    f"{', '.join(axis.channels)}; a new channel needs its kind and column."
                )
        if changes:
            content = _merged(axis.model_dump(by_alias=True, exclude_unset=True), changes)
            if not content["channels"]:
                raise InputError(f'{origin} has no channel left; say role = "ignore" instead.')
            axis = validated(content, schema.Axis, origin)
        tested[name] = axis
    return tested


def _merged(content: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A table with some entries replaced, tables within it merged in turn.

    Ignored windows are added to those that there are; false takes a channel out.
    """
    merged = dict(content)
    for key, value in changes.items():
        old = merged.get(key)
        if isinstance(old, dict) and isinstance(value, Mapping):
            merged[key] = _merged(old, value)
        elif isinstance(old, dict) and value is False:
            del merged[key]
        elif key == "ignore" and isinstance(old, (list, tuple)) and isinstance(value, list):
            merged[key] = [*old, *value]
        else:
            merged[key] = value
    return merged


def _experiments(
    name: str, run_name: str, key: str, run: schema.Run, axis: schema.Axis, columns: Columns
) -> Iterator[Experiment]:
    """One experiment, or several where a counter's position across a gap is not known."""
    drive = read_input(axis, columns, run.span)
    log, signals, cuts = columns.log, dict[str, Channel](), dict[float, str]()
    notes = [log.cut] if log.cut else []
    for name_of, entry in axis.channels.items():
        read = read_channel(name_of, axis, columns, run.span)
        if read is None:
            notes.append(f"'{name_of}' has no sample here and is left out of this run")
            continue
        signals[name_of] = read
        if entry.rolls_over_at is not None:
            for row in ambiguous_gaps(read.time, read.values, entry.rolls_over_at):
                gap = read.time[row] - read.time[row - 1]
                cuts[float(read.time[row])] = (
                    f"within the gap of {gap:.3g} s the counter '{name_of}', which begins anew "
                    f"after {entry.rolls_over_at}, may have gone round once more or less"
                )
    if not signals:
        raise InputError(
            f"{columns.log.path}: its channels have 0 samples that can be used; leave the run out "
            'with role = "ignore".'
        )
    unit = {"voltage": "V", "current": "A"}.get(drive.kind, drive.unit)
    edges = [-np.inf, *sorted(cuts), np.inf]
    for part, (begin, end) in enumerate(pairwise(edges)):
        given = _within(drive, begin, end)
        kept = {each: _within(read, begin, end) for each, read in signals.items()}
        kept = {each: read for each, read in kept.items() if read.time.size > 1}
        if given.time.size < 2 or not kept:
            continue
        said = list(notes) if part == 0 else []
        if np.isfinite(end):
            said.append(f"split at {end:.4g} s, from where it is a run of its own: {cuts[end]}")
        split = part > 0 or log.resumes
        recognised = recognise(given.time, given.values, unit=unit)
        maneuver = run.maneuver or recognised.name
        ignored = applying((*axis.ignore, *run.ignore), maneuver)
        yield Experiment(
            f"{name} from {given.time[0]:.6g} s" if part or log.cut else name,
            key,
            run_name,
            run.role,
            "estimated" if split else run.start or axis.start,
            None if split else run.start_pressure,
            given,
            {
                each: _finished(axis.channels[each], read, given, maneuver, ignored, run)
                for each, read in kept.items()
            },
            run.maneuver,
            recognised,
            tuple((*ends(each), each.why) for each in ignored),
            tuple(said),
        )


def _within(signal: AnySignal, begin: float, end: float) -> AnySignal:
    """The part of a signal from one instant to before another [s]."""
    kept = (signal.time >= begin) & (signal.time < end)
    if kept.all():
        return signal
    arrays: dict[str, Any] = {
        key: each[kept] for key, each in vars(signal).items() if isinstance(each, np.ndarray)
    }
    return replace(signal, **arrays)


def _finished(
    entry: schema.Channel,
    read: Channel,
    drive: InputSignal,
    maneuver: str,
    ignored: Sequence[schema.Window],
    run: schema.Run,
) -> Channel:
    """A channel whose counts are unwrapped, with the product of all factors that apply."""
    encoder, counts, values = read.encoder, read.counts, read.values
    if encoder is not None and counts is not None:
        if encoder.rolls_over_at is not None:
            try:
                counts = unwrap_counts(counts, encoder.rolls_over_at)
            except InputError as error:
                raise InputError(f"{read.source}: {error}") from None
        values = counts * encoder.angle_per_count
    weight = np.full(read.time.shape, run.weight * entry.weight)
    if entry.weight_by_input:
        levels, factors = np.transpose(entry.weight_by_input)
        weight *= np.interp(np.abs(drive.at(read.time)), levels, factors)
    for each in applying((*entry.weights, *run.weights), maneuver):
        weight[inside(each, read.time)] *= each.factor
    for window in (*ignored, *applying(entry.ignore, maneuver)):
        weight[inside(window, read.time)] = 0.0
    return replace(read, counts=counts, values=values, weight=weight)
