"""Kruse's figures and tables as a page and a PDF.

python -m reproduction --out FOLDER [--seed 1]
"""

import argparse
import sys
from pathlib import Path

from reproduction import build
from reproduction.page import write_page
from reproduction.printed import write_pdf
from swashplate import SwashplateError

PAGE, PRINT = "reproduction.html", "reproduction.pdf"


def main(words: list[str] | None = None) -> int:
    """Reproduce, write both files, and say where they are; 2 if they cannot be written."""
    parser = argparse.ArgumentParser(prog="python -m reproduction", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("reproduction", "made"))
    parser.add_argument("--seed", type=int, default=1, help="of the virtual tests and the fits")
    given = parser.parse_args(words)
    if given.seed < 0:
        parser.error(f"--seed is {given.seed}, but must be 0 or more")
    try:
        given.out.mkdir(parents=True, exist_ok=True)
        made = build.reproduce(seed=given.seed, begin=lambda name: print(name, flush=True))
        write_page(made, given.out / PAGE)
        write_pdf(made, given.out / PRINT)
    except (SwashplateError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2
    print(f"{len(made.figures)} figures and {len(made.tables)} tables, every curve simulated:")
    print(f"{given.out / PAGE}\n{given.out / PRINT}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
