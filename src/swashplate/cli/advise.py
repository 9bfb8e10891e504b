"""``swashplate advise``: which test to make next, and which sensor to add."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.advice_tables import (
    described,
    sensors_table,
    tests_table,
    unknowns_table,
    write_advice,
)
from swashplate.cli.arguments import AxisName
from swashplate.cli.inputs import maneuver_of, parameters_of
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, say, show, working
from swashplate.cli.validate import chosen_axis
from swashplate.errors import InputError
from swashplate.tables import TABLE

if TYPE_CHECKING:
    from swashplate.campaign import ChannelKind
    from swashplate.identification.experiment_design import Bench, Sensor
    from swashplate.parameters.parameter_set import ParameterSet

EXAMPLES = """\
Examples:
  swashplate advise hoist                                      a fresh plan
  swashplate advise harbour/campaign.toml --drive fitted/drive.toml
  swashplate advise harbour/campaign.toml --maneuver step:-9 --top 1
  swashplate advise hoist --free Z9 --noise stroker_pressure=0.2bar
"""


def advise(
    word: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN.toml|AXIS|SET.toml",
            help="Tests made so far; or only a drive, for a fresh plan.",
            show_default=False,
        ),
    ],
    drive: Annotated[
        str | None,
        typer.Option(
            help="The fitted drive: noise is then that of its residuals.",
            metavar="SET.toml",
            show_default=False,
        ),
    ] = None,
    axis: AxisName = None,
    setup: Annotated[
        str | None,
        typer.Option(
            help="What is to be found: hoist, slew, luff, or your own TOML file; by default the "
            "one of the axis's drive.",
            metavar="NAME|FILE",
            show_default=False,
        ),
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            help="A parameter to be found besides, such as Z9. May be repeated.", metavar="SYMBOL"
        ),
    ] = None,
    maneuver: Annotated[
        list[str] | None,
        typer.Option(
            help="A test to judge instead of the usual ones. May be repeated.", metavar="MANEUVER"
        ),
    ] = None,
    sensor: Annotated[
        list[str] | None,
        typer.Option(
            help="A sensor to judge as an addition, such as swash_angle; by default all that the "
            "model knows. May be repeated.",
            metavar="KIND",
        ),
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(
            help="Standard deviation of a sensor, with its unit. May be repeated.",
            metavar="KIND=VALUE",
        ),
    ] = None,
    top: Annotated[int, typer.Option(help="Tests to list.", min=1)] = 10,
    tests: Annotated[int, typer.Option(help="Tests in the plan.", min=0)] = 4,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write all that was computed as .csv or .parquet.",
            metavar="FILE",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Say which test, or which added sensor, would tell most of which parameter.

    Ranks tests by the information that they would add to those made so far, at
    the drive's present values. Errors are standard errors from noise alone; a
    drive that differs from its model is known less well.
    """
    from swashplate.drive import Drive
    from swashplate.identification.experiment_design import (
        ADDED,
        assumed_sensors,
        best_for_each,
        default_maneuvers,
        in_turn,
        judge_sensors,
        measurable,
    )
    from swashplate.identification.experiment_design import advise as judged

    check_outputs((out, TABLE))
    with working("Judging tests"):
        bench = _bench(word, drive, axis, setup, free or [], noise or [])
        machine = Drive(bench.parameters)
        named = [maneuver_of(each, machine) for each in maneuver or []] or default_maneuvers()
        trials = list({each.name: each for each in named}.values())
        had = {each.kind for each in bench.sensors}
        asked = [_kind(each) for each in sensor or []]
        kinds = [each for each in measurable(bench.stage.part, asked or ADDED) if each not in had]
        own = {each.kind: each for each in _noises(noise or [])}
        added = [own.get(each.kind, each) for each in assumed_sensors(machine, kinds)]
        at_hand = [bench.candidate(each, bench.sensors) for each in trials]
        ranked = judged(bench.present, at_hand, bench.variables)
        plan = in_turn(bench.present, at_hand, bench.variables, tests)
        sensors = judge_sensors(bench, trials, added, beside=[each.candidate for each in plan])
        best = best_for_each(ranked)
    if out is not None:
        write_advice(ranked, sensors, out)
    show(tests_table("Tests, with the sensors at hand", ranked[:top]))
    if plan:
        show(tests_table("A plan, each test chosen beside those before it", plan))
        undetermined = [gain.name for gain in plan[-1].gains if not gain.after <= 1.0]
        if undetermined:
            say(f"- After these, {', '.join(undetermined)} would still not be known to 100 %.")
    if sensors:
        known = "what is known" if len(bench.present) else "the plan"
        show(sensors_table(f"Sensors to add, beside {known}, where they tell most", sensors))
    show(unknowns_table(ranked[0].gains, best))
    for each_sensor in (*bench.sensors, *added):
        note(described(each_sensor))
    say(
        "Errors are standard errors in per cent of the value, from noise alone and at these values "
        "of the drive; '-' is not determined (100 % and more). 'better' is by how much what is "
        "known already would be known better, on the mean."
    )
    if out is not None:
        note(f"Table: {out}")


def _bench(
    word: str,
    drive: str | None,
    axis: str | None,
    setup: str | None,
    free: Sequence[str],
    noise: Sequence[str],
) -> Bench:
    from swashplate.campaign import Campaign
    from swashplate.identification.experiment_design import bench
    from swashplate.identification.fitting import smooth
    from swashplate.identification.setup import load_setup
    from swashplate.identification.staging import setup_of

    if not _is_campaign(word):
        if axis is not None:
            raise InputError("--axis belongs to a campaign; a drive is one axis.")
        parameters = parameters_of(drive or word)
        plan = load_setup(setup or parameters.name)
        return bench(smooth(parameters), plan, free=free, sensors=_noises(noise, fresh=parameters))
    campaign = Campaign.from_toml(word)
    chosen = chosen_axis(campaign, axis)
    plan = setup_of(campaign, chosen, setup)
    runs = campaign.select(axis=chosen, role="fit")
    if not runs:
        raise InputError(f"{word}: no run of the axis '{chosen}' has the role 'fit'.")
    parameters = parameters_of(drive) if drive else campaign.drive(chosen).parameters
    kinds = {channel.kind for each in runs for channel in each.channels.values()}
    own = [each for each in _noises(noise) if each.kind in kinds]
    return bench(smooth(parameters), plan, runs, fitted=drive is not None, free=free, sensors=own)


def _is_campaign(word: str) -> bool:
    from swashplate.documents import parse_toml, read_text

    if not word.lower().endswith(".toml"):
        return False
    return "runs" in parse_toml(read_text(word), word)


def _kind(word: str) -> ChannelKind:
    from swashplate.identification.drive_model import SIGNALS

    for kind in SIGNALS:
        if word == kind:
            return kind
    raise InputError(f"There is no sensor '{word}'; there are {', '.join(SIGNALS)}.")


def _noises(words: Sequence[str], fresh: ParameterSet | None = None) -> list[Sensor]:
    """Sensors of stated noise; for a fresh plan the usual ones with what is stated put in."""
    from swashplate.campaign import KINDS
    from swashplate.drive import Drive
    from swashplate.identification.experiment_design import Sensor, default_sensors
    from swashplate.units import to_si

    made: dict[str, Sensor] = {}
    for word in words:
        name, equals, given = (part.strip() for part in word.partition("="))
        match = re.fullmatch(r"([+]?[\d.]+(?:[eE][+-]?\d+)?)\s*(.*)", given)
        if not equals or match is None or not match[1].strip("+.0eE-"):
            raise InputError(
                f"--noise cannot read '{word}'; write it as swash_angle=0.1deg, above 0."
            )
        kind = _kind(name)
        si = KINDS[kind].units[0]
        try:
            value = to_si(float(match[1]), match[2] or si, si, f"--noise {name}")
        except ValueError as error:
            raise InputError(str(error)) from None
        made[kind] = Sensor(kind, value)
    if fresh is None:
        return list(made.values())
    return [made.get(each.kind, each) for each in default_sensors(Drive(fresh))]
