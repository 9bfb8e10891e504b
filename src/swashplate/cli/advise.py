"""``swashplate excitation`` and ``advise``: what the runs tell, and which test to make next."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from swashplate.cli.options import (
    AxisName,
    TableFile,
)
from swashplate.cli.terminal import Outputs, note, say, show, working
from swashplate.cli.words import (
    campaign_of,
    configuration_of,
    file_kind,
    maneuver_of,
    parameters_of,
    runs_to_fit,
)
from swashplate.errors import InputError
from swashplate.tables import TABLE, joined

if TYPE_CHECKING:
    from swashplate.identification.experiment_design import Bench, Sensor

LEGEND = (
    "Under 'runs', one letter a run: # gives 20 % or more of the information, + gives less, . "
    "gives none, - is not fitted here. 'effect' is how much 1 % of the value changes all residuals "
    "together; 1 is one standard deviation of noise."
)


def excitation(
    path: Path = Path("campaign.toml"),
    *,
    axis: AxisName = None,
    setup: str | None = None,
    begin: str | None = None,
    out: TableFile = None,
) -> None:
    """Show before a fit which parameters the runs determine, and what to fix.

    Simulates the runs with the drive as it is: how much each parameter changes
    what was measured, by which run, and which can change together without
    effect: those are to be fixed, or tested further.

    For example:
      swashplate excitation virtual/campaign.toml
      swashplate excitation harbour/campaign.toml --setup mine.toml --from worn.toml
      swashplate excitation harbour/campaign.toml --out runs.csv
    """
    from swashplate.identification.data_checks import check_runs, refuse_unsound
    from swashplate.identification.drive_model import setup_of
    from swashplate.identification.experiment_design import outlook
    from swashplate.identification.fitting import smooth

    files = Outputs((out, TABLE))
    with working(f"Reading {path}"):
        campaign, chosen = campaign_of(path, axis)
        plan = setup_of(campaign, chosen, setup)
        drive = parameters_of(begin) if begin is not None else campaign.drive(chosen).parameters
        runs = runs_to_fit(campaign, chosen)
    with working("Simulating"):
        doubts = refuse_unsound(check_runs(runs, smooth(drive)))
        looks = [outlook(stage, smooth(drive), runs) for stage in plan.stages]
    names = [each.name for each in runs]
    shown = [look.table(names) for look in looks]
    files.write(out, "Table", joined(shown).write)
    for sentence in doubts:
        say(f"! {sentence}")
    for look, table in zip(looks, shown, strict=True):
        show(table)
        # what no run exercises is said with its reason
        verdict = replace(look.identifiability, unexcited=())
        for sentence in (*verdict.sentences(), *look.sentences()):
            say(f"- {sentence}")
    note("")
    for number, name in enumerate(names, start=1):
        note(f"run {number}: {name}")
    say(LEGEND)
    if all(look.identifiability.complete for look in looks):
        note("The fit configuration can stay as it is.")
    files.say()


def advise(
    word: str,
    *,
    drive: str | None = None,
    axis: AxisName = None,
    setup: str | None = None,
    maneuver: list[str] | None = None,
    top: int = 10,
    tests: int = 4,
    out: TableFile = None,
) -> None:
    """Recommend the test that determines each parameter best.

    Ranks tests by the information that they would add to those made so far, at
    the drive's present values. Errors are standard errors from noise alone; a
    drive that differs from its model is known less well.

    Options:
      word CAMPAIGN.toml|AXIS|SET.toml: Tests made so far; or only a drive, for a fresh plan.
      drive SET.toml: The fitted drive: noise is then that of its residuals.
      maneuver MANEUVER: A test to judge instead of the usual ones. May be repeated.
      top: Tests to list.
      tests: Tests in the plan.

    For example:
      swashplate advise hoist                                      a fresh plan
      swashplate advise harbour/campaign.toml --drive fitted/drive.toml
      swashplate advise harbour/campaign.toml --maneuver step:-9 --top 1
    """
    from swashplate.drive import Drive
    from swashplate.identification.experiment_design import (
        advice_table,
        best_tests_table,
        default_maneuvers,
        in_turn,
    )
    from swashplate.identification.experiment_design import advise as judged

    files = Outputs((out, TABLE))
    with working("Judging tests"):
        bench = _bench(word, drive, axis, setup)
        machine = Drive(bench.parameters)
        named = [maneuver_of(each, machine) for each in maneuver or []] or default_maneuvers()
        trials = list({each.name: each for each in named}.values())
        at_hand = [bench.candidate(each) for each in trials]
        ranked = judged(bench.present, at_hand, bench.variables)
        plan = in_turn(bench.present, at_hand, bench.variables, tests)
    files.write(out, "Table", advice_table("", ranked).write)
    show(advice_table("Tests", ranked[:top]))
    if plan:
        show(advice_table("A plan, each test chosen in addition to those before it", plan))
        errors = zip(plan[-1].names, plan[-1].after, strict=True)
        undetermined = [name for name, error in errors if not error <= 1.0]
        if undetermined:
            say(f"- After these, {', '.join(undetermined)} would still not be known to 100 %.")
    show(best_tests_table(ranked))
    for sensor in bench.sensors:
        note(_described(sensor))
    say(
        "Errors are standard errors in per cent of the value, from noise alone and at these values "
        "of the drive; '-' is not determined (100 % and more). 'better' is by how much what is "
        "known already would be known better, on the mean."
    )
    files.say()


def _described(sensor: Sensor) -> str:
    """A sensor in a line: its noise, and where that is known from."""
    from swashplate.campaign import KINDS

    unit = KINDS[sensor.kind].units[0]
    return (
        f"{sensor.kind}: noise {sensor.noise:.3g} {unit} ({sensor.origin}), one independent sample "
        f"every {sensor.memory:.3g} s"
    )


def _bench(
    word: str,
    drive: str | None,
    axis: str | None,
    setup: str | None,
) -> Bench:
    from swashplate.identification.drive_model import setup_of
    from swashplate.identification.experiment_design import bench
    from swashplate.identification.fitting import smooth
    from swashplate.identification.setup import load_setup

    if file_kind(Path(word)) != "campaign":
        if axis is not None:
            raise InputError("--axis belongs to a campaign; a drive is one axis.")
        parameters = parameters_of(drive or word)
        plan = load_setup(configuration_of(word, setup, parameters.name))
        return bench(smooth(parameters), plan)
    campaign, chosen = campaign_of(Path(word), axis)
    plan = setup_of(campaign, chosen, setup)
    runs = runs_to_fit(campaign, chosen)
    parameters = parameters_of(drive) if drive else campaign.drive(chosen).parameters
    return bench(smooth(parameters), plan, runs, fitted=drive is not None)
