"""Campaigns: a file that says what logs hold, and the experiments that are read from them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, cast, get_args

import numpy as np

from swashplate.campaign import schema
from swashplate.campaign.experiment import Experiment
from swashplate.campaign.overview import Overview
from swashplate.campaign.reading import read_run
from swashplate.documents import parse_toml, read_text, validated
from swashplate.errors import InputError, ParameterError, UnknownNameError
from swashplate.logs import open_log
from swashplate.results import Result, figures
from swashplate.tables import Column as Head
from swashplate.tables import Table

if TYPE_CHECKING:
    from swashplate.drive import Drive
    from swashplate.results import Figure

FIXME = "FIXME"
"""Mark of an entry that a person has to settle."""
_TABLE = re.compile(r"\s*\[{1,2}[^\[\]=]+\]{1,2}\s*(?:#|$)")
"""A line of TOML that begins a table."""
LISTED = 12
"""Runs that a sentence names."""


@dataclass(frozen=True, eq=False)
class Campaign(Result):
    """Experiments on one machine, SI. Iterate it, or take one by its name.

    They stand in the order in which they were recorded, or in that of the file if the time of a
    run is unknown.

    Examples
    --------
    >>> from swashplate import Campaign, maneuvers, rig
    >>> tests = rig.run("hoist", {"step": maneuvers.step(9.0)})
    >>> file = rig.write(tests, "virtual")
    >>> tests = Campaign.from_toml(file)
    >>> list(tests["hoist_step"].channels)
    ['current', 'counts']
    """

    path: Path
    """The campaign file."""
    title: str
    virtual: bool
    """Whether the tests are simulated."""
    axes: Mapping[str, schema.AxisEntry]
    experiments: tuple[Experiment, ...]
    ignored: tuple[str, ...] = ()
    """Runs with the role ``"ignore"``, whose logs were not opened."""
    overviews: tuple[Overview, ...] = ()
    """Logs of more rows than one run has, as a whole; their windows with motion are experiments."""

    @classmethod
    def from_toml(cls, path: str | Path, *, logs: str | Path | None = None) -> Campaign:
        """Read a campaign file and its logs.

        Parameters
        ----------
        path : path
            The campaign file.
        logs : path, optional
            Folder of the logs; by default that of the campaign file.

        Returns
        -------
        Campaign
            Its experiments in the order in which they were recorded, in SI.

        Raises
        ------
        FileError
            If a file cannot be read; the sentence names file, row and column.
        ParameterError
            If an entry of the campaign file is wrong; the sentence names it.
        InputError
            If a column is missing, a unit wrong or a name taken twice.

        Examples
        --------
        >>> from swashplate import Campaign, maneuvers, rig
        >>> tests = rig.run("hoist", {"step": maneuvers.step(9.0)})
        >>> file = rig.write(tests, "logged")
        >>> Campaign.from_toml(file)
        Campaign('Virtual tests, hoist', 1 experiments on hoist)
        """
        file, folder = read_campaign_file(path), Path(path).parent if logs is None else Path(logs)
        experiments, overviews = list[Experiment](), list[Overview]()
        ignored, names = list[str](), set[str]()
        for number, run in enumerate(file.runs, 1):
            name = run.name or Path(run.file).stem
            if name in names:
                raise InputError(
                    f"{path}: two runs are called '{name}'; give each a different name."
                )
            names.add(name)
            if run.role == "ignore":
                ignored.append(name)
                continue
            log = open_log(folder / run.file, options=file.format)
            origin = f"{path}: run {number} ({run.file})"
            of_run, overview = read_run(origin, name, run, file.axes, log)
            experiments += of_run
            if overview is not None:
                overviews.append(overview)
        title = file.title or Path(path).resolve().parent.name
        return cls(
            Path(path),
            title,
            file.virtual,
            file.axes,
            in_recorded_order(experiments),
            tuple(ignored),
            tuple(overviews),
        )

    @property
    def without_runs(self) -> str:
        """Why it has no experiment, a sentence without its full stop; empty if it has one."""
        if self.experiments:
            return ""
        if not self.ignored:
            return f"{self.path}: no run has an experiment, so nothing can be said of the machine"
        return (
            f"{self.path}: no log is read, as each run has the role 'ignore'; mend what its "
            "comment in the file names, and give it the role 'fit' or 'validate'"
        )

    def table(self) -> Table:
        """Its experiments: axis, role, maneuver, length and channels."""
        heads = (*map(Head, ("run", "axis", "role", "maneuver")), Head("s", ".4g"))
        table = Table(self.title, (*heads, Head("channels", wrap=True)))
        for experiment in self:
            cells = experiment.name, experiment.axis, experiment.role, experiment.maneuver
            table.add(*cells, experiment.duration, ", ".join(experiment.channels))
        return table

    def plot(self, *, title: str | None = None) -> list[Figure]:
        """Figures of all long logs and of all runs.

        As of `swashplate.report.figures.plot_overview` and `plot_campaign`.
        """
        words = self.title if title is None else title
        overview_figures = [
            overview.plot(title=f"{words}: {overview.run}, the whole log")
            for overview in self.overviews
        ]
        return overview_figures + cast("list[Figure]", figures().plot_campaign(self, title=words))

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
        UnknownNameError
            If there is none of that name; it is a ``KeyError`` as well.
        IndexError
            If there are not so many.
        """
        if isinstance(name, int):
            return self.experiments[name]
        by_name = {experiment.name: experiment for experiment in self}
        if name in by_name:
            return by_name[name]
        if any(name == run or name.startswith(f"{run} ") for run in self.ignored):
            raise UnknownNameError(f"{self.path}: the run '{name}' has the role 'ignore'.")
        near = get_close_matches(name, by_name, 1)
        meant = f" (did you mean {near[0]}?)" if near else ""
        listed_names = ", ".join([*by_name][:LISTED])
        rest = f" and {len(by_name) - LISTED} more" if len(by_name) > LISTED else ""
        raise UnknownNameError(
            f"{self.path} has no run '{name}'{meant}; it has {listed_names}{rest}."
        )

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
        roles = get_args(schema.Role)
        if role is not None and role not in roles:
            raise InputError(f"There is no role '{role}': runs have {', '.join(roles)}.")
        of_axis = (experiment for experiment in self if axis in (None, experiment.axis))
        return tuple(experiment for experiment in of_axis if role in (None, experiment.role))

    def with_interpolation(self, axis: str, between: schema.Between) -> Campaign:
        """The campaign with the input of an axis joined in one way between its samples."""
        experiments = [
            replace(experiment, input=experiment.input.joined(between))
            if experiment.axis == axis
            else experiment
            for experiment in self
        ]
        return replace(self, experiments=tuple(experiments))

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
        try:
            return Drive.preset(name)
        except ParameterError as error:
            raise ParameterError(f"{self.path}, [axes.{axis}]: {error}") from None


def in_recorded_order(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Experiments in the order in which they were recorded; unchanged if a time is unknown."""
    times = [experiment.recorded for experiment in experiments]
    recorded = [time for time in times if time is not None]
    if len(recorded) < len(times):
        return tuple(experiments)
    return tuple(experiments[k] for k in np.argsort(recorded, kind="stable"))


def json_schema() -> str:
    """JSON Schema of a campaign file, for editors that complete and check while one writes."""
    document = schema.CampaignFile.model_json_schema(by_alias=True)
    document["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    document["title"] = "swashplate campaign"
    return json.dumps(document, indent=2) + "\n"


def read_campaign_file(path: str | Path) -> schema.CampaignFile:
    """Contents of a campaign file, checked; its logs are not read.

    Raises
    ------
    FileError
        If it cannot be read or is not TOML.
    ParameterError
        If an entry is wrong, or is marked FIXME, as `draft_campaign` marks what it could not know.
        The message names the entry.
    """
    origin = str(path)
    text = read_text(path)
    content = parse_toml(text, origin)
    _refuse_open_entries(text, origin)
    return validated(content, schema.CampaignFile, origin)


def _refuse_open_entries(text: str, origin: str) -> None:
    """Refuse a file in which an entry is marked FIXME, even if it has a value."""
    table, marked = "", list[tuple[int, str]]()
    for number, line in enumerate(text.splitlines(), 1):
        if _TABLE.match(line):
            table = line.partition("#")[0].strip()
        entry, mark, reason = line.partition(FIXME)
        # a remark on a line of its own is no entry, one that is commented out is
        if mark and (not entry.lstrip().startswith("#") or "=" in entry):
            entry = line.strip().lstrip("# ").partition("    #")[0]
            place = f"line {number}, {table}" if table else f"line {number}"
            reason = reason.lstrip(": ") if "#" in line else ""
            marked.append((number, f"{place}: {entry} is marked {FIXME}{reason and f': {reason}'}"))
    if not marked:
        return
    sentence = marked[0][1].rstrip(".")
    if len(marked) > 1:
        numbers = ", ".join(str(number) for number, _ in marked[1 : 1 + LISTED])
        sentence += f"; so {'is line' if len(marked) == 2 else 'are lines'} {numbers}"
    raise ParameterError(
        f"{origin}, {sentence}. Write what is right there, without a # in front, and delete the "
        "mark."
    )
