"""What follows a fit: its assessment, predictions, verdict, and what else was asked for."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from swashplate.__about__ import __version__
from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment, RunQuality, assess
from swashplate.identification.bootstrap import Bootstrap, bootstraps_of
from swashplate.identification.cross_validation import CrossValidation, cross_validate
from swashplate.identification.profile import profiles_of
from swashplate.identification.storing import StageProfile, StoredFit, save_fit
from swashplate.identification.validation import predict
from swashplate.identification.verdict import Verdict, verdict
from swashplate.parameters.definitions import find
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.results import Result

if TYPE_CHECKING:
    from swashplate.campaign import Campaign, Experiment
    from swashplate.executors import Executor
    from swashplate.identification.fitting import Fit
    from swashplate.identification.setup import Setup
    from swashplate.identification.solving import Loss
    from swashplate.identification.staging import Parameters
    from swashplate.identification.uncertainty import Estimate
    from swashplate.tables import Table


@dataclass(frozen=True)
class Wanted:
    """What was asked for besides the fit."""

    folds: int = 0
    bootstrap: int = 0
    profiles: tuple[str, ...] = ()
    """Unknowns by name, or ``"all"``."""
    seed: int = 0
    executor: Executor | None = None
    loss: Loss = "linear"
    required: float = 0.1
    """Largest error of held-out runs over their range."""


@dataclass(frozen=True, eq=False)
class Judged(Result):
    """A fit and all that was found out about it."""

    campaign: Campaign
    result: Fit
    runs: Sequence[Experiment]
    assessments: Sequence[Assessment]
    predicted: Sequence[RunQuality]
    verdict: Verdict
    bootstraps: Mapping[str, Bootstrap] = field(default_factory=dict)
    """By stage."""
    profiles: Sequence[StageProfile] = ()
    folds: CrossValidation | None = None
    notes: Mapping[str, str] = field(default_factory=dict)
    """Versions, seed, campaign."""

    def tables(self) -> list[Table]:
        """Criteria of the verdict, then the fit's tables and the errors of held-out runs."""
        from swashplate.identification.tables import criteria_table, runs_tables

        return [
            criteria_table(self.verdict),
            *self.result.tables(),
            *(runs_tables(self.predicted) if self.predicted else ()),
        ]

    @property
    def sentences(self) -> tuple[str, ...]:
        """The verdict's headline and all that it says."""
        return (self.verdict.headline, *self.verdict.sentences)

    def name_of(self, profile: StageProfile) -> str:
        """The unknown that a profile is of."""
        stage = next(each for each in self.result.stages if each.stage.name == profile.stage)
        return stage.problem.unknowns.names[profile.profile.index]

    def store(self, path: Path) -> None:
        """Write what `storing.load_fit` reads and the report can be made from again."""
        save_fit(
            self.result,
            self.runs,
            path,
            campaign=self.campaign.path,
            profiles=self.profiles,
            folds=self.folds,
            notes=self.notes,
        )

    def fitted_set(self) -> ParameterSet:
        """The fitted set, where each number says whether it was fitted or fixed, and its source.

        Of a fitted one the source is campaign, date and 95 % interval; of a fixed one that of the
        set which the fit began from.
        """
        found, nominal = self.result.drive.parameters, self.result.nominal
        assert isinstance(nominal, ParameterSet)
        today, ends = f"{date.today():%d %b %Y}", _interval_words(self.assessments, found)
        parameters = {}
        for symbol, parameter in found.parameters.items():
            if symbol in ends:
                words = "; ".join(ends[symbol])
                source = f"{self.campaign.path.name}, {today}; 95 %: {words}"
                parameter = replace(parameter, status="fitted", source=source)
            elif parameter.status != "inactive":
                before = nominal.parameters.get(symbol, parameter)
                source = f"{nominal.name}: {before.source}" if before.source else nominal.name
                parameter = replace(parameter, status="fixed", source=source)
            parameters[symbol] = parameter
        fitted = len(self.result.stages[0].problem.experiments)
        title = f"{self.campaign.title}: fitted to {fitted} runs, {today}"
        return replace(found, title=title, parameters=parameters)


def _interval_words(assessments: Sequence[Assessment], found: ParameterSet) -> dict[str, list[str]]:
    """Intervals of the fitted parameters in words, by symbol."""
    ends: dict[str, list[str]] = {}
    for each in assessments:
        unknowns = each.stage.problem.unknowns
        for estimate, unknown in zip(each.uncertainty.estimates, unknowns, strict=True):
            if unknown.run is not None:
                continue
            if unknown.name.startswith("force_"):
                for symbol in ("Z19", "Z20", "Z21", "Z22"):
                    ends[symbol] = ["from the fitted forces"]
                continue
            for target in unknown.targets:
                if target in found.numbers:
                    side = target.rpartition("_")[2]
                    side = f"{side} " if side in ("plus", "minus") else ""
                    words = f"{side}{_ends(estimate)}"
                    ends.setdefault(find(target).symbol, []).append(words)
    return ends


def _ends(estimate: Estimate) -> str:
    low, high = estimate.lower, estimate.upper
    if low is None and high is None:
        return estimate.status
    words = (
        "none below" if low is None else f"{low:.5g}",
        "none above" if high is None else f"{high:.5g}",
    )
    return " to ".join(words)


def judge_fit(
    campaign: Campaign,
    axis: str,
    runs: Sequence[Experiment],
    nominal: Parameters,
    plan: Setup,
    result: Fit,
    wanted: Wanted,
    watch: Callable[[str], None] = lambda _: None,
) -> Judged:
    """Assess a fit, predict the runs held out, and compute what else was asked for.

    Parameters
    ----------
    campaign, axis, runs, nominal, plan :
        What was fitted, from where, and how.
    result : Fit
        What was found.
    wanted : Wanted
        Folds, bootstrap, profiles.
    watch : callable
        Is told in words how far the work is.

    Raises
    ------
    InputError
        If a profile of an unknown is wanted that there is not.
    """
    assessments = assess(result.stages)
    _check(wanted.profiles, assessments)
    predicted = predict(result.parameters, campaign.select(axis=axis, role="validate"))
    planned = [each.name for each in result.setup.stages]
    judged = verdict(assessments, predicted, planned=planned, required=wanted.required)
    folds, bootstraps, profiles = None, {}, []
    if wanted.folds:
        folds = cross_validate(
            runs,
            nominal,
            plan,
            folds=wanted.folds,
            loss=wanted.loss,
            watch=lambda _, done: watch(f"{done} of {wanted.folds} folds"),
            executor=wanted.executor,
            seed=wanted.seed,
        )
    if wanted.bootstrap:
        bootstraps = bootstraps_of(
            assessments,
            wanted.bootstrap,
            watch=lambda done: watch(f"{done} of {wanted.bootstrap} fits to new noise"),
            executor=wanted.executor,
            seed=wanted.seed,
        )
    for each in assessments if wanted.profiles else ():
        profiles += _profiles(each, wanted, watch)
    return Judged(
        campaign,
        result,
        runs,
        assessments,
        predicted,
        judged,
        bootstraps,
        profiles,
        folds,
        {**versions(), "seed": str(wanted.seed), "campaign": str(campaign.path)},
    )


def judge_stored(campaign: Campaign, stored: StoredFit) -> Judged:
    """Assess a fit that was stored once more; nothing is fitted."""
    assessments = assess(stored.fit.stages)
    names = {each.name for each in stored.experiments}
    runs = campaign.select(axis=stored.axis, role="validate")
    predicted = predict(stored.fit.parameters, [each for each in runs if each.name not in names])
    planned = [each.name for each in stored.fit.setup.stages]
    return Judged(
        campaign,
        stored.fit,
        stored.experiments,
        assessments,
        predicted,
        verdict(assessments, predicted, planned=planned),
        profiles=stored.profiles,
        folds=stored.folds,
        notes=stored.notes or {},
    )


def versions() -> dict[str, str]:
    """Of this package and of Python."""
    return {"swashplate": __version__, "Python": platform.python_version()}


def _check(names: Sequence[str], assessments: Sequence[Assessment]) -> None:
    known = [name for each in assessments for name in each.stage.problem.unknowns.names]
    for name in names:
        if name != "all" and name not in known:
            machine = [each for each in known if "(" not in each]
            raise InputError(f"There is no unknown '{name}'; there are {', '.join(machine)}.")


def _profiles(
    assessment: Assessment, wanted: Wanted, watch: Callable[[str], None]
) -> list[StageProfile]:
    name, known = assessment.stage.stage.name, assessment.stage.problem.unknowns.names
    names = None if "all" in wanted.profiles else [n for n in wanted.profiles if n in known]
    if names == []:
        return []
    found = profiles_of(
        assessment,
        names,
        executor=wanted.executor,
        watch=lambda done: watch(f"{name}: {done} profiles"),
    )
    return [StageProfile(name, each) for each in found.values()]
