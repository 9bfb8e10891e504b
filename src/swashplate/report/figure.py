"""The figure that all functions of this package return, and how it is shown."""

from __future__ import annotations

import os
import sys
import webbrowser
from importlib import import_module
from io import BytesIO
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from matplotlib.figure import Figure
from matplotlib.text import Text

from swashplate.progress import in_notebook

CSS_DPI = 96.0
"""Dots an inch of a browser's page."""
RETINA = 2.0
"""Dots of a picture for each of those: sharp on screens of twice the density. A run's figure then
takes 90 to 330 kB; as SVG 60 to 130 kB, but as much more as its signals are longer."""


class PlainFigure(Figure):
    """A figure made without pyplot, which shows itself all the same.

    A notebook shows it if it is the last value of a cell. `show` shows it anywhere. Its texts
    are drawn as they are: names come from files, and a dollar in one does not begin a formula.
    """

    def draw(self, renderer: Any) -> None:
        """Draw it, with all texts as plain text."""
        for text in self.findobj(Text):
            assert isinstance(text, Text)
            text.set_parse_math(False)
            if not (content := text.get_text()).isprintable():
                text.set_text(
                    "".join(c if c.isprintable() or c == "\n" else "\ufffd" for c in content)
                )
        super().draw(renderer)

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        """Picture for a notebook, and the size at which a page shows it. [px]"""
        picture = BytesIO()
        self.savefig(picture, format="png", dpi=RETINA * CSS_DPI)
        width, height = (round(CSS_DPI * inches) for inches in self.get_size_inches())
        return picture.getvalue(), {"width": width, "height": height}

    def show(self, warn: bool = True) -> None:
        """Show it: in the notebook, in a window, or else as a picture file.

        A window needs a backend of Matplotlib that opens windows; it waits as ``pyplot.show`` does.
        Without one the figure is written to a temporary PNG file, whose path is printed, and which
        is opened if there is a screen.

        Parameters
        ----------
        warn : bool
            Not used; `matplotlib.figure.Figure.show` has it.
        """
        if in_notebook():
            import_module("IPython.display").display(self)
            return
        if _has_windows():
            self._show_window()
        else:
            self._show_file()

    def _show_window(self) -> None:
        from matplotlib import pyplot

        manager = self.canvas.manager
        if manager is None or manager.num not in pyplot.get_fignums():

            def existing(**_: object) -> PlainFigure:
                return self

            # before 3.11 pyplot adopts no figure by itself, but takes what makes one
            pyplot.figure(FigureClass=existing)  # type: ignore[arg-type]
        pyplot.show()

    def _show_file(self) -> None:
        path = Path(mkdtemp(prefix="swashplate-")) / "figure.png"
        self.savefig(path)
        print(f"Figure: {path}")
        if _has_screen():
            webbrowser.open(path.as_uri())


def _has_windows() -> bool:
    """Whether pyplot's backend opens windows."""
    from matplotlib import pyplot
    from matplotlib.backends.registry import backend_registry

    registry: Any = backend_registry
    canvas = registry.load_backend_module(pyplot.get_backend()).FigureCanvas
    return bool(canvas.required_interactive_framework)


def _has_screen() -> bool:
    """Whether a viewer can be opened; a browser in the terminal would take the prompt away."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
