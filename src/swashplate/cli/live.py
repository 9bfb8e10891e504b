"""``swashplate live``: a page in which a drive runs, beside its tests or under a maneuver."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from swashplate.cli.options import AxisName, DriveChoice, argument, option
from swashplate.cli.terminal import check_free, note, working
from swashplate.cli.words import campaign_of, drive_file, maneuver_of
from swashplate.errors import InputError
from swashplate.tables import PAGE, check_place, ending


def live(
    drive: DriveChoice,
    path: Annotated[
        Path | None,
        argument("CAMPAIGN.toml", "Tests that are shown beside what the drive makes of them."),
    ] = None,
    axis: AxisName = None,
    maneuver: Annotated[
        str | None, option("A maneuver instead of tests, such as step:9.", metavar="NAME")
    ] = None,
    out: Annotated[Path, option("The page, .html.", metavar="FILE")] = Path("live.html"),
) -> None:
    """Write a page in which the drive runs, with sliders for its parameters.

    One file that works offline: open it in a browser, move a slider, and the
    simulated curves, their errors and the limits follow. Changed values stand
    below as lines to put into the drive's file.

    For example:
      swashplate live fitted harbour/campaign.toml
      swashplate live hoist --maneuver step:9 --out hoist.html
      swashplate live fitted harbour/campaign.toml --scale orifice=1.5
    """
    if (path is None) == (maneuver is None):
        raise InputError("Name a campaign, or a maneuver with --maneuver; one of them.")
    ending(out, PAGE)
    check_place(out)
    check_free(out)
    with working("Writing the page"):
        from swashplate.report.fit_report import write_live_page

        place = drive_file(drive.drive)
        name = str(place) if place is not None else "your copy of it, --toml of 'swashplate show'"
        if path is not None:
            campaign, chosen = campaign_of(path, axis)
            said = write_live_page(drive.chosen, out, campaign=campaign, axis=chosen, name=name)
        else:
            command = maneuver_of(maneuver or "", drive.chosen)
            said = write_live_page(drive.chosen, out, command=command, name=name)
    for sentence in (*drive.changes, *said):
        note(sentence)
    note(f"Page: {out} ({out.stat().st_size / 1e3:.0f} kB)")
