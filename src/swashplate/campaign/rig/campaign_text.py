"""campaign.toml and truth.toml of simulated tests, as text."""

from __future__ import annotations

from dataclasses import asdict
from importlib.metadata import version
from json import dumps
from platform import python_version
from re import fullmatch

from swashplate.__about__ import __version__
from swashplate.campaign.kinds import KINDS
from swashplate.campaign.rig.bench import VirtualTests
from swashplate.campaign.rig.logger import COLUMNS

DRIVE_FILE = "drive.toml"
"""Parameters of the drive that was simulated, beside truth.toml; or, beside campaign.toml, those of
the one that a fit starts from."""


def campaign_text(tests: VirtualTests, ending: str) -> str:
    """The campaign file of tests whose logs have an ending, such as "csv".

    The input is joined by straight lines, because that is what was simulated between two samples.
    """
    effects = ", ".join(tests.effects.active) or "none"
    drive = tests.preset or DRIVE_FILE
    lines = [
        f"# Virtual tests, simulated by swashplate {__version__}: nothing here was measured.",
        f"# Instruments: {tests.severity}; effects beyond the model: {effects}; seed {tests.seed}.",
        "# What was simulated stands in truth/truth.toml: look only after the fit.",
        f"title = {dumps(f'Virtual tests, {tests.axis}', ensure_ascii=False)}",
        "virtual = true",
        "",
        f"[axes.{_key(tests.axis)}]",
        f'drive = "{drive}"    # the model that a fit starts from',
        f'time = {{ column = {_column(tests, ending, "time")}, unit = "s" }}',
        'start = "rest"',
        "",
        f"[axes.{_key(tests.axis)}.input]",
        'kind = "voltage"',
        f"column = {_column(tests, ending, 'voltage')}",
        'unit = "V"',
        'interpolation = "linear"',
        *_missing(tests),
    ]
    for kind in tests.channels:
        column = COLUMNS.get(kind, kind)
        lines += ["", f"[axes.{_key(tests.axis)}.channels.{column}]", f'kind = "{kind}"']
        lines.append(f"column = {_column(tests, ending, column)}")
        if kind == "encoder_counts":
            lines.append(f"counts_per_turn = {tests.counts_per_turn!r}    # of the shaft")
            if tests.instruments.counter_bits:
                lines.append(f"rolls_over_at = {2**tests.instruments.counter_bits}")
        else:
            lines.append(f'unit = "{KINDS[kind].units[0]}"')
        lines += _missing(tests)
    for run in tests.runs.values():
        lines += ["", "[[runs]]", f'file = "{run.stem}.{ending}"', f'role = "{run.role}"']
    return "\n".join(lines) + "\n"


def _key(axis: str) -> str:
    """A name as a key of TOML, whose strings are escaped as those of JSON."""
    return axis if fullmatch(r"[A-Za-z0-9_-]+", axis) else dumps(axis, ensure_ascii=False)


def _missing(tests: VirtualTests) -> list[str]:
    if not tests.instruments.empty_cells:
        return []
    return ['missing = "drop"    # cells without a number']


def _column(tests: VirtualTests, ending: str, name: str) -> str:
    """What a column is called in the log; the rows of a matrix have only numbers, from 1 on."""
    if ending != "mat":
        return f'"{name}"'
    names = ["time", "voltage", *(COLUMNS.get(kind, kind) for kind in tests.channels)]
    return f'"data({names.index(name) + 1},:)"'


def truth_text(tests: VirtualTests) -> str:
    """What was simulated: effects, instruments, seed and versions; the drive has its own file."""
    from tomlkit import comment, document, table

    text = document()
    text.add(comment("The truth behind the virtual tests beside this folder."))
    text.add("virtual", True)
    text.add("axis", tests.axis)
    text.add("drive", DRIVE_FILE)
    text.add("severity", tests.severity)
    text.add("seed", tests.seed)
    text.add("counts_per_turn", tests.counts_per_turn)
    text.add("runs", list(tests.runs))
    for name, values in (
        ("effects", asdict(tests.effects)),
        ("instruments", asdict(tests.instruments)),
        (
            "versions",
            {
                "swashplate": __version__,
                "numpy": version("numpy"),
                "numba": version("numba"),
                "python": python_version(),
            },
        ),
    ):
        entries = table()
        for key, value in values.items():
            entries.add(key, value)
        text.add(name, entries)
    return text.as_string()
