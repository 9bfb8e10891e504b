"""What drives the march in an experiment: its command, or a signed current, on the march's grid."""

from __future__ import annotations

from collections.abc import Sequence

from swashplate.campaign.experiment import Experiment
from swashplate.equations.marching.record import SLOWEST, SOURCE_RATE, Record, even_rate, record_of
from swashplate.equations.marching.run import Start
from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.instance import at_every_rate
from swashplate.simulation.run import check_voltage, simulate_drive

OTHER_RATE = 0.01
"""Part by which a rate must differ to be another one."""


def voltage_record(experiment: Experiment) -> Record:
    """An experiment's command on the march's grid.

    Raises
    ------
    InputError
        If its input is no voltage, or leaves the card's range.
    """
    if experiment.input.kind != "voltage":
        raise InputError(
            f"{experiment.name} is driven by a {experiment.input.kind}, not by a voltage: fit the "
            "pump alone."
        )
    return check_voltage(_record(experiment, "voltage"), clip=False)


def current_record(experiment: Experiment) -> Record:
    """An experiment's signed current, measured as its input, on the march's grid."""
    if experiment.input.kind != "current":
        raise InputError(f"{experiment.name} is not driven by a current.")
    return _record(experiment, "current")


def simulated_current(experiment: Experiment, parameters: ParameterSet) -> Record:
    """The signed current that a card makes of an experiment's command."""
    record = voltage_record(experiment)
    start: Start = "steady" if experiment.start == "steady" else "rest"
    # refinements begin behind the card
    run = simulate_drive(parameters.plain, record, start)
    return Record(run.fine("current"), record.start, record.rate, record.substeps)


def at_rate_of(
    experiments: Sequence[Experiment], parameters: ParameterSet
) -> tuple[ParameterSet, tuple[str, ...]]:
    """A set whose card's filter holds at the rate of the runs, and what was changed for that.

    Returns
    -------
    parameters : ParameterSet
        With the filter's differential equation, if a run is marched at another rate than the one
        that its recursion belongs to; otherwise as they are.
    said : tuple of str
        A sentence, if they were changed.
    """
    if parameters.rate is None:
        return parameters, ()
    driven = [each for each in experiments if each.input.kind == "voltage"]
    rates = {each.name: 1.0 / voltage_record(each).step for each in driven}
    for name, rate in rates.items():
        if abs(rate / parameters.rate - 1.0) > OTHER_RATE:
            return at_every_rate(parameters), (
                f"{name} is marched at {rate:.4g} Hz, but the card's filter of {parameters.name} "
                f"is a recursion for {parameters.rate:g} Hz: the fit takes the differential "
                "equation with the same poles, which holds at every rate.",
            )
    return parameters, ()


def _record(experiment: Experiment, what: str) -> Record:
    """The input on a uniform grid, its own where its stamps are even."""
    time, values = experiment.input.time, experiment.input.values
    interpolation = experiment.input.interpolation
    rate = even_rate(time)
    if rate is not None and rate >= SLOWEST:
        own = record_of(values, rate, what=what, interpolation=interpolation)
        return Record(own.values, float(time[0]), own.rate, own.substeps)
    return record_of(values, SOURCE_RATE, what=what, time=time, interpolation=interpolation)
