"""The C reference: compiled when it is needed, called through ctypes."""

import ctypes
import os
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SOURCE = Path(__file__).parent / "reference.c"
LIBRARY = Path(__file__).parent / "build" / "libreference.so"
COMPILE = ("cc", "-O3", "-march=native", "-shared", "-fPIC")

POINTER = ctypes.POINTER(ctypes.c_double)
PAIR = ctypes.c_double * 2
DIRECTIONAL = ("Z13", "Z16", "Z19", "Z20", "Z21", "Z22")
PUMP = tuple(f"Z{number}" for number in range(1, 23) if number not in (7, 12))
CHANNEL = ("V_dz", "J", "G1", "G2", "G3", "zeta", "omega", "C", "lim1", "lim2", "I_t1", "I_t2", "a")


class Parameters(ctypes.Structure):
    """`struct parameters`."""

    _fields_ = [(name, PAIR if name in DIRECTIONAL else ctypes.c_double) for name in PUMP]


class Channel(ctypes.Structure):
    """`struct channel`."""

    _fields_ = [(name, ctypes.c_double) for name in CHANNEL]


class Card(ctypes.Structure):
    """`struct card`."""

    _fields_ = [("tau", ctypes.c_double), ("channel", Channel * 2)]


class Reference:
    """The drive in C, with the values of a parameter set.

    Arguments are converted once, here, so that a call costs next to nothing beside what it calls.
    """

    def __init__(self, numbers: Mapping[str, float]) -> None:
        left_out = [name for name in ("Z7", "Z12") if numbers[name] != 0.0]
        if left_out:
            raise ValueError(f"The reference has no {' and no '.join(left_out)}.")
        library = ctypes.CDLL(str(compiled()))
        self._speed, self._current = library.reference_speed, library.reference_current
        tail = (POINTER, ctypes.c_long, ctypes.c_double, POINTER)
        self._speed.argtypes = (ctypes.POINTER(Parameters), *tail)
        self._speed.restype = None
        self._current.argtypes = (ctypes.POINTER(Card), *tail)
        self._parameters, self._card = Parameters(), Card(tau=numbers["tau"])
        for name in PUMP:
            sides = (f"{name}_plus", f"{name}_minus")
            paired = name in DIRECTIONAL
            value = PAIR(*(numbers[side] for side in sides)) if paired else numbers[name]
            setattr(self._parameters, name, value)
        for channel, side in zip(self._card.channel, ("plus", "minus"), strict=True):
            for name in CHANNEL:
                setattr(channel, name, numbers[f"{name}_{side}"])

    def speed(self, current: Array, h: float, speed: Array) -> None:
        """Fill `speed` [rad/s] over a signed current [A]."""
        self._speed(self._parameters, pointer(current), current.size, h, pointer(speed))

    def current(self, voltage: Array, h: float, current: Array) -> None:
        """Fill `current` [A] over a voltage [V]."""
        if self._current(self._card, pointer(voltage), voltage.size, h, pointer(current)):
            raise MemoryError


def pointer(array: Array) -> "ctypes._Pointer[ctypes.c_double]":
    """What C sees of an array."""
    return array.ctypes.data_as(POINTER)


def compiled() -> Path:
    """The shared object, made anew if the source is younger."""
    if not LIBRARY.exists() or LIBRARY.stat().st_mtime < SOURCE.stat().st_mtime:
        LIBRARY.parent.mkdir(exist_ok=True)
        beside = LIBRARY.with_name(f"{LIBRARY.name}.{os.getpid()}")
        subprocess.run([*COMPILE, "-o", str(beside), str(SOURCE), "-lm"], check=True)
        beside.replace(LIBRARY)
    return LIBRARY
