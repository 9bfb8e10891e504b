"""Figures to files."""

from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from swashplate.tables import FIGURE, ending, write_whole

_METADATA: dict[str, dict[str, None]] = {
    "png": {},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
"""What to leave out, because it would differ between two runs on the same figure."""


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG, SVG or PDF, by the path's ending.

    The file appears whole or not at all: it is written beside and renamed. The same figure gives
    the same bytes.

    Raises
    ------
    FileError
        For another ending, or a folder that cannot be written.
    """
    kind = ending(path, FIGURE).removeprefix(".")

    def write(beside: Path) -> None:
        # without a salt of its own, an SVG's clip paths get random names
        with matplotlib.rc_context({"svg.hashsalt": "swashplate"}):
            figure.savefig(beside, format=kind, metadata=_METADATA[kind])

    write_whole(path, write)
