"""Where the C of a model keeps its numbers, and which names are taken."""

from __future__ import annotations

from typing import get_type_hints

from swashplate.export.c_source.exported import Exported
from swashplate.export.c_source.structs import Structs
from swashplate.machine import SignalSource
from swashplate.machine.code_generation import Loops, c_name
from swashplate.machine.fields import floats_of


class Layout:
    """Structs of a model's numbers, and the functions that its equations call.

    Attributes
    ----------
    structs : Structs
        The structs of its named tuples.
    loops : Loops
        Where functions go that the equations call; it knows all names that are taken.
    tags : list of dict
        Tags of the structs of each part, by what they hold; parameters by nothing.
    """

    def __init__(self, exported: Exported) -> None:
        self.exported, self.model = exported, exported.model
        self.P = exported.prefix.upper()
        self.structs, self.loops = (
            Structs(exported.prefix, exported.reserved),
            Loops(exported.reserved),
        )
        self.tags: list[dict[str, str]] = []
        for part in self.model.parts:
            kinds = {"": part.parameters, "options": part.options, "given": part.given}
            kinds |= {"signals": part.signals, "state": part.state}
            if part.limits is not None:
                kinds["limits"] = get_type_hints(part.limits)["return"]
            tags = {word: self.structs.of(kind) for word, kind in kinds.items() if kind}
            self.tags.append(tags)

    def place(self, source: SignalSource, state: str) -> str:
        """Where a signal of a part stands, or a number of its state."""
        part, member = self.model.parts[source.part], self.exported.members[source.part]
        inside = part.signals is not None and source.signal in floats_of(part.signals)
        where = f"m->{member}_signals" if inside else f"m->{state}.{member}"
        return f"{where}.{path_of(source.signal)}"

    def parameter(self, part: int, path: str) -> str:
        """Where a parameter of a part stands."""
        return f"m->{self.exported.members[part]}.{path_of(path)}"

    def value_of(self, signal: str) -> str:
        """Where the newest value of an external signal stands."""
        if signal in self.exported.measured:
            return f"m->inputs.measured[{self.exported.constants['INPUT_'][signal]}].value"
        return f"m->inputs.{self.exported.arguments[signal]}"


def path_of(path: str) -> str:
    """A path of Python's as one of C's."""
    return ".".join(c_name(word) for word in path.split("."))
