"""Tipping points of the answer on a crane: numbers that would change it if they had another value.

Roll period, damping of the load, height, period and peak of the sea, its heading, the luff's drum:
one at a time is set to both ends of its plausible range, and the answer is computed again from
short runs. Swing without control comes from the frequency domain, with control from a few simulated
seaways.
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

SEAWAYS = 6
"""Number of seaways of the short runs."""
SHORT_RUN_TIME = 300.0
"""Evaluated time of each short run: half an hour for all of them. [s]"""
UNDECIDED_FROM = 0.9
"""Ratio to a limit, or to the swing without control, from which short runs do not decide; they
decide again above its inverse."""
DAMPINGS = (0.002, 0.01)
"""Least and largest damping ratio of loads on ropes."""
PERIOD, ROLL, HEIGHT, DRUM = 0.15, 0.2, 0.25, 0.2
"""Relative changes of the sea's period, the ship's roll period, the height of the waves and the
radius of a drum: what forecasts, trials without ballast records and type plates leave open."""
TURNED = 30.0
"""Change of the heading. [deg]"""
PEAKS = (1.0, 3.3)
"""Peak factors of a fully developed and of a young sea."""


class TippingPoint(NamedTuple):
    """A number that would change the answer."""

    quantity: str
    """Its name in a sentence: ``"the roll period"``."""
    present_value: str
    """The value that the answer was computed with, with unit."""
    other_value: str
    """The value that changes the answer, with unit."""
    assumed: bool
    """Whether the present value is assumed, not given."""
    passes: bool
    """Whether control passes with the other value."""

    def sentence(self) -> str:
        """State that control would or would not pass with the other value."""
        assumed = ", which is assumed," if self.assumed else ""
        passes = "would pass" if self.passes else "would not pass"
        return (
            f"With {self.quantity} of {self.other_value} in place of {self.present_value}{assumed} "
            f"control {passes}, by a short run."
        )


class _ChangedNumber(NamedTuple):
    """A number with another value, and seaway and variant with that value."""

    quantity: str
    present_value: str
    other_value: str
    assumed: bool
    seaway: Seaway
    case: Case


def tipping_points_of(
    study: Study, variant: str, limits: Mapping[str, float]
) -> tuple[TippingPoint, ...]:
    """Numbers that would change the answer on a variant; none if short runs do not decide it.

    Parameters
    ----------
    study : Study
    variant : str
        A name of the study's cases.
    limits : mapping of str to float
        In SI, by name; without them only the swing is compared with that without control.
    """
    case = study.cases[variant]
    if case.command.samples is not None or case.command.parts:
        return ()  # an operator's command cannot be shortened
    case = case._replace(command=OperatorCommand.rest(study.run_in + SHORT_RUN_TIME))
    short = replace(study, seeds=study.seeds[:SEAWAYS], progress=None)
    base = _passes(short, study.seaway, case, limits)
    tipping_points = []
    for changed in _changed_numbers(study, case):
        try:
            passes = _passes(short, changed.seaway, changed.case, limits)
        except SwashplateError:  # a value that this sea, ship or crane cannot have
            continue
        if passes is not base and passes is not None and base is not None:
            point = TippingPoint(
                quantity=changed.quantity,
                present_value=changed.present_value,
                other_value=changed.other_value,
                assumed=changed.assumed,
                passes=passes,
            )
            tipping_points.append(point)
    return tuple(tipping_points)


def _changed_numbers(study: Study, case: Case) -> Iterator[_ChangedNumber]:
    yield from _other_ships(study, case)
    yield from _other_dampings(study, case)
    yield from _other_seas(study, case)
    yield from _other_drums(study, case)


def _other_ships(study: Study, case: Case) -> Iterator[_ChangedNumber]:
    ship = study.seaway.ship
    if not isinstance(ship, Hull):
        return
    for factor in (1.0 - ROLL, 1.0 + ROLL):
        changed_ship = replace(ship, roll_period=factor * ship.roll_period)
        yield _ChangedNumber(
            quantity="the ship's roll period",
            present_value=f"{ship.roll_period:.3g} s",
            other_value=f"{changed_ship.roll_period:.3g} s",
            assumed=True,
            seaway=replace(study.seaway, ship=changed_ship),
            case=case,
        )


def _other_dampings(study: Study, case: Case) -> Iterator[_ChangedNumber]:
    for ratio in DAMPINGS:
        yield _ChangedNumber(
            quantity="a damping of the swing",
            present_value=f"{100.0 * case.swing_damping:.3g} %",
            other_value=f"{100.0 * ratio:.3g} %",
            assumed="swing_damping" not in case.hangs and _assumed(study.crane, "swing_damping"),
            seaway=study.seaway,
            case=case.changed(swing_damping=ratio),
        )


def _other_seas(study: Study, case: Case) -> Iterator[_ChangedNumber]:
    seaway = study.seaway
    spectrum = seaway.spectrum
    for factor in (1.0 - HEIGHT, 1.0 + HEIGHT):
        sea = replace(spectrum, height=factor * spectrum.height)
        yield _ChangedNumber(
            quantity="waves",
            present_value=f"{spectrum.height:.3g} m",
            other_value=f"{sea.height:.3g} m",
            assumed=False,
            seaway=replace(seaway, sea=sea),
            case=case,
        )
    for factor in (1.0 - PERIOD, 1.0 + PERIOD):
        sea = replace(spectrum, period=factor * spectrum.period)
        yield _ChangedNumber(
            quantity="a peak period",
            present_value=f"{spectrum.period:.3g} s",
            other_value=f"{sea.period:.3g} s",
            assumed=False,
            seaway=replace(seaway, sea=sea),
            case=case,
        )
    for peak in PEAKS:
        if peak != spectrum.peak_factor:
            yield _ChangedNumber(
                quantity="a peak factor",
                present_value=f"{spectrum.peak_factor:g}",
                other_value=f"{peak:g}",
                assumed=True,
                seaway=replace(seaway, sea=replace(spectrum, peak_factor=peak)),
                case=case,
            )
    for turn in (-TURNED, TURNED):
        turned = replace(seaway, heading_deg=seaway.heading_deg + turn)
        yield _ChangedNumber(
            quantity="a heading",
            present_value=f"{seaway.heading_deg:g} deg",
            other_value=f"{turned.heading_deg:g} deg",
            assumed=False,
            seaway=turned,
            case=case,
        )


def _other_drums(study: Study, case: Case) -> Iterator[_ChangedNumber]:
    if not _assumed(study.crane, "luff_drum_radius"):
        return
    present_radius = study.crane.quantities["luff_drum_radius"].values[0]
    for factor in (1.0 - DRUM, 1.0 + DRUM):
        radius = factor * present_radius
        cranes = tuple(crane.with_geometry(luff_drum_radius=radius) for crane in case.cranes)
        yield _ChangedNumber(
            quantity="a luff drum's radius",
            present_value=f"{present_radius:.3g} m",
            other_value=f"{radius:.3g} m",
            assumed=True,
            seaway=study.seaway,
            case=case._replace(cranes=cranes),
        )


def _assumed(crane: Crane, name: str) -> bool:
    return crane.quantities[name].status == "assumed"


def _passes(study: Study, seaway: Seaway, case: Case, limits: Mapping[str, float]) -> bool | None:
    """Whether control stays within limits in short runs, and swings less than without control.

    None if the largest ratio is too close to 1 to decide from short runs.
    """
    outcomes = [outcome for (outcome,) in replace(study, seaway=seaway).outcomes([case])]
    if any(outcome.departure_reason for outcome in outcomes):
        return False
    ratios = [_swing_ratio(seaway, case, outcomes)]
    evaluated_time = sum(outcome.evaluated_time for outcome in outcomes)
    for name, limit in limits.items():
        if name == "saturation":
            ratios.append(float(np.mean([outcome.saturation for outcome in outcomes])) / limit)
        elif all(name in outcome.peaks for outcome in outcomes):
            peaks = [outcome.peaks[name] for outcome in outcomes]
            ratios.append(largest_of_peaks(peaks, evaluated_time).value / limit)
    largest_ratio = max(ratios)
    if UNDECIDED_FROM < largest_ratio < 1.0 / UNDECIDED_FROM:
        return None
    return largest_ratio <= 1.0


def _swing_ratio(seaway: Seaway, case: Case, outcomes: list[RunOutcome]) -> float:
    """Root mean square swing over that without control."""
    linear = linear_response(case.cranes[0], seaway, **case.pose, **case.hangs)
    controlled = np.sqrt(np.mean([outcome.rms_swing**2 for outcome in outcomes]))
    return float(controlled / linear.values["swing"].rms)
