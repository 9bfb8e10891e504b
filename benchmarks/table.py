"""The table of results: in the terminal and in the documentation."""

import os
import platform
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

PAGE = Path(__file__).parent.parent / "docs" / "benchmarks.md"
BEGIN, END = "<!-- table: begin -->", "<!-- table: end -->"
RECORD = "Hoist, sine of 6.5 V and 0.1 Hz, 30 s at 512 Hz, unless said otherwise"
WIDTH = 120
HEADINGS = ("what", "median", "ratio", "target", "met")


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    what: str
    median: str
    ratio: str = ""
    target: str = ""
    met: bool | None = None
    """None where there is no target."""

    @property
    def cells(self) -> tuple[str, str, str, str, str]:
        """Text of each column."""
        met = "" if self.met is None else ("yes" if self.met else "no")
        return self.what, self.median, self.ratio, self.target, met


def duration(seconds: float) -> str:
    """A time with three digits and its unit."""
    if seconds < 1.0:
        return f"{_three(1e3 * seconds)} ms"
    return f"{_three(seconds)} s"


def size(in_bytes: float) -> str:
    """An amount of memory with its unit."""
    mega = in_bytes / 1e6
    return f"{mega:.0f} MB" if mega >= 10.0 else f"{mega:.1f} MB"


def times(ratio: float) -> str:
    """A ratio, as a fraction where it is far below 1."""
    if ratio < 0.2:
        return f"1/{1.0 / ratio:.0f}"
    return f"{ratio:.2f}×" if ratio < 1.0 else f"{ratio:.1f}×"


def _three(number: float) -> str:
    decimals = 0 if number >= 100.0 else (1 if number >= 10.0 else (2 if number >= 1.0 else 3))
    return f"{number:,.{decimals}f}"


def machine() -> str:
    """Kind of machine: processor and number of cores, no names."""
    cores = len(os.sched_getaffinity(0))
    return f"{_processor()}, {cores} core{'s' if cores > 1 else ''}"


def _processor() -> str:
    wanted = ("model name", "cpu family", "model")
    found = {}
    for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
        key, _, value = line.partition(":")
        if key.strip() in wanted:
            found.setdefault(key.strip(), value.strip())
    if "model name" not in found:
        return platform.machine()
    family = f" (family {found['cpu family']}, model {found['model']})" if "model" in found else ""
    return found["model name"] + family


def show(rows: Iterable[Row]) -> None:
    """Print the table."""
    table = Table(title=f"{RECORD}\n{machine()}", title_justify="left")
    for heading in HEADINGS:
        table.add_column(heading, justify="right" if heading in ("median", "ratio") else "left")
    for row in rows:
        colour = {None: "", True: "green", False: "red"}[row.met]
        *cells, met = row.cells
        table.add_row(*cells, f"[{colour}]{met}" if colour else met)
    console = Console()
    if not console.is_terminal:  # a file or a pipe has no width of its own
        console = Console(width=WIDTH)
    console.print(table)


def write(rows: Iterable[Row]) -> None:
    """Put the table between the page's markers."""
    page = PAGE.read_text("utf-8")
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    lines = [f"Measured on: {machine()}.", ""]
    lines.append(f"| {' | '.join(HEADINGS)} |")
    lines.append("|---|--:|--:|---|---|")
    lines.extend(f"| {' | '.join(row.cells)} |" for row in rows)
    PAGE.write_text(before + BEGIN + "\n" + "\n".join(lines) + "\n" + END + after, "utf-8")
