"""A campaign: the tests of a machine, read from their logs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from swashplate.campaign.experiment import Experiment
from swashplate.campaign.loading import read_campaign_file, read_experiments
from swashplate.campaign.schema import Axis, CampaignFile, Role
from swashplate.errors import InputError

if TYPE_CHECKING:
    from swashplate.drive import Drive

_LISTED = 12
"""Runs that a sentence names."""


@dataclass(frozen=True, eq=False)
class Campaign:
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
    axes: Mapping[str, Axis]
    experiments: tuple[Experiment, ...]

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
        experiments = tuple(read_experiments(path, file, logs))
        title = file.title or Path(path).resolve().parent.name
        return cls(Path(path), title, file.virtual, file.axes, experiments)

    def __iter__(self) -> Iterator[Experiment]:
        return iter(self.experiments)

    def __len__(self) -> int:
        return len(self.experiments)

    def __getitem__(self, name: str) -> Experiment:
        """An experiment by its name.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        for each in self.experiments:
            if each.name == name:
                return each
        names = [each.name for each in self.experiments]
        near = get_close_matches(name, names, 1)
        meant = f" (did you mean {near[0]}?)" if near else ""
        known = ", ".join(names[:_LISTED])
        more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
        raise InputError(f"{self.path} has no run '{name}'{meant}; it has {known}{more}.")

    def select(
        self, *, axis: str | None = None, role: Role | None = None
    ) -> tuple[Experiment, ...]:
        """Its experiments of an axis, of a role, or both.

        Raises
        ------
        InputError
            If there is no such axis.
        """
        if axis is not None and axis not in self.axes:
            raise InputError(f"{self.path} has no axis '{axis}'; it has {', '.join(self.axes)}.")
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
    schema = CampaignFile.model_json_schema(by_alias=True)
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "swashplate campaign"
    return json.dumps(schema, indent=2) + "\n"
