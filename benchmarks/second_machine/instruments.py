"""What the instruments make of the machine's signals."""

from math import exp, floor, pi

import numpy as np
from numba import njit

from .equations import follow


def at(time, rows, column):
    """A column of a march at instants, straight between its steps."""
    return np.interp(time, rows[:, 0], column)


@njit(cache=True)
def lagged(time, signal, bandwidth):
    """A signal behind a first-order low pass [Hz], exact where the signal is straight."""
    output = np.empty_like(signal)
    output[0] = signal[0]
    lag = 1.0 / (2.0 * pi * bandwidth)
    for n in range(1, signal.size):
        h = time[n] - time[n - 1]
        slope = (signal[n] - signal[n - 1]) / h
        kept = exp(-h / lag)
        follows = signal[n - 1] - slope * lag
        output[n] = follows + slope * h + (output[n - 1] - follows) * kept
    return output


@njit(cache=True)
def after_play(angle, width):
    """An angle behind a play of a full width; it begins in the middle."""
    output = np.empty_like(angle)
    output[0] = angle[0]
    for n in range(1, angle.size):
        output[n] = follow(angle[n], output[n - 1], width)
    return output


@njit(cache=True)
def counted(position, edges):
    """Counts of an encoder at positions in counts, whose edge k lies at k + edges[k mod 4]."""
    output = np.empty(position.size)
    for n in range(position.size):
        count = floor(position[n])
        if position[n] < count + edges[int(count) % 4]:
            count -= 1
        elif position[n] >= count + 1 + edges[int(count + 1) % 4]:
            count += 1
        output[n] = count
    return output


@njit(cache=True)
def slow_counter(time, position, fastest):
    """A position as a counter follows it that loses what is beyond a speed [position a second]."""
    output = np.empty_like(position)
    output[0] = position[0]
    for n in range(1, position.size):
        most = fastest * (time[n] - time[n - 1])
        step = min(max(position[n] - position[n - 1], -most), most)
        output[n] = output[n - 1] + step
    return output


def encoder(rows, position, time, tool, zero):
    """Counts at instants; `zero` is the counter's reading at the start, in counts."""
    moved = after_play(position, tool.play)
    if np.isfinite(tool.fastest):
        moved = slow_counter(rows[:, 0], moved, tool.fastest * tool.step)
    counts = at(time - tool.delay, rows, moved) / tool.step + zero
    return counted(counts, np.array(tool.edges))


def ammeter(rows, time, tool, random):
    """Reading at instants: the sum of both currents. [A]"""
    clock, current = rows[:, 0], rows[:, 1] + rows[:, 2]
    phase = random.uniform(0.0, 2.0 * pi)
    wave = np.sin(2.0 * pi * tool.ripple_frequency * clock + phase)
    reading = at(time, rows, lagged(clock, current * (1.0 + tool.ripple * wave), tool.bandwidth))
    reading = tool.gain * reading + tool.zero + tool.noise * random.standard_normal(time.size)
    return np.round(np.minimum(reading, tool.limit) / tool.resolution) * tool.resolution


def tacho(rows, time, tool, random):
    """Speed at instants. [rad/s]"""
    clock, angle, speed = rows[:, 0], rows[:, 4], rows[:, 5]
    wave = np.sin(tool.cycles * angle + random.uniform(0.0, 2.0 * pi))
    reading = at(time, rows, lagged(clock, speed * (1.0 + tool.ripple * wave), tool.bandwidth))
    noise = tool.noise * np.abs(speed).max() * random.standard_normal(time.size)
    return tool.gain * reading + noise
