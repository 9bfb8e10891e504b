"""How a block of samples lies in memory, for the march that derives only what a fit asks for.

A block is one flat array of rows, each a quantity over BLOCK samples. With everything in one array
at distances known to the compiler, loops over the samples of many rows become vector instructions
(as over lanes in `side_by_side`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.simulation.tangent import N_CHANNEL, N_PUMP, Z10, Z11, Z12

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCK = 512
"""Most samples of a block."""
STRIDE = BLOCK + 16
"""From one row to the next: not a power of two, so that rows do not share places in a cache."""

# States of a sample, and derivatives of the next sample's pressure.
(PRESSURE, CURRENT, CURRENT_PLUS, CURRENT_MINUS, OPENING) = range(5)
(BY_PRESSURE, BY_CURRENT, OPENING_BY_PRESSURE, OPENING_BY_CURRENT) = range(5, 9)
# A channel's derivatives by its own states; room that both channels use in turn.
(BY_TARGET, BY_OUTPUT, BY_STATE, BY_PREVIOUS) = range(9, 13)
# An observed signal's derivatives by the states.
(SIGNAL_BY_PRESSURE, SIGNAL_BY_CURRENT, SIGNAL_BY_OPENING) = range(13, 16)
# Room for a row that is needed for a moment.
ASIDE = 16
# Samples of the command that the card looks at.
(NEWER, OLDER, NEWEST, MIDDLE, OLDEST) = range(17, 22)
# Three rows for each channel: I*, the I* before it, and I one sample earlier.
STATES_PLUS, STATES_MINUS = 22, 25

D_PRESSURE = 28
"""First row of the derivatives of δP: a row for each of `ALL_PARAMETERS`, then START and IDLE."""
PLUS_AT = N_PUMP
MINUS_AT = N_PUMP + N_CHANNEL
TAU_AT = N_PUMP + 2 * N_CHANNEL
START_AT = TAU_AT + 1
"""The pressure at the start, as an unknown of its own."""
IDLE_AT = START_AT + 1
"""Always zero: fills up lists of rows."""
N_PRESSURE_ROWS = IDLE_AT + 1

D_PLUS = D_PRESSURE + N_PRESSURE_ROWS
"""First row of the derivatives of a channel's current: its N_CHANNEL parameters, τ and one idle."""
IDLE_CHANNEL_AT = N_CHANNEL + 1
N_CHANNEL_ROWS = N_CHANNEL + 2
D_MINUS = D_PLUS + N_CHANNEL_ROWS
OPENING_BY = D_MINUS + N_CHANNEL_ROWS
"""First row of the opening's direct derivatives by the pump's parameters, where they count."""
SIGNAL_BY = OPENING_BY + N_PUMP
"""First row of an observed signal's direct derivatives by the pump's parameters."""
N_ROWS = SIGNAL_BY + N_PUMP
ROWS_OF_ZEROS = (
    *(D_PRESSURE + at for at in (Z10, Z11, Z12, START_AT, IDLE_AT)),
    D_PLUS + IDLE_CHANNEL_AT,
    D_MINUS + IDLE_CHANNEL_AT,
    *(OPENING_BY + k for k in range(N_PUMP)),
)
"""Rows of which no step sets all, and that must not come as anything else."""


class Columns(NamedTuple):
    """Which derivatives are wanted, as numbers of rows."""

    pressure: Indices
    """Rows of the derivatives of δP, in the order of the columns."""
    pressure_filled: Indices
    """The same, filled up with IDLE_AT for `recurrences`."""
    plus_filter: Indices
    """Rows of the plus channel on which its filter depends, filled up."""
    plus: Indices
    """All rows of the plus channel, filled up."""
    minus_filter: Indices
    minus: Indices


class Tangents(NamedTuple):
    """Derivatives of the states at the present sample, a number for each row."""

    pressure: Array
    """(N_PRESSURE_ROWS,)"""
    plus: Array
    """(3, N_CHANNEL_ROWS): I*, the I* before it, I."""
    minus: Array
