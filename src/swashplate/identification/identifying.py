"""From a campaign to a drive and its verdict in one call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import get_args

import numpy as np

from swashplate.campaign import Campaign, Experiment
from swashplate.drive import Drive
from swashplate.errors import InputError, InputTypeError
from swashplate.executors import Executor, Serial
from swashplate.identification.assessment import Identification, versions
from swashplate.identification.diagnostics.data_checks import refuse_unsound, spike_findings
from swashplate.identification.diagnostics.verdict import REQUIRED
from swashplate.identification.estimation.between_samples import doubt
from swashplate.identification.estimation.fit_problem import Parameters, setup_of
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.problem import Loss
from swashplate.identification.estimation.setup import FitSetup, FreeParameters
from swashplate.identification.fitting import Fit, Search, fit
from swashplate.identification.statistics.profiles import profiles_of
from swashplate.machine import Machine
from swashplate.machine import Model as Equations
from swashplate.machine.fields import is_real
from swashplate.parameters import ParameterSet, named_set

MOST_EVALUATIONS = 600


def identify(
    tests: str | Path | Campaign,
    model: str | Path | Drive | ParameterSet | ModelSetup | Machine | Equations | None = None,
    free: FreeParameters | None = None,
    *,
    axis: str | None = None,
    starts: int | None = None,
    profiles: str | Sequence[str] = (),
    seed: int = 0,
    loss: Loss = "linear",
    max_evaluations: int = MOST_EVALUATIONS,
    required: float = REQUIRED,
    executor: Executor | None = None,
    store: str | Path | None = None,
    resume: bool = False,
) -> Identification:
    """Identify a drive, or a user-defined model, from the tests of a campaign.

    Fits the runs with the role ``"fit"``, predicts those with the role
    ``"validate"``, and judges the result: what ``swashplate fit`` does, which calls this function.

    Parameters
    ----------
    tests : path or Campaign
        The campaign, or its file.
    model : Drive, ParameterSet, str or path, or user-defined model, optional
        The drive to begin at: by default the one that the campaign names; a packaged one by its
        name, a parameter file, or the folder of a fit. Or what is fitted instead of a drive: a
        `Machine`, of equations or a `BlackBox`, or a `Model`, with `free`; a `ModelSetup`; a Python
        file that states one.
    free : FitSetup, str, path or mapping, optional
        What to estimate. By default every number of the drive, known beforehand to within 30 %.
        Or a TOML file, a `FitSetup`, or a mapping of the drive's parameters to factors on their
        nominal values, ``{"Z8": (0.5, 2)}``; see `swashplate.identification.as_fit_setup`. Of a
        user-defined model (low, nominal, high) by name, see `ModelSetup`.
    axis : str, optional
        The axis; needed if the campaign has several.
    starts : int, optional
        More starts, spread over the bounds; the best is refined. By default up to six are tried if
        residuals are five times as large as their known measurement error, until
        they no longer are; 0 tries none.
    profiles : str or sequence of str
        Parameters to profile the cost along, by name, or ``"all"``.
    seed : int
        Random seed of the starts.
    loss : {"linear", "soft_l1", "cauchy"}
        Robust loss functions reduce the weight of outliers.
    max_evaluations : int
        Evaluations of the model that a search may take.
    required : float
        Largest stated error of a new maneuver, over the range of the signal, of a usable fit. [1]
    executor : Executor, optional
        Of `swashplate.executors`, for starts and profiles; one after another by
        default. The result does not depend on it.
    store : path, optional
        Folder that keeps the result of each start as it is ready.
    resume : bool
        Take what is in `store` instead of computing it again.

    Returns
    -------
    Identification
        Estimates by name, drive, verdict; `Identification.report` and `Identification.save` write
        them. After Ctrl-C it is the best result so far, without profiles.

    Raises
    ------
    FileError
        If the campaign, a log or another file cannot be read; a missing one is a
        ``FileNotFoundError`` as well.
    ParameterError
        If an entry of a file, or of `free`, is wrong.
    InputError
        If tests, model and what is free do not fit each other, a number is out of its range, or no
        fit of these runs can mean anything; an argument of another kind is a ``TypeError`` as well.
    DomainError
        If the model does not hold at the nominal values.

    Examples
    --------
    >>> from swashplate import Drive, identify, maneuvers, rig
    >>> tests = rig.run("hoist", {"step": maneuvers.step(9.0), "sine": maneuvers.sine(9.0, 0.1)})
    >>> file = rig.write(tests, "virtual")
    >>> result = identify(file, "hoist", {"Z8": (0.5, 2), "Z16": (0.5, 2)})
    >>> abs(result["Z8"].value / Drive.preset("hoist")["Z8"].value - 1.0) < 0.05
    True
    >>> result.verdict.usable
    True
    """
    _check_counts(
        starts=0 if starts is None else starts,
        seed=seed,
        max_evaluations=max_evaluations,
    )
    if loss not in get_args(Loss):
        raise InputError(f"The loss is {loss!r}, but must be one of {', '.join(get_args(Loss))}.")
    if not is_real(required) or not 0.0 < required < inf:
        raise InputError(
            f"required is {required!r}, but must be an error over the range, above 0: 0.05 for 5 %."
        )
    profiles = (profiles,) if isinstance(profiles, str) else profiles
    if not isinstance(tests, str | Path | Campaign):
        raise InputTypeError(
            f"The tests are a {type(tests).__name__}: give the path of a campaign file, which "
            "swashplate.drafting.draft_campaign makes of logs, or a Campaign."
        )
    campaign = tests if isinstance(tests, Campaign) else Campaign.from_toml(tests)
    axis = only_axis(campaign, axis)
    runs = runs_to_fit(campaign, axis)
    nominal, setup = _stated(campaign, axis, model, free, runs)

    search = None
    if starts is not None:
        folder = None if store is None else Path(store)
        search = Search(starts, seed, executor or Serial(), store=folder, resume=resume)
    result = _fitted(nominal, runs, setup, loss, max_evaluations, search)
    _check_profiles(result, profiles)
    campaign = campaign.with_interpolation(axis, result.runs[0].input.interpolation)
    notes = {**versions(), "seed": str(seed), "campaign": str(campaign.path)}
    identification = Identification(campaign, result, notes=notes, required=required)
    if result.interrupted:
        return identification
    if profiles:
        names = None if "all" in profiles else profiles
        curves = list(profiles_of(result, names, executor=executor).values())
        identification = replace(identification, profiles=curves)
    return identification


def _fitted(
    nominal: Parameters,
    runs: Sequence[Experiment],
    setup: FitSetup,
    loss: Loss,
    max_evaluations: int,
    search: Search | None,
) -> Fit:
    """The fit, with doubts about what a stated command does between its samples."""
    result = fit(nominal, runs, setup, loss=loss, max_evaluations=max_evaluations, search=search)
    if not all(run.input.settled for run in runs):
        return result
    doubts = doubt(result.runs, result.nominal, result.setup, loss=loss)
    return replace(result, doubts=(*result.doubts, *doubts))


def _check_counts(**counts: object) -> None:
    """Refuse counts that are not whole numbers of 0 or more, of evaluations of 1 or more."""
    for name, number in counts.items():
        least = 1 if name == "max_evaluations" else 0
        if not isinstance(number, int | np.integer) or isinstance(number, bool) or number < least:
            raise InputError(
                f"{name} is {number!r}, but must be a whole number of {least} or more."
            )


def only_axis(campaign: Campaign, axis: str | None) -> str:
    """The axis of a name, or the only one of a campaign; an `InputError` if it has several."""
    if axis is not None:
        campaign.select(axis=axis)
        return axis
    if len(campaign.axes) > 1:
        axes = ", ".join(campaign.axes)
        raise InputError(f"{campaign.path} has the axes {axes}; name one of them as the axis.")
    return next(iter(campaign.axes))


def runs_to_fit(campaign: Campaign, axis: str) -> tuple[Experiment, ...]:
    """The runs of an axis with the role 'fit', at least one; gross spikes of others are refused."""
    runs = campaign.select(axis=axis, role="fit")
    refuse_unsound(spike_findings(campaign.select(axis=axis, role="validate"), "linear"))
    if not runs:
        raise InputError(f"{campaign.path}: no run of the axis '{axis}' has the role 'fit'.")
    return runs


def _stated(
    campaign: Campaign,
    axis: str,
    model: object,
    free: FreeParameters | None,
    runs: Sequence[Experiment],
) -> tuple[Parameters, FitSetup]:
    """The nominal parameters, and what is estimated of them."""
    if isinstance(model, str | Path) and Path(model).suffix == ".py":
        model = ModelSetup.from_file(model)
    if isinstance(model, ModelSetup):
        if free is not None:
            raise InputError(f"{model.name} defines its free parameters: leave out 'free'.")
        nominal = model.nominal(runs)
        return nominal, nominal.setup
    drive: object = model
    if model is None:
        drive = campaign.drive(axis).parameters
    elif isinstance(model, str | Path):
        drive = named_set(model)
    elif isinstance(model, Drive):
        drive = model.parameters
    if isinstance(drive, ParameterSet):
        return drive, setup_of(campaign, axis, drive, free)
    if not isinstance(drive, Machine | Equations):
        raise InputTypeError(
            f"The model is {drive!r}: give a Drive, the name of a packaged one such as 'hoist', a "
            "parameter file, the folder of a fit, or a Machine or Model of your own."
        )
    if not isinstance(free, Mapping):
        raise InputError(
            "A user-defined model needs a mapping of its free parameters, by name: "
            "{'lag': (0.005, 0.06, 0.5)}, lower bound, nominal value and upper bound."
        )
    nominal = ModelSetup(drive, free).nominal(runs)
    return nominal, nominal.setup


def _check_profiles(result: Fit, profiles: Sequence[str]) -> None:
    """Refuse names of profiles that the fit does not estimate."""
    unknowns = result.problem.unknowns
    labels = [unknown.label for unknown in unknowns]
    for name in profiles:
        if name != "all" and name not in labels:
            machine = ", ".join(unknown.label for unknown in unknowns if unknown.run is None)
            raise InputError(f"There is no parameter '{name}'; there are {machine}.")
