"""``swashplate tour``: the source's three drives over all its tests."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swashplate.cli.terminal import note, progress, show, table
from swashplate.errors import FileError

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.simulation.result import Simulation

EXAMPLES = """\
Examples:
  swashplate tour
  swashplate tour --out results/tour
"""


def tour(
    out: Annotated[
        Path, typer.Option(help="Folder for tables and figures, made if missing.", metavar="FOLDER")
    ] = Path("tour"),
) -> None:
    """Simulate the three packaged axes over all tests of the source.

    Writes one table a run, such as hoist/step +9 V.csv, and two figures: all
    runs at a glance, and the settled speeds over the voltage. Takes some seconds.
    """
    from swashplate.drive import Drive
    from swashplate.maneuvers import source_tests
    from swashplate.parameters.files import AXES

    drives = {axis: Drive.preset(axis) for axis in AXES}
    tests = {axis: source_tests(axis) for axis in AXES}
    runs: dict[str, dict[str, Simulation]] = {axis: {} for axis in AXES}
    with progress(sum(map(len, tests.values())) + 2) as begin:
        for axis in AXES:
            folder = _made(out / axis)
            for name, maneuver in tests[axis].items():
                begin(f"{axis}, {name}")
                run = drives[axis].simulate(maneuver.sample())
                run.write(folder / f"{name.replace('/', ' per ')}.csv")
                runs[axis][name] = run
        from swashplate.report.figures import plot_maneuvers_overview, plot_steady_map, save_figure

        begin("drawing all runs")
        save_figure(plot_maneuvers_overview(runs), out / "overview.png")
        begin("drawing the settled speeds")
        save_figure(plot_steady_map(drives), out / "steady.png")
    show(_overview(runs))
    note(f"All signals of each run, in SI: {out}/AXIS/MANOEUVRE.csv")
    note(f"All runs at a glance: {out / 'overview.png'}")
    note(f"Settled speed over voltage: {out / 'steady.png'}")


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder} cannot be made: {error.strerror}.") from None
    return folder


def _overview(runs: dict[str, dict[str, Simulation]]) -> Table:
    from swashplate.cli.measures import limit_shares, peak_speeds_deg_s

    made = table(
        "Peak speeds in deg/s",
        "axis", "manoeuvre", ">samples", ">plus", ">minus", "limits met",
        wrap="limits met",
    )  # fmt: skip
    for axis, by_name in runs.items():
        for name, run in by_name.items():
            speed = peak_speeds_deg_s(run)
            limits = ", ".join(limit for limit, share in limit_shares(run).items() if share)
            numbers = (f"{speed.positive:z.2f}", f"{speed.negative:z.2f}")
            made.add_row(axis, name, str(run.time.size), *numbers, limits)
        made.add_section()
    return made
