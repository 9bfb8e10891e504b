"""Cranes with changed drives: redesigned, or drawn from the errors of fits."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from swashplate.analysis import with_factors
from swashplate.crane.axes import AXES, check_names
from swashplate.crane.crane import Crane
from swashplate.crane.drives import DriveSource
from swashplate.errors import InputError

if TYPE_CHECKING:
    from swashplate.analysis import Draws


def with_design_change(crane: Crane, axis: str, factors: Mapping[str, float]) -> Crane:
    """The crane with a redesigned drive of an axis, which the controller knows.

    Parameters
    ----------
    crane : Crane
        If its controller counts on another drive of that axis, that one is redesigned, too.
    axis : {"hoist", "slew", "luff"}
        The axis.
    factors : mapping of str to float
        Factors by design variable or parameter, as of `swashplate.analysis.whatif`.
    """
    known_to_controller = dict(crane.known_to_controller)
    if axis in known_to_controller:
        known_to_controller[axis] = with_factors(known_to_controller[axis], factors)
    # the verdict stays that of the drive that was redesigned; draws do not
    sources = _without_draws(crane.sources, (axis,))
    drive: dict[str, Any] = {axis: with_factors(getattr(crane, axis), factors)}
    return replace(crane, known_to_controller=known_to_controller, sources=sources, **drive)


def drawn_cranes(crane: Crane, **draws: Draws) -> tuple[Crane, ...]:
    """Cranes whose drives are drawn from the errors of fits, by axis; others keep their drive.

    The controller knows none of the draws: it counts on the drives of the crane that is given,
    which should be the fitted ones. Draws of each axis are shuffled by themselves, so that draws of
    two axes from the same seed are not paired.

    Parameters
    ----------
    crane : Crane
        The crane with the fitted drives.
    **draws
        Draws of `swashplate.analysis.monte_carlo` by axis, by default of the fits that the drives
        come from. There are as many cranes as the shortest has drives.

    Raises
    ------
    InputError
        For a name that is not an axis, and without draws if no drive comes from a fit's folder.
    """
    # only what is drawn needs the identification
    from swashplate.analysis import stored_draws

    check_names("A crane has no drive", draws, AXES, "it has")
    draws = draws or {
        axis: stored_draws(source.fit, drive=getattr(crane, axis))
        for axis, source in crane.sources.items()
        if source.fit is not None
    }
    if not draws:
        raise InputError(
            "Cranes are drawn from the draws of at least one axis, but no drive of "
            f"{crane.name} comes from the folder of a fit, as luff=FOLDER."
        )
    shuffled: dict[str, Any] = {}
    for axis, of_axis in draws.items():
        order = np.random.default_rng(AXES.index(axis)).permutation(len(of_axis.drives))
        shuffled[axis] = [of_axis.drives[k] for k in order]
    sources = _without_draws(crane.sources, shuffled)
    cranes = list[Crane]()
    for combination in zip(*shuffled.values(), strict=False):
        drives = dict(zip(shuffled, combination, strict=True))
        drawn = crane.with_drive(known_to_controller=False, **drives)
        cranes.append(replace(drawn, sources=sources))
    return tuple(cranes)


def _without_draws(
    sources: Mapping[str, DriveSource], axes: Collection[str]
) -> dict[str, DriveSource]:
    """Sources of drives, those of some axes without the fit from which they could be drawn."""
    return {
        axis: source._replace(fit=None) if axis in axes else source
        for axis, source in sources.items()
    }
