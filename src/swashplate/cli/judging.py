"""What follows a fit on the command line: its assessment, and what was asked for besides."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from swashplate.cli.terminal import working
from swashplate.errors import InputError

if TYPE_CHECKING:
    from swashplate.campaign import Campaign, Experiment
    from swashplate.executors import Executor
    from swashplate.identification.assessment import Assessment, RunQuality
    from swashplate.identification.bootstrap import Bootstrap
    from swashplate.identification.cross_validation import CrossValidation
    from swashplate.identification.fitting import Fit
    from swashplate.identification.setup import Setup
    from swashplate.identification.solving import Loss
    from swashplate.identification.staging import Parameters
    from swashplate.identification.storing import StageProfile
    from swashplate.identification.verdict import Verdict
    from swashplate.parameters.parameter_set import ParameterSet


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
class Judged:
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
    seed: int = 0

    def name_of(self, profile: StageProfile) -> str:
        """The unknown that a profile is of."""
        stage = next(each for each in self.result.stages if each.stage.name == profile.stage)
        return stage.problem.unknowns.names[profile.profile.index]

    @property
    def notes(self) -> dict[str, str]:
        """What belongs to the report: versions, seed, campaign."""
        import platform

        from swashplate.__about__ import __version__

        return {
            "swashplate": __version__,
            "Python": platform.python_version(),
            "seed": str(self.seed),
            "campaign": str(self.campaign.path),
        }

    def stored(self, out: Path) -> str:
        """Write fit.json, from which the report can be made again; a line that says so."""
        from swashplate.identification.storing import save_fit

        save_fit(
            self.result,
            self.runs,
            out / "fit.json",
            campaign=self.campaign.path,
            profiles=self.profiles,
            folds=self.folds,
            notes=self.notes,
        )
        return f"Fit:       {out / 'fit.json'}"

    def reported(self, out: Path, truth: ParameterSet | None = None) -> str:
        """Write report.html; a line that says so."""
        from swashplate.report.fit_page import write_fit_report

        with working("Writing the report"):
            write_fit_report(
                self.result,
                self.campaign,
                out / "report.html",
                assessments=self.assessments,
                validation=self.predicted,
                profiles=self.profiles,
                folds=self.folds,
                truth=truth,
                judged=self.verdict,
                notes=self.notes,
            )
        return f"Report:    {out / 'report.html'}"

    def drawn(self, out: Path, kind: Literal["svg", "pdf"]) -> str:
        """Draw the figures for print; a line that says so."""
        from swashplate.report.fit_page import save_fit_figures

        with working("Drawing"):
            paths = save_fit_figures(
                self.result,
                self.campaign,
                out / "figures",
                kind,
                assessments=self.assessments,
                validation=self.predicted,
            )
        return f"Figures:   {len(paths)} in {out / 'figures'}"


def judged_fit(
    campaign: Campaign,
    axis: str,
    runs: Sequence[Experiment],
    nominal: Parameters,
    plan: Setup,
    result: Fit,
    wanted: Wanted,
) -> Judged:
    """Assess a fit, predict the runs held back, and compute what else was asked for."""
    from swashplate.identification.assessment import assess
    from swashplate.identification.bootstrap import bootstraps_of
    from swashplate.identification.cross_validation import cross_validate
    from swashplate.identification.validation import predict
    from swashplate.identification.verdict import verdict

    with working("Judging") as status:
        assessments = assess(result.stages)
        _check(wanted.profiles, assessments)
        predicted = predict(result.parameters, campaign.select(axis=axis, role="validate"))
        planned = [each.name for each in result.setup.stages]
        judged = verdict(assessments, predicted, planned=planned, required=wanted.required)
        folds = None
        if wanted.folds:
            folds = cross_validate(
                runs,
                nominal,
                plan,
                folds=wanted.folds,
                seed=wanted.seed,
                executor=wanted.executor,
                loss=wanted.loss,
                watch=lambda _, done: status.update(f"{done} of {wanted.folds} folds"),
            )
        bootstraps: dict[str, Bootstrap] = {}
        if wanted.bootstrap:
            bootstraps = bootstraps_of(
                assessments,
                wanted.bootstrap,
                seed=wanted.seed,
                executor=wanted.executor,
                watch=lambda done: status.update(f"{done} of {wanted.bootstrap} fits to new noise"),
            )
        profiles = []
        for each in assessments if wanted.profiles else ():
            profiles += _profiles(each, wanted, status.update)
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
        wanted.seed,
    )


def _check(names: Sequence[str], assessments: Sequence[Assessment]) -> None:
    known = [name for each in assessments for name in each.stage.problem.unknowns.names]
    for name in names:
        if name != "all" and name not in known:
            machine = [each for each in known if "(" not in each]
            raise InputError(f"There is no unknown '{name}'; there are {', '.join(machine)}.")


def _profiles(
    assessment: Assessment, wanted: Wanted, show: Callable[[str], None]
) -> list[StageProfile]:
    from swashplate.identification.profile import profiles_of
    from swashplate.identification.storing import StageProfile

    name = assessment.stage.stage.name
    names = None
    if "all" not in wanted.profiles:
        names = [
            each for each in wanted.profiles if each in assessment.stage.problem.unknowns.names
        ]
        if not names:
            return []
    found = profiles_of(
        assessment,
        names,
        executor=wanted.executor,
        watch=lambda done: show(f"{name}: {done} profiles"),
    )
    return [StageProfile(name, each) for each in found.values()]
