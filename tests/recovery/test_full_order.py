"""Masses of the five-state drive from its own logs: exact derivatives of its discrete map."""

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from tests.identification.given import run_of

from swashplate import DomainError, FullOrderDrive, ParameterError
from swashplate.campaign.experiment import Experiment
from swashplate.identification.intervals import uncertainty
from swashplate.identification.model import Linearised
from swashplate.identification.problem import Problem, linearised_fit
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Unknown, Unknowns

Array = np.ndarray

NOISE = {"shaft_speed": np.radians(0.3), "stroker_pressure": 1e3}
"""White, at 512 Hz. [rad/s], [Pa]"""
MASSES = {"spool_mass": 1.6, "swash_inertia": 0.93}
"""What is looked for, and how far from the truth the fit begins."""
BESIDE = {"spool_damping": 0.7, "piston_damping": 1.4, "valve_flow_gain": 0.95, "oil_volume": 1.02}
"""What is not known either."""


class FiveStates:
    """The drive behind a fit, with the exact derivatives of its discrete map."""

    substeps = 20

    def __init__(self, nominal: FullOrderDrive) -> None:
        self.nominal = nominal

    def at(self, values: Mapping[str, float]) -> FullOrderDrive:
        try:
            return self.nominal.replace(**values)
        except ParameterError as error:
            raise DomainError(str(error)) from None

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> dict[str, Array]:
        run = self.at(values).simulate(experiment.input.values, substeps=self.substeps)
        return {name: getattr(run, name) for name in experiment.channels}

    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> dict[str, Linearised]:
        full, command = self.at(values), experiment.input.values
        found = full.simulate(command, substeps=self.substeps)
        how = {"parameters": names, "substeps": self.substeps}
        return {
            name: Linearised(getattr(found, name), full.sensitivities(command, signal=name, **how))
            for name in experiment.channels
        }


@pytest.mark.slow
def test_two_most_visible_masses_are_found() -> None:
    """From steps back and forth, three a second, by two noisy sensors; in the logarithm."""
    truth = FullOrderDrive.preset("hoist")
    known = truth.physical
    time = np.arange(3072) / 512.0
    command = 5.0 * np.sign(np.sin(2.0 * np.pi * 1.5 * time))
    run = truth.simulate(command, substeps=20)
    noise = dict(zip(NOISE, np.random.default_rng(5).normal(size=(2, time.size)), strict=True))
    read = {name: getattr(run, name) + NOISE[name] * noise[name] for name in NOISE}
    unknowns = Unknowns(
        tuple(
            Unknown(name, factor * value, 0.1 * value, 10.0 * value, known[name].unit, log=True)
            for name, factor in {**MASSES, **BESIDE}.items()
            for value in [known.numbers[name]]
        )
    )
    problem = Problem(
        FiveStates(truth),
        [run_of("square", command, read, hold="previous")],
        unknowns,
        channels=tuple(NOISE),
        scales=NOISE,
    )
    found = solve(problem)
    values = problem.unknowns.values(found.vector)
    for each in uncertainty(linearised_fit(problem, found.vector)).estimates:
        right = known.numbers[each.name]
        if each.name in MASSES:
            assert each.lower < right < each.upper, each.name
        assert values[each.name] == pytest.approx(right, rel=0.03), each.name
    # nothing but noise is left: 6144 samples of unit variance
    assert 2.0 * found.cost == pytest.approx(6144.0, rel=0.08)
