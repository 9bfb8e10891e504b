"""What the answer on a crane hangs on: the number that, if it were another, would turn it.

Roll period, damping of the load, height, period and peak of the sea, its heading, the luff's drum:
each is moved alone to both ends of what is plausible, and the answer asked again, shortly. Swing
without control comes from the frequency domain, with control from a few simulated seaways.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from swashplate.crane.closed_loop.operator_command import OperatorCommand
from swashplate.crane.crane import Crane
from swashplate.crane.sea.extremes import largest_of_peaks
from swashplate.crane.sea.seaway import Seaway
from swashplate.crane.sea.transfer_functions import Hull
from swashplate.crane.studies.run_outcome import RunOutcome
from swashplate.crane.studies.spectral import linear_response
from swashplate.crane.studies.study import Case, Study
from swashplate.errors import SwashplateError

SEAWAYS, LENGTH = 6, 300.0
"""Seaways of a short answer, and the time for which each counts: half an hour together. [s]"""
TIGHT = 0.9
"""Part of a limit, or of the swing without control, from which on a short answer is not sure."""
DAMPINGS = (0.002, 0.01)
"""Least and largest damping ratio of loads on ropes."""
PERIOD, ROLL, HEIGHT, DRUM = 0.15, 0.2, 0.25, 0.2
"""Parts by which the sea's period, the ship's roll period, the height of the waves and the radius
of a drum are moved: what forecasts, trials without ballast records and type plates leave open."""
TURNED = 30.0
"""By which the heading is moved. [deg]"""
PEAKS = (1.0, 3.3)
"""Peak factors of a fully developed and of a young sea."""


class TippingPoint(NamedTuple):
    """A number that would turn the answer."""

    what: str
    """In words: ``"the roll period"``."""
    used: str
    """What it is, with unit."""
    other: str
    """With what the answer is another one."""
    assumed: bool
    """Whether it is assumed, not given."""
    passes: bool
    """Whether control passes then."""

    def words(self) -> str:
        """A sentence."""
        status = ", which is assumed," if self.assumed else ""
        then = "would pass" if self.passes else "would not pass"
        return (
            f"With {self.what} of {self.other} in place of {self.used}{status} control {then}, by "
            "a short run."
        )


class _Trial(NamedTuple):
    what: str
    used: str
    other: str
    assumed: bool
    seaway: Seaway
    case: Case


def tipping_points_of(
    study: Study, assessed: str, limits: Mapping[str, float]
) -> tuple[TippingPoint, ...]:
    """Numbers that would turn the answer on a variant; none if short runs do not agree with it.

    Parameters
    ----------
    study : Study
    assessed : str
        The variant.
    limits : mapping of str to float
        In SI, by name; without them only harm counts.
    """
    case = study.cases[assessed]
    if case.stick.samples is not None or case.stick.parts:
        return ()  # what the operator does takes as long as it takes
    case = case._replace(stick=OperatorCommand.rest(study.run_in + LENGTH))
    short = replace(study, seeds=study.seeds[:SEAWAYS], progress=None)
    base = _passes(short, study.seaway, case, limits)
    tipping_points = []
    for trial in _trials(study, case):
        try:
            passes = _passes(short, trial.seaway, trial.case, limits)
        except SwashplateError:  # a number that this sea, ship or crane cannot have
            continue
        if passes is not base and passes is not None and base is not None:
            tipping_points.append(
                TippingPoint(trial.what, trial.used, trial.other, trial.assumed, passes)
            )
    return tuple(tipping_points)


def _trials(study: Study, case: Case) -> Iterator[_Trial]:
    seaway, crane = study.seaway, study.crane
    spectrum, ship = seaway.spectrum, seaway.ship
    if isinstance(ship, Hull):
        used = f"{ship.roll_period:.3g} s"
        for factor in (1.0 - ROLL, 1.0 + ROLL):
            other = replace(ship, roll_period=factor * ship.roll_period)
            moved = replace(seaway, ship=other)
            text = f"{other.roll_period:.3g} s"
            yield _Trial("the ship's roll period", used, text, True, moved, case)
    used = f"{100.0 * case.swing_damping:.3g} %"
    assumed = "swing_damping" not in case.hangs and _assumed(crane, "swing_damping")
    for ratio in DAMPINGS:
        words = "a damping of the swing", used, f"{100.0 * ratio:.3g} %"
        yield _Trial(*words, assumed, seaway, case.changed(swing_damping=ratio))
    for factor in (1.0 - HEIGHT, 1.0 + HEIGHT):
        other_sea = replace(spectrum, height=factor * spectrum.height)
        words = "waves", f"{spectrum.height:.3g} m", f"{other_sea.height:.3g} m"
        yield _Trial(*words, False, replace(seaway, sea=other_sea), case)
    for factor in (1.0 - PERIOD, 1.0 + PERIOD):
        other_sea = replace(spectrum, period=factor * spectrum.period)
        words = "a peak period", f"{spectrum.period:.3g} s", f"{other_sea.period:.3g} s"
        yield _Trial(*words, False, replace(seaway, sea=other_sea), case)
    for peak in PEAKS:
        if peak != spectrum.peak_factor:
            other_sea = replace(spectrum, peak_factor=peak)
            words = "a peak factor", f"{spectrum.peak_factor:g}", f"{peak:g}"
            yield _Trial(*words, True, replace(seaway, sea=other_sea), case)
    for turn in (-TURNED, TURNED):
        moved = replace(seaway, heading_deg=seaway.heading_deg + turn)
        words = "a heading", f"{seaway.heading_deg:g} deg", f"{moved.heading_deg:g} deg"
        yield _Trial(*words, False, moved, case)
    drum = crane.quantities["luff_drum_radius"]
    if _assumed(crane, "luff_drum_radius"):
        for factor in (1.0 - DRUM, 1.0 + DRUM):
            radius = factor * drum.values[0]
            cranes = tuple(each.with_geometry(luff_drum_radius=radius) for each in case.cranes)
            words = "a luff drum's radius", f"{drum.values[0]:.3g} m", f"{radius:.3g} m"
            yield _Trial(*words, True, seaway, case._replace(cranes=cranes))


def _assumed(crane: Crane, name: str) -> bool:
    return crane.quantities[name].status == "assumed"


def _passes(study: Study, seaway: Seaway, case: Case, limits: Mapping[str, float]) -> bool | None:
    """Whether control passes, shortly; None if it is too close to say."""
    found = [outcome for (outcome,) in replace(study, seaway=seaway).outcomes([case])]
    if any(outcome.departure_reason for outcome in found):
        return False
    ratios = [_over_none(seaway, case, found)]
    observed = sum(outcome.counted for outcome in found)
    for name, limit in limits.items():
        if name == "saturation":
            ratios.append(float(np.mean([outcome.saturation for outcome in found])) / limit)
        elif all(name in outcome.peaks for outcome in found):
            runs = [outcome.peaks[name] for outcome in found]
            ratios.append(largest_of_peaks(runs, observed).value / limit)
    worst = max(ratios)
    if TIGHT < worst < 1.0 / TIGHT:
        return None
    return worst <= 1.0


def _over_none(seaway: Seaway, case: Case, found: list[RunOutcome]) -> float:
    """Root mean square swing over that without control."""
    linear = linear_response(case.cranes[0], seaway, **case.pose, **case.hangs)
    own = np.sqrt(np.mean([outcome.rms_swing**2 for outcome in found]))
    return float(own / linear.values["swing"].rms)
