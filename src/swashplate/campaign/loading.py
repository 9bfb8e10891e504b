"""From a campaign file and its logs to experiments."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swashplate.campaign import schema
from swashplate.campaign.columns import Columns, named, read_signal
from swashplate.campaign.counters import CounterRangeError
from swashplate.campaign.encoder import unwrap_counts
from swashplate.campaign.experiment import Channel, Encoder, Experiment, InputSignal
from swashplate.campaign.recognition import Recognised, recognise
from swashplate.campaign.weighting import applying, weights
from swashplate.documents import parse_toml, read_text, validated
from swashplate.errors import InputError
from swashplate.logs import Log, open_log


def read_campaign_file(path: str | Path) -> schema.CampaignFile:
    """A campaign file without its logs.

    Raises
    ------
    FileError
        If it cannot be read or is not TOML.
    ParameterError
        If an entry is wrong; the sentence names it.
    """
    origin = str(path)
    return validated(parse_toml(read_text(path), origin), schema.CampaignFile, origin)


@dataclass(frozen=True)
class _Place:
    """What is being read, for sentences and for paths."""

    file: Path
    """The campaign file."""
    run: schema.Run
    log: Log


def read_experiments(
    path: str | Path, file: schema.CampaignFile, logs: str | Path | None = None
) -> Iterator[Experiment]:
    """The experiments of a campaign file, run after run; each log is read once.

    Parameters
    ----------
    path : path
        The campaign file.
    file : schema.CampaignFile
        Its content.
    logs : path, optional
        Folder of its logs; by default they lie beside it.

    Raises
    ------
    FileError, InputError, ParameterError
        For the first thing that is wrong; the sentence names file, column and row.
    """
    names, folder = _run_names(path, file), Path(path).parent if logs is None else Path(logs)
    for number, (name, run) in enumerate(zip(names, file.runs, strict=True)):
        log = open_log(folder / run.file, options=file.format)
        place = _Place(Path(path), run, log)
        axes = _axes_of(place, number, file)
        columns = Columns(log, [column for axis in axes.values() for column in named(axis)])
        for axis_name, axis in axes.items():
            yield _experiment(place, name, axis_name, axis, columns, several=len(file.axes) > 1)


def _run_names(path: str | Path, file: schema.CampaignFile) -> list[str]:
    names = [run.name or Path(run.file).stem for run in file.runs]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}: two runs are called '{name}'; give each a name of its own.")
    return names


def _axes_of(place: _Place, number: int, file: schema.CampaignFile) -> dict[str, schema.Axis]:
    """The axes that a run tests, with its overrides."""
    run = place.run
    for name in (*run.only, *run.axes):
        if name not in file.axes:
            known = ", ".join(file.axes)
            raise InputError(
                f"{place.file}: run {number + 1} ({run.file}) names the axis '{name}', but the "
                f"axes are {known}."
            )
    axes = {}
    for name in run.only or file.axes:
        axis = file.axes[name]
        if name in run.axes:
            content = axis.model_dump(by_alias=True, exclude_unset=True)
            origin = f"{place.file}: run {number + 1} ({run.file}): axes.{name}"
            _check_channels(origin, run.axes[name], axis)
            axis = validated(_merged(content, run.axes[name]), schema.Axis, origin)
        axes[name] = axis
    return axes


def _check_channels(origin: str, changes: Mapping[str, Any], axis: schema.Axis) -> None:
    """Refuse a change of a channel that there is not; a whole new one says its kind."""
    channels = changes.get("channels")
    for name, change in channels.items() if isinstance(channels, Mapping) else ():
        if name not in axis.channels and isinstance(change, Mapping) and "kind" not in change:
            raise InputError(
                f"{origin} changes the channel '{name}', but the axis has "
                f"{', '.join(axis.channels)}; a new channel needs its kind and column."
            )


def _merged(content: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A table with some entries replaced, tables within it merged in turn."""
    merged = dict(content)
    for key, value in changes.items():
        old = merged.get(key)
        both = isinstance(old, dict) and isinstance(value, Mapping)
        merged[key] = _merged(old, value) if both else value  # type: ignore[arg-type]
    return merged


def _experiment(
    place: _Place,
    run_name: str,
    axis_name: str,
    axis: schema.Axis,
    columns: Columns,
    *,
    several: bool,
) -> Experiment:
    run = place.run
    drive = _input(place, axis, columns)
    recognised = _recognised(drive)
    maneuver = run.maneuver or recognised.name
    ignored = applying((*axis.ignore, *run.ignore), maneuver)
    channels = {}
    for name, channel in axis.channels.items():
        read = read_signal(f"channel '{name}'", channel, axis, columns, run.span)
        counts, encoder = None, None
        values = read.values
        if channel.counts_per_turn is not None:
            encoder = Encoder(
                channel.counts_per_turn, channel.gear_ratio, channel.sign, channel.rolls_over_at
            )
            counts = values
            if channel.rolls_over_at is not None:
                try:
                    counts = unwrap_counts(values, modulus=channel.rolls_over_at).counts
                except CounterRangeError as error:
                    raise InputError(
                        f"{read.source}: {error.said}; give the right rolls_over_at."
                    ) from None
                except InputError as error:
                    raise InputError(f"{read.source}: {error}") from None
            values = counts * encoder.angle_per_count
        weighted = applying((*channel.weights, *run.weights), maneuver)
        left_out = (*ignored, *applying(channel.ignore, maneuver))
        channels[name] = Channel(
            name,
            channel.kind,
            read.unit,
            read.time,
            values,
            weights(channel, read.time, drive, left_out, weighted, run.weight),
            read.source,
            None if channel.noise is None else read.factor * channel.noise,
            read.limits,
            read.dropped,
            encoder,
            counts,
        )
    return Experiment(
        f"{run_name} {axis_name}" if several else run_name,
        axis_name,
        run_name,
        run.role,
        run.start or axis.start,
        run.start_pressure,
        drive,
        channels,
        run.maneuver,
        recognised,
        tuple(
            (
                -np.inf if each.start is None else each.start,
                np.inf if each.stop is None else each.stop,
                each.why,
            )
            for each in ignored
        ),
    )


def _input(place: _Place, axis: schema.Axis, columns: Columns) -> InputSignal:
    read = read_signal("the input", axis.input, axis, columns, place.run.span)
    return InputSignal(
        axis.input.kind,
        read.unit,
        read.time,
        read.values,
        axis.input.interpolation,
        read.source,
        read.limits,
        read.dropped,
    )


def _recognised(drive: InputSignal) -> Recognised:
    unit = {"voltage": "V", "current": "A"}.get(drive.kind, drive.unit)
    return recognise(drive.time, drive.values, unit=unit)
