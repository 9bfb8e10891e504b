"""Chance that can be repeated: one stream of random numbers for each run and use."""

from __future__ import annotations

from hashlib import blake2b

import numpy as np

from swashplate.drive import Drive
from swashplate.errors import InputError, ParameterError

TRIES = 100
"""Draws after which no set of parameters within the rules is expected any more."""


def stream(seed: int, *names: str) -> np.random.Generator:
    """Random numbers that depend on the seed and on names, on nothing else.

    So a run is the same whatever runs before it, and an instrument that is switched off takes no
    numbers from the others.
    """
    words = [
        int.from_bytes(blake2b(name.encode(), digest_size=8).digest(), "little") for name in names
    ]
    return np.random.default_rng(np.random.SeedSequence([seed, *words]))


def perturbed(drive: Drive, spread: float, seed: int) -> Drive:
    """A drive whose every value is multiplied by chance.

    Parameters
    ----------
    drive : Drive
        The drive about which they are drawn.
    spread : float
        Largest deviation of a factor's logarithm, above 0 and at most 0.5. Its standard deviation
        is half of that: 0.1 gives factors of 0.90 to 1.11, most within 5 %. [1]
    seed : int
        The same seed gives the same drive.

    Returns
    -------
    Drive
        Zeros, infinite limits and parameters without effect stay as they are.

    Raises
    ------
    InputError
        If the spread is out of range, or no draw keeps the rules of a parameter set.
    """
    if not 0.0 < spread <= 0.5:
        raise InputError(f"perturb must be above 0 and at most 0.5, not {spread:g}.")
    parameters = drive.parameters
    columns = [
        column
        for parameter in parameters.values()
        if parameter.status != "inactive"
        for column in parameter.definition.columns
        if parameters.numbers[column] != 0.0 and np.isfinite(parameters.numbers[column])
    ]
    generator = stream(seed, "parameters")
    for _ in range(TRIES):
        logarithms = 0.5 * spread * generator.standard_normal(len(columns))
        while (far := np.abs(logarithms) > spread).any():
            logarithms[far] = 0.5 * spread * generator.standard_normal(int(far.sum()))
        factors = np.exp(logarithms).tolist()
        try:
            drawn = drive.scale(**dict(zip(columns, factors, strict=True)))
        except ParameterError:
            continue
        title = f"{parameters.title}; values within ±{100 * spread:g} % by seed {seed}"
        return drawn.renamed(drive.name, title)
    raise InputError(
        f"No draw of {TRIES} within ±{100 * spread:g} % keeps the rules of {drive.name}'s "
        "parameters; take a smaller spread."
    )
