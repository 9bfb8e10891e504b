"""The march of many parameter sets over one input: LANES sets in the innermost loop.

The compiler turns the loop over lanes into vector instructions because the components are inlined
and free of calls. Arithmetic is as strict as in the plain march, so each set's numbers are the
same to the last bit, whatever its neighbours are.
"""

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.component import component
from swashplate.physics.control_card import interpolated
from swashplate.simulation.chain import (
    channel_sample,
    channel_steady,
    moment_squared,
    pump_speed,
    pump_step,
)
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import (
    N_CHANNEL_NUMBERS,
    N_PUMP_NUMBERS,
    Channel,
    Pump,
)
from swashplate.simulation.march import sample_at

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

LANES = 16
"""Sets marched side by side: two vectors of eight where the processor has them, else four of 4."""

# Rows of a block, the flat array that holds all there is to know of LANES drives: row r of lane l
# is block[r * LANES + l]. With everything in one array at known distances the compiler need not
# prove at run time that rows do not overlap, and vectorises.
(PRESSURE, STATE_P, PREVIOUS_P, OUTPUT_P, STATE_M, PREVIOUS_M, OUTPUT_M) = range(7)
(SPEED, POSITION, CURRENT, OBSERVED, COST, WORST) = range(7, 13)
(NEWER, OLDER, NEWEST, MIDDLE, OLDEST, FRACTION, SHARE_FRACTION) = range(13, 20)
PLUS = 20
MINUS = PLUS + N_CHANNEL_NUMBERS
PUMP = MINUS + N_CHANNEL_NUMBERS
N_ROWS = PUMP + N_PUMP_NUMBERS


@component
def row(block: Array, number: int, lane: int) -> float:
    """One number of one lane."""
    return block[number * LANES + lane]  # type: ignore[no-any-return]


@component
def channel_of(
    block: Array, first: int, lane: int, literal: bool | None, split: bool | None
) -> Channel:
    """One lane's channel; its numbers lie in rows from `first` on, in the order of `Channel`."""
    return Channel(
        row(block, first + 0, lane),
        row(block, first + 1, lane),
        row(block, first + 2, lane),
        row(block, first + 3, lane),
        row(block, first + 4, lane),
        row(block, first + 5, lane),
        row(block, first + 6, lane),
        row(block, first + 7, lane),
        row(block, first + 8, lane),
        row(block, first + 9, lane),
        row(block, first + 10, lane),
        row(block, first + 11, lane),
        row(block, first + 12, lane),
        row(block, first + 13, lane),
        literal,
        split,
    )


@component
def pump_of(
    block: Array,
    first: int,
    lane: int,
    leaky: bool | None,
    loaded: bool | None,
    steep: bool | None,
    symmetric: bool | None,
) -> Pump:
    """One lane's pump; its numbers lie in rows from `first` on, in the order of `Pump`."""
    return Pump(
        row(block, first + 0, lane),
        row(block, first + 1, lane),
        row(block, first + 2, lane),
        row(block, first + 3, lane),
        row(block, first + 4, lane),
        row(block, first + 5, lane),
        row(block, first + 6, lane),
        row(block, first + 7, lane),
        row(block, first + 8, lane),
        row(block, first + 9, lane),
        row(block, first + 10, lane),
        row(block, first + 11, lane),
        row(block, first + 12, lane),
        row(block, first + 13, lane),
        row(block, first + 14, lane),
        row(block, first + 15, lane),
        row(block, first + 16, lane),
        row(block, first + 17, lane),
        row(block, first + 18, lane),
        row(block, first + 19, lane),
        row(block, first + 20, lane),
        row(block, first + 21, lane),
        row(block, first + 22, lane),
        row(block, first + 23, lane),
        row(block, first + 24, lane),
        row(block, first + 25, lane),
        row(block, first + 26, lane),
        row(block, first + 27, lane),
        row(block, first + 28, lane),
        row(block, first + 29, lane),
        row(block, first + 30, lane),
        row(block, first + 31, lane),
        leaky,
        loaded,
        steep,
        symmetric,
    )


@component
def read_commands(
    n: int, command: Array, whole: Indices, share_whole: Indices, block: Array
) -> None:
    """What each lane's card sees at one sample: two samples around t - τ, three of the share.

    All but the newest of them move up from the sample before. Before the record begins the command
    is zero, as the rows are at the start.
    """
    for lane in range(LANES):
        block[OLDER * LANES + lane] = row(block, NEWER, lane)
        block[OLDEST * LANES + lane] = row(block, MIDDLE, lane)
        block[MIDDLE * LANES + lane] = row(block, NEWEST, lane)
    # apart, because a loop that reads at computed places is not vectorised
    for lane in range(LANES):
        block[NEWER * LANES + lane] = sample_at(command, n - whole[lane], 0.0)
        block[NEWEST * LANES + lane] = sample_at(command, n - share_whole[lane], 0.0)


@component
def advance_channel(
    direction: float, channel: Channel, first: int, lane: int, step: float, block: Array
) -> float:
    """One sample of one channel of one lane; its states lie in three rows from `first` on."""
    steady = channel_steady(
        direction,
        interpolated(row(block, NEWER, lane), row(block, OLDER, lane), row(block, FRACTION, lane)),
        row(block, NEWEST, lane),
        row(block, MIDDLE, lane),
        row(block, OLDEST, lane),
        row(block, SHARE_FRACTION, lane),
        channel,
    )
    state = row(block, first, lane)
    output, following, _ = channel_sample(
        steady, state, row(block, first + 1, lane), row(block, first + 2, lane), channel, step
    )
    block[first * LANES + lane] = following
    block[(first + 1) * LANES + lane] = state
    block[(first + 2) * LANES + lane] = output
    return output


@component
def advance_cards(literal: bool | None, split: bool | None, step: float, block: Array) -> None:
    """One sample of every lane's card."""
    for lane in range(LANES):
        plus = channel_of(block, PLUS, lane, literal, split)
        minus = channel_of(block, MINUS, lane, literal, split)
        current = advance_channel(1.0, plus, STATE_P, lane, step, block)
        current -= advance_channel(-1.0, minus, STATE_M, lane, step, block)
        block[CURRENT * LANES + lane] = current


@component
def advance_pump(
    lane: int,
    current: float,
    half_step: float,
    observed: int,
    measured: float,
    weight: float,
    leaky: bool | None,
    loaded: bool | None,
    steep: bool | None,
    symmetric: bool | None,
    step: float,
    block: Array,
) -> None:
    """One sample of one lane's pump: outputs and cost now, pressure one step later.

    `half_step` is half of h, and 0 at the first sample, where the position does not move.
    """
    pump = pump_of(block, PUMP, lane, leaky, loaded, steep, symmetric)
    p = row(block, PRESSURE, lane)
    speed = pump_speed(p, current, pump)
    position = row(block, POSITION, lane) + half_step * (row(block, SPEED, lane) + speed)
    value = speed if observed == SPEED else (position if observed == POSITION else current)
    error = value - measured
    block[SPEED * LANES + lane] = speed
    block[POSITION * LANES + lane] = position
    block[OBSERVED * LANES + lane] = value
    block[COST * LANES + lane] = row(block, COST, lane) + weight * error * error
    block[WORST * LANES + lane] = max(row(block, WORST, lane), moment_squared(current, pump))
    block[PRESSURE * LANES + lane] = pump_step(p, current, pump, step)


@kernel
def march_drives(
    command: Array,
    whole: Indices,
    share_whole: Indices,
    literal: bool | None,
    split: bool | None,
    leaky: bool | None,
    loaded: bool | None,
    steep: bool | None,
    symmetric: bool | None,
    step: float,
    block: Array,
    observed: int,
    measured: Array,
    weight: Array,
    outputs: Array,
) -> None:
    """March LANES drives over one command.

    Parameters
    ----------
    command : (n,) array
        Command at the samples, zero before. [V]
    whole, share_whole : (LANES,) arrays of int
        Whole samples of the delays, see `Delay`.
    literal, split, leaky, loaded, steep, symmetric : None or True
        The options of `Channel` and `Pump`, the same for all lanes.
    block : (N_ROWS * LANES,) array
        Parameters and states at the start; the states are advanced in place, and the rows COST
        and WORST are results.
    observed : int
        SPEED, POSITION or CURRENT: what `outputs` holds and `measured` is compared with.
    measured, weight : (n,) arrays
        Record to compare with and weight of each squared error.
    outputs : (n, LANES) or (0, LANES) array
        Observed quantity at each sample; empty where only the cost is wanted.
    """
    for n in range(command.size):
        half_step = 0.5 * step if n > 0 else 0.0
        read_commands(n, command, whole, share_whole, block)
        advance_cards(literal, split, step, block)
        for lane in range(LANES):
            advance_pump(
                lane,
                row(block, CURRENT, lane),
                half_step,
                observed,
                measured[n],
                weight[n],
                leaky,
                loaded,
                steep,
                symmetric,
                step,
                block,
            )
        if outputs.shape[0] > 0:
            for lane in range(LANES):
                outputs[n, lane] = row(block, OBSERVED, lane)


@kernel
def march_pumps(
    current: Array,
    leaky: bool | None,
    loaded: bool | None,
    steep: bool | None,
    symmetric: bool | None,
    step: float,
    block: Array,
    observed: int,
    measured: Array,
    weight: Array,
    outputs: Array,
) -> None:
    """March LANES pumps over one signed current; arguments as in `march_drives`."""
    for n in range(current.size):
        half_step = 0.5 * step if n > 0 else 0.0
        for lane in range(LANES):
            advance_pump(
                lane,
                current[n],
                half_step,
                observed,
                measured[n],
                weight[n],
                leaky,
                loaded,
                steep,
                symmetric,
                step,
                block,
            )
        if outputs.shape[0] > 0:
            for lane in range(LANES):
                outputs[n, lane] = row(block, OBSERVED, lane)
