"""Masses of the five-state drive from its own logs: exact derivatives of its discrete map."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swashplate import Campaign, DomainError, FullOrderDrive, ParameterError
from swashplate.campaign.experiment import Experiment
from swashplate.equations.marching.jacobian import jacobian
from swashplate.equations.marching.observation import Observation, ObservedRecord
from swashplate.equations.marching.record import record_of
from swashplate.full_order.drive import path_of
from swashplate.identification.intervals import uncertainty
from swashplate.identification.model import Linearised
from swashplate.identification.problem import Problem, linearised_fit
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Unknown, Unknowns

Array = np.ndarray

SIGNALS = {"speed": "shaft_speed", "pressure": "stroker_pressure"}
NOISE = {"speed": np.radians(0.3), "pressure": 1e3}
"""White, at 512 Hz. [rad/s], [Pa]"""
MASSES = {"spool_mass": 1.6, "swash_inertia": 0.93}
"""What is looked for, and how far from the truth the fit begins."""
BESIDE = {"spool_damping": 0.7, "piston_damping": 1.4, "valve_flow_gain": 0.95, "oil_volume": 1.02}
"""What is not known either."""


class Differences:
    """The drive behind a fit that differentiates it by central differences."""

    def __init__(self, nominal: FullOrderDrive) -> None:
        self.nominal, self.substeps, self.runs = nominal, 20, 0

    def at(self, values: Mapping[str, float]) -> FullOrderDrive:
        try:
            return self.nominal.replace(**values)
        except ParameterError as error:
            raise DomainError(str(error)) from None

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> dict[str, Array]:
        self.runs += 1
        run = self.at(values).simulate(experiment.input.values, substeps=self.substeps)
        return {name: getattr(run, SIGNALS[name]) for name in experiment.channels}


class Exact(Differences):
    """The same with exact derivatives."""

    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> dict[str, Linearised]:
        record = record_of(experiment.input.values, 512.0, what="voltage")
        zeros = np.zeros(record.time.size)
        channels = list(experiment.channels)
        seen = [Observation(SIGNALS[name], record.time, zeros) for name in channels]
        observed = ObservedRecord(record, seen)
        instance = self.at(values).instance(record.step, substeps=self.substeps)
        found = jacobian(instance, observed, [path_of(name) for name in names])
        rows = {name: observed.rows_of(k) for k, name in enumerate(channels)}
        return {k: Linearised(found.residuals[r], found.columns[r]) for k, r in rows.items()}


@pytest.fixture(scope="module")
def truth() -> FullOrderDrive:
    return FullOrderDrive.preset("hoist")


@pytest.fixture(scope="module")
def campaign(truth: FullOrderDrive, tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Steps back and forth, three a second, as a logger with two sensors has them."""
    folder: Path = tmp_path_factory.mktemp("five")
    time = np.arange(3072) / 512.0
    command = 5.0 * np.sign(np.sin(2.0 * np.pi * 1.5 * time))
    run = truth.simulate(command, substeps=20)
    noise = np.random.default_rng(5).normal(size=(2, time.size))
    pl.DataFrame(
        {
            "time": time,
            "voltage": command,
            "speed": run.shaft_speed + NOISE["speed"] * noise[0],
            "pressure": run.stroker_pressure + NOISE["pressure"] * noise[1],
        }
    ).write_csv(folder / "square.csv")
    (folder / "campaign.toml").write_text(
        """
[axes.hoist]
time = { column = "time", unit = "s" }
input = { kind = "voltage", column = "voltage", unit = "V" }
channels.speed = { kind = "shaft_speed", column = "speed", unit = "rad/s" }
channels.pressure = { kind = "stroker_pressure", column = "pressure", unit = "Pa" }

[[runs]]
file = "square.csv"
""",
        "utf-8",
    )
    return Campaign.from_toml(folder / "campaign.toml")


def problem_of(model: Differences, campaign: Campaign, begun: Mapping[str, float]) -> Problem:
    known = model.nominal.physical
    unknowns = [
        Unknown(
            name,
            factor * known.numbers[name],
            0.1 * known.numbers[name],
            10.0 * known.numbers[name],
            known[name].unit,
            log=True,
        )
        for name, factor in begun.items()
    ]
    return Problem(
        model,
        campaign.experiments,
        Unknowns(tuple(unknowns)),
        channels=("speed", "pressure"),
        scales=NOISE,
    )


@pytest.mark.slow
def test_two_most_visible_masses_are_found(truth: FullOrderDrive, campaign: Campaign) -> None:
    """In the logarithm, with dampings, valve and oil unknown beside them."""
    problem = problem_of(Exact(truth), campaign, {**MASSES, **BESIDE})
    found = solve(problem)
    values = problem.unknowns.values(found.vector)
    for each in uncertainty(linearised_fit(problem, found.vector)).estimates:
        right = truth.physical.numbers[each.name]
        if each.name in MASSES:
            assert each.lower < right < each.upper, each.name
        assert values[each.name] == pytest.approx(right, rel=0.03), each.name
    # nothing but noise is left: 6144 samples of unit variance
    assert 2.0 * found.cost == pytest.approx(6144.0, rel=0.08)
