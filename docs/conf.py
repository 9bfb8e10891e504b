"""How the documentation is built: `make docs`; `generate.py` makes the pages of the reference."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import generate

from swashplate import __version__

project = "swashplate"
author = "the swashplate developers"
copyright = author
version = release = __version__

extensions = [
    "code_links",
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",  # the script as a file: equations need no network
]
exclude_patterns = ["_build"]

# $ and $$ for equations; headings can be linked as page.md#heading
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
smartquotes_action = "qe"  # quotes and dots, but no dashes: --out is an option

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings give shapes and units, which say more
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_theme = "furo"
html_title = f"swashplate {version}"
html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["wide.css"]

generate.pages(Path(__file__).parent / "generated")
