"""One channel of the card with its derivatives, columns numbered as in `tangent`."""

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.card_dynamics import (
    decay_partials,
    filter_partials,
    limiter_partials,
    rate_limit_active,
)
from swashplate.physics.component import component
from swashplate.physics.control_card import jump_share_partials, steady_partials
from swashplate.simulation.constants import Channel, Delay
from swashplate.simulation.tangent import (
    G1,
    G2,
    G3,
    I_T1,
    I_T2,
    LIM1,
    LIM2,
    N_CHANNEL,
    OMEGA,
    TAU,
    V_DZ,
    ZETA,
    A,
    C,
    J,
)

Array = NDArray[np.float64]


@component
def channel_partials(
    direction: float,
    command: float,
    slope: float,
    newest: float,
    middle: float,
    oldest: float,
    delay: Delay,
    state: float,
    previous: float,
    output: float,
    channel: Channel,
    step: float,
    direct: Array,
    at: int,
    stride: int,
) -> tuple[float, float, bool, float, float, float, float]:
    """One sample of a channel with its partial derivatives.

    Parameters
    ----------
    command, slope : float
        Delayed command [V] and its derivative by the delay in samples.
    newest, middle, oldest : float
        Command around the interval of the jump's share. [V]
    direct : array
        Filled from `at` on, `stride` apart: direct derivatives by the N_CHANNEL + 1 parameters, of
        the output for those of the limiter (LIM1 to A), else of the next I*.

    Returns
    -------
    output, following : float
        I at this sample, I* at the next. [A]
    limited : bool
        Whether a rate limit sets the output.
    by_target, by_output : float
        Derivatives of the output by I* and by the output before.
    by_state, by_previous : float
        Derivatives of the next I* by this one and the one before.
    """
    share, s_fraction, s_threshold = jump_share_partials(
        direction * newest,
        direction * middle,
        direction * oldest,
        delay.share_fraction,
        channel.V_dz,
    )
    steady, by_command, by_share, by_V_dz, by_J, by_G1, by_G2, by_G3 = steady_partials(
        direction * command, share, channel.V_dz, channel.J, channel.G1, channel.G2, channel.G3
    )
    current, by_target, by_output, by_lim1, by_lim2, by_I_t1, by_I_t2, by_decay = limiter_partials(
        state,
        output,
        steady,
        channel.lim1,
        channel.lim2,
        channel.I_t1,
        channel.I_t2,
        channel.decay,
        step,
        channel.split,
    )
    limited = rate_limit_active(current, state, output, channel.I_t2)
    _, decay_by_a = decay_partials(channel.a, step)
    direct[at + LIM1 * stride] = by_lim1
    direct[at + LIM2 * stride] = by_lim2
    direct[at + I_T1 * stride] = by_I_t1
    direct[at + I_T2 * stride] = by_I_t2
    direct[at + A * stride] = by_decay * decay_by_a
    following, f_state, f_previous, f_steady, f_zeta, f_omega, f_C = filter_partials(
        state, previous, steady, channel.zeta, channel.omega, channel.C, step, channel.literal
    )
    by_samples = by_command * direction * slope + by_share * s_fraction * delay.share_moves
    direct[at + V_DZ * stride] = f_steady * (by_V_dz + by_share * s_threshold)
    direct[at + J * stride] = f_steady * by_J
    direct[at + G1 * stride] = f_steady * by_G1
    direct[at + G2 * stride] = f_steady * by_G2
    direct[at + G3 * stride] = f_steady * by_G3
    direct[at + ZETA * stride] = f_zeta
    direct[at + OMEGA * stride] = f_omega
    direct[at + C * stride] = f_C
    direct[at + TAU * stride] = f_steady * by_samples / step
    return current, following, limited, by_target, by_output, f_state, f_previous


@component
def channel_tangent(
    direction: float,
    command: float,
    slope: float,
    newest: float,
    middle: float,
    oldest: float,
    delay: Delay,
    state: float,
    previous: float,
    output: float,
    channel: Channel,
    step: float,
    direct: Array,
    d_state: Array,
    d_previous: Array,
    d_output: Array,
) -> tuple[float, float, bool]:
    """One sample of a channel with its derivatives.

    Parameters
    ----------
    direct : (N_CHANNEL + 1,) array
        Room for `channel_partials`, where the other arguments are explained.
    d_state, d_previous, d_output : (N_CHANNEL + 1,) arrays
        Derivatives of I*, the I* before it and I; advanced in place with the states.

    Returns
    -------
    output, following : float
        I at this sample, I* at the next. [A]
    limited : bool
        Whether a rate limit sets the output.
    """
    current, following, limited, by_target, by_output, by_state, by_previous = channel_partials(
        direction,
        command,
        slope,
        newest,
        middle,
        oldest,
        delay,
        state,
        previous,
        output,
        channel,
        step,
        direct,
        0,
        1,
    )
    for k in range(N_CHANNEL + 1):
        d_output[k] = by_target * d_state[k] + by_output * d_output[k]
    for k in range(LIM1, N_CHANNEL):
        d_output[k] += direct[k]
    for k in range(N_CHANNEL + 1):
        ahead = by_state * d_state[k] + by_previous * d_previous[k]
        d_previous[k] = d_state[k]
        d_state[k] = ahead
    for k in range(LIM1):
        d_state[k] += direct[k]
    d_state[TAU] += direct[TAU]
    return current, following, limited
