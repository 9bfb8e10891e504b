"""Virtual campaigns that stand in for Kruse's, each simulated once."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from tempfile import TemporaryDirectory

from scipy.optimize import brentq

from swashplate import rig
from swashplate.campaign import Campaign, Experiment
from swashplate.drive import Drive
from swashplate.parameters import FULL_VOLTAGE

SEVERITY: rig.Severity = "realistic"
REFINEMENTS = {"hoist": {"spool_friction": 0.115, "spool_presliding": 5e-5, "dither_time": 0.6}}
BACKLASH = {"slew": 0.002}
"""What Kruse (2001) saw and did not model: overshooting steps; a turret's play [rad]."""
ON_CURRENT = 1.5
"""Factor that Kruse (2001) put on the luff axis's measured current. [1]"""
BELOW_STOP = 0.98
"""Share of the largest speed that the stand-in card reaches at 10 V. [1]"""


@dataclass(frozen=True)
class Bench:
    """Virtual tests of one seed."""

    seed: int
    _kept: dict[tuple[str, str], tuple[rig.VirtualTests, Campaign]] = field(
        default_factory=dict, repr=False, compare=False
    )

    def tests(self, axis: str, effects: bool = False) -> tuple[rig.VirtualTests, Campaign]:
        """Kruse's tests of an axis: what was simulated, and the logs as a campaign reads them.

        The published drive is what is simulated; of luff with the stand-in card. With `effects` it
        does what Kruse (2001) saw of the axis and did not model.
        """
        key = axis, "effects" if effects else ""
        if key not in self._kept:
            truth = with_stand_in_card() if axis == "luff" else Drive.preset(axis)
            tools = rig.SEVERITIES[SEVERITY]
            if effects:
                truth = truth.replace(**REFINEMENTS.get(axis, {}))
                tools = replace(tools, backlash=BACKLASH.get(axis, 0.0))
            made = rig.run(
                axis,
                truth=truth,
                seed=self.seed,
                severity=SEVERITY,
                instruments=tools,
            )
            with TemporaryDirectory() as folder:
                self._kept[key] = made, Campaign.from_toml(rig.write(made, folder))
        return self._kept[key]

    def run(self, axis: str, test: str) -> Experiment:
        """One test as the campaign reads it."""
        made, campaign = self.tests(axis)
        return campaign[made.runs[test].stem]


def with_stand_in_card() -> Drive:
    """The luff drive with a card in place of the one whose measured current is not at hand.

    Notes
    -----
    The source drove the pump by 1.5 times the current measured of another maker's card and put the
    swash plate's stops just above the highest speeds it saw. So 1.5 times the current that the
    largest commands gave must have settled just below the stops. The stand-in is the Rexroth card
    of the axis with jump and gain scaled, each direction by itself, to settle at 98 % of each at
    ±10 V: shape and share are assumed.
    """
    luff = Drive.preset("luff")
    factors = []
    for sign, stop in zip((1.0, -1.0), luff["Z13"].values, strict=True):
        wanted = BELOW_STOP * luff["Z10"].values[0] * stop
        settled = brentq(
            lambda ampere, s=sign, w=wanted: _speed(luff, s * ampere) * s - w, 0.0, 1.0
        )
        factors.append(settled / ON_CURRENT / abs(luff.steady_current(sign * FULL_VOLTAGE)))
    plus, minus = factors
    title = "Luffing winch with a stand-in for the card that was measured; assumed"
    return luff.scale(J=(plus, minus), G1=(plus, minus)).renamed("luff", title)


def _speed(drive: Drive, current: float) -> float:
    """Speed that pump and motor settle at under a constant current. [rad/s]"""
    return float(drive.simulate_current([current, current], start="steady").shaft_speed[0])
