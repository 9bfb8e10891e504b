"""Validation: runs that were held back, predicted from the command alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from swashplate.campaign.experiment import Experiment
from swashplate.errors import InputError
from swashplate.identification.assessment import RunQuality, compared
from swashplate.identification.drive_model import SIGNALS, DriveModel
from swashplate.identification.drives import current_record
from swashplate.parameters.parameter_set import ParameterSet


def predict(parameters: ParameterSet, experiments: Sequence[Experiment]) -> tuple[RunQuality, ...]:
    """Predict runs from their input alone and compare every channel that the drive has.

    Parameters
    ----------
    parameters : ParameterSet
        The drive.
    experiments : sequence of Experiment
        Runs that it was not fitted to. A voltage goes through the whole chain, a current through
        pump and motor.

    Returns
    -------
    tuple of RunQuality
        One for each run and channel. The free zero of a position is the one that fits best.

    Raises
    ------
    InputError
        If a run is driven by neither, or has no channel that a drive has.
    DomainError
        If the model does not hold under a run's input.
    """
    made = []
    for experiment in experiments:
        if not any(channel.kind in SIGNALS for channel in experiment.channels.values()):
            raise InputError(f"{experiment.name} has no channel that a drive has.")
        if experiment.input.kind == "current":
            model = DriveModel(parameters, "pump", {experiment.name: current_record(experiment)})
        else:
            model = DriveModel(parameters, "chain")
        for name, simulated in model.simulate({}, experiment).items():
            channel = experiment[name]
            if channel.is_position and channel.used.any():
                zero = np.average(channel.values - simulated, weights=channel.weight)
                simulated = simulated + zero
            if channel.used.any():
                made.append(compared(experiment, name, simulated))
    return tuple(made)
