"""The data logger: what is written down of a run, instrument by instrument."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.kinds import ChannelKind
from swashplate.campaign.rig.chance import stream
from swashplate.campaign.rig.instruments import Instruments
from swashplate.campaign.rig.plant import Truth
from swashplate.campaign.rig.readings import (
    interpolated,
    read_counts,
    read_current,
    read_transducer,
    read_voltage,
)
from swashplate.campaign.rig.sampling import lost, sampled_instants
from swashplate.errors import InputError

Array = NDArray[np.float64]

COLUMNS: Mapping[str, str] = {"rectified_current": "current", "encoder_counts": "counts"}
"""Columns that are not called as the kind of their channel."""


def logged(
    truth: Truth,
    kinds: tuple[ChannelKind, ...],
    instruments: Instruments,
    counts_per_turn: float,
    seed: int,
    name: str,
) -> dict[str, Array]:
    """What the instruments make of a run; each has its own stream of chance."""
    grid = truth.time
    instants, stamps = sampled_instants(grid, instruments, stream(seed, name, "time"))
    at_voltage = interpolated(instants, grid, truth.voltage)
    columns = {
        "time": stamps,
        "voltage": read_voltage(at_voltage, instruments, stream(seed, name, "voltage")),
    }
    for kind in kinds:
        chance = stream(seed, name, kind)
        if kind == "rectified_current":
            reading = read_current(
                grid, truth.current_plus, truth.current_minus, instants, instruments, chance
            )
        elif kind == "encoder_counts":
            position = interpolated(instants, grid, truth.encoder_position)
            reading = read_counts(position, counts_per_turn, instruments, chance)
        else:
            signal = interpolated(instants, grid, _signal(truth, kind))
            reading = read_transducer(signal, instruments, chance)
        columns[COLUMNS.get(kind, kind)] = reading
    for column, values in columns.items():
        if column != "time" and instruments.empty_cells:
            chance = stream(seed, name, "empty", column)
            gaps = lost(values.size, instruments.empty_cells, instruments.longest_gap, chance)
            columns[column] = np.where(gaps, np.nan, values)
    gone = lost(
        grid.size, instruments.lost_rows, instruments.longest_loss, stream(seed, name, "rows")
    )
    if gone.all():
        raise InputError(f"{name}: lost_rows leaves no row; take a smaller share.")
    return {column: values[~gone] for column, values in columns.items()}


def _signal(truth: Truth, kind: ChannelKind) -> Array:
    """The true signal of a channel without an instrument of its own."""
    pump = truth.simulation
    if kind == "signed_current":
        return truth.current_plus - truth.current_minus
    if kind == "position":
        return truth.encoder_position
    owner = truth if kind in ("current_plus", "current_minus", "shaft_speed") else pump
    signal: Array = getattr(owner, kind)
    return signal
