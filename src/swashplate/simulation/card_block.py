"""The control card over a block of samples: currents, and their derivatives."""

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.component import component
from swashplate.physics.control_card import interpolated, interpolated_partials
from swashplate.simulation.blocks import (
    BY_OUTPUT,
    BY_PREVIOUS,
    BY_STATE,
    BY_TARGET,
    CURRENT,
    CURRENT_MINUS,
    CURRENT_PLUS,
    D_MINUS,
    D_PLUS,
    MIDDLE,
    N_CHANNEL_ROWS,
    NEWER,
    NEWEST,
    OLDER,
    OLDEST,
    STATES_MINUS,
    STATES_PLUS,
    STRIDE,
    Columns,
    Tangents,
)
from swashplate.simulation.card_tangent import channel_partials
from swashplate.simulation.chain import channel_sample, channel_steady
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Channel, Delay
from swashplate.simulation.march import samples_around
from swashplate.simulation.recurrences import follow_second_order, settle

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

QUIET = 1e-18
"""Current below which a channel without command counts as at rest, and with it its derivatives:
they have faded with it, to far below the rounding of any current that counts. [A]"""


@kernel
def march_channels(
    command: Array,
    first: int,
    count: int,
    before: float,
    delay: Delay,
    plus: Channel,
    minus: Channel,
    step: float,
    state: Array,
    table: Array,
) -> tuple[bool, bool]:
    """March both channels over a block.

    Parameters
    ----------
    command : (n,) array
        The whole command. [V]
    first, count : int
        The block's first sample, and how many it has.
    before, delay, plus, minus, step :
        As in `march_drive`.
    state : (2, 3) array
        For each channel I*, the I* before it, and I one sample earlier; replaced by what they are
        behind the block. [A]
    table : (N_ROWS, STRIDE) array
        The block; currents, states and the command's samples are filled.

    Returns
    -------
    rests_plus, rests_minus : bool
        Whether a channel was at rest throughout.
    """
    state_p, previous_p, output_p = state[0, 0], state[0, 1], state[0, 2]
    state_m, previous_m, output_m = state[1, 0], state[1, 1], state[1, 2]
    rests_p = max(abs(state_p), abs(previous_p), abs(output_p)) < QUIET
    rests_m = max(abs(state_m), abs(previous_m), abs(output_m)) < QUIET
    f = delay.share_fraction
    for m in range(count):
        newer, older, newest, middle, oldest = samples_around(command, first + m, delay, before)
        table[NEWER, m], table[OLDER, m] = newer, older
        table[NEWEST, m], table[MIDDLE, m], table[OLDEST, m] = newest, middle, oldest
        delayed = interpolated(newer, older, delay.fraction)
        steady_p = channel_steady(1.0, delayed, newest, middle, oldest, f, plus)
        steady_m = channel_steady(-1.0, delayed, newest, middle, oldest, f, minus)
        table[STATES_PLUS, m], table[STATES_PLUS + 1, m] = state_p, previous_p
        table[STATES_MINUS, m], table[STATES_MINUS + 1, m] = state_m, previous_m
        table[STATES_PLUS + 2, m], table[STATES_MINUS + 2, m] = output_p, output_m
        output_p, next_p, _ = channel_sample(steady_p, state_p, previous_p, output_p, plus, step)
        output_m, next_m, _ = channel_sample(steady_m, state_m, previous_m, output_m, minus, step)
        previous_p, state_p = state_p, next_p
        previous_m, state_m = state_m, next_m
        table[CURRENT_PLUS, m], table[CURRENT_MINUS, m] = output_p, output_m
        table[CURRENT, m] = output_p - output_m
        rests_p = rests_p and max(newer, older, newest, middle, oldest) <= plus.V_dz
        rests_m = rests_m and min(newer, older, newest, middle, oldest) >= -minus.V_dz
    state[0, 0], state[0, 1], state[0, 2] = state_p, previous_p, output_p
    state[1, 0], state[1, 1], state[1, 2] = state_m, previous_m, output_m
    return rests_p, rests_m


@component
def fill_channel(
    direction: float,
    count: int,
    delay: Delay,
    channel: Channel,
    step: float,
    flat: Array,
    states_at: int,
    at: int,
) -> None:
    """Partial derivatives of one channel at known states, in a loop without a wait.

    `states_at` and `at` are rows of the block: of the states, and of the derivatives.
    """
    for m in range(count):
        delayed, _, _, slope = interpolated_partials(
            flat[NEWER * STRIDE + m], flat[OLDER * STRIDE + m], delay.fraction
        )
        _, _, _, by_target, by_output, by_state, by_previous = channel_partials(
            direction,
            delayed,
            slope,
            flat[NEWEST * STRIDE + m],
            flat[MIDDLE * STRIDE + m],
            flat[OLDEST * STRIDE + m],
            delay,
            flat[states_at * STRIDE + m],
            flat[(states_at + 1) * STRIDE + m],
            flat[(states_at + 2) * STRIDE + m],
            channel,
            step,
            flat,
            at * STRIDE + m,
            STRIDE,
        )
        flat[BY_TARGET * STRIDE + m] = by_target
        flat[BY_OUTPUT * STRIDE + m] = by_output
        flat[BY_STATE * STRIDE + m] = by_state
        flat[BY_PREVIOUS * STRIDE + m] = by_previous


@kernel
def follow_channel(
    count: int, filter_rows: Indices, all_rows: Indices, tangent: Array, rows: Array, table: Array
) -> None:
    """Derivatives of one channel's current from its partial derivatives.

    Parameters
    ----------
    filter_rows, all_rows : (4 j,) arrays
        Wanted rows that the filter depends on, and all wanted rows; filled up.
    tangent : (3, N_CHANNEL_ROWS) array
        Derivatives of the state, replaced by those behind the block.
    rows : (N_CHANNEL_ROWS, STRIDE) array
        The channel's rows of the block: direct derivatives, replaced by those of the current.
    """
    follow_second_order(
        table[BY_STATE], table[BY_PREVIOUS], rows, filter_rows, count, tangent[0], tangent[1]
    )
    by_target = table[BY_TARGET]
    for k in filter_rows:
        row = rows[k]
        for m in range(count):
            row[m] = by_target[m] * row[m]
    settle(table[BY_OUTPUT], rows, all_rows, count, tangent[2])


@kernel
def rest_channel(count: int, all_rows: Indices, tangent: Array, rows: Array) -> None:
    """Derivatives of a channel at rest: none."""
    for i in range(tangent.shape[0]):
        for k in range(tangent.shape[1]):
            tangent[i, k] = 0.0
    for k in all_rows:
        for m in range(count):
            rows[k, m] = 0.0


@kernel
def march_card(
    command: Array,
    first: int,
    count: int,
    before: float,
    delay: Delay,
    plus: Channel,
    minus: Channel,
    step: float,
    state: Array,
    columns: Columns,
    tangents: Tangents,
    flat: Array,
    table: Array,
) -> None:
    """March the card over a block, with what is wanted of its derivatives; see `march_channels`."""
    rests_plus, rests_minus = march_channels(
        command, first, count, before, delay, plus, minus, step, state, table
    )
    rows = table[D_PLUS : D_PLUS + N_CHANNEL_ROWS]
    if rests_plus:
        rest_channel(count, columns.plus, tangents.plus, rows)
    elif columns.plus.size > 0:
        fill_channel(1.0, count, delay, plus, step, flat, STATES_PLUS, D_PLUS)
        follow_channel(count, columns.plus_filter, columns.plus, tangents.plus, rows, table)
    rows = table[D_MINUS : D_MINUS + N_CHANNEL_ROWS]
    if rests_minus:
        rest_channel(count, columns.minus, tangents.minus, rows)
    elif columns.minus.size > 0:
        fill_channel(-1.0, count, delay, minus, step, flat, STATES_MINUS, D_MINUS)
        follow_channel(count, columns.minus_filter, columns.minus, tangents.minus, rows, table)
