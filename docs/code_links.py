"""A Sphinx extension: code in prose that names an object of the reference leads to its entry.

`Drive.simulate` in a page is found as ``swashplate.Drive.simulate``, whatever module has it, if
only one object ends so. A name without a dot must be that of a class: `fit` may be the command.
"""

import re
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util.nodes import make_refnode


class CodeLinks(SphinxPostTransform):
    """Links around literals, except in headings, links and terms."""

    default_priority = 5
    formats = ("html",)

    def run(self, **_: Any) -> None:
        """Put a link around each literal that names one object."""
        endings = objects_by_ending(tuple(self.env.domains.python_domain.objects.items()))
        for literal in list(self.document.findall(nodes.literal)):
            entry = endings.get(re.sub(r"\(.*\)$", "", literal.astext()))
            if entry is None or within(literal, nodes.title, nodes.reference, nodes.term):
                continue
            name, found = entry
            page = self.env.docname
            link = make_refnode(
                self.app.builder, page, found.docname, found.node_id, literal.deepcopy(), name
            )
            literal.replace_self(link)


@lru_cache(maxsize=1)  # all pages ask for the same
def objects_by_ending(objects: Iterable[tuple[str, Any]]) -> dict[str, tuple[str, Any]]:
    """Objects by each ending of their dotted names that only one of them has."""
    endings: dict[str, dict[str, Any]] = {}
    for name, entry in objects:
        parts = name.split(".")
        for start in range(len(parts)):
            ending = ".".join(parts[start:])
            if "." in ending or ending[0].isupper():
                endings.setdefault(ending, {})[name] = entry
    return {
        ending: next(iter(entries.items()))
        for ending, entries in endings.items()
        if len(entries) == 1
    }


def within(node: nodes.Node, *kinds: type[nodes.Node]) -> bool:
    """Whether a node of these kinds is above."""
    while node.parent is not None:
        node = node.parent
        if isinstance(node, kinds):
            return True
    return False


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_post_transform(CodeLinks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
