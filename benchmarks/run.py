"""How fast the package is, against C and against its targets (Linux, needs a C compiler).

python benchmarks/run.py [--write]
"""

import argparse
from collections.abc import Iterator

import exports
import fits
import processes
import rows
import studies
import table
from rich.console import Console

import crane


def measured() -> Iterator[table.Row]:
    """All rows, each as it is found."""
    marches = rows.Marches()
    yield rows.check(marches)
    yield from rows.march_rows(marches)
    yield from rows.sensitivity_rows(marches)
    yield from fits.fit_rows()
    yield from rows.batch_rows(marches)
    yield from studies.fit_study_rows()
    yield from studies.full_order_rows()
    yield from exports.export_rows()
    yield from processes.memory_rows()
    yield from processes.hour_rows()
    yield from processes.command_rows()
    yield from processes.first_use_rows()
    yield from crane.crane_rows()


def main() -> None:
    """Measure, print, and on request put the table into docs/benchmarks.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help=f"update {table.PAGE.name}")
    arguments = parser.parse_args()
    found = []
    with Console(stderr=True).status("Measuring ...") as status:
        for row in measured():
            found.append(row)
            status.update(f"Measured {row.what} ...")
    table.show(found)
    if arguments.write:
        table.write(found)


if __name__ == "__main__":
    main()
