"""Where the C of a model keeps its numbers, and which names are taken."""

from __future__ import annotations

from typing import get_type_hints

from swashplate.equations import SignalSource, floats_of, plain
from swashplate.equations.code_generation import Loops, c_name
from swashplate.export.c_source.exported import Exported
from swashplate.export.c_source.structs import Structs

OWN = """
get_number set_number is_finite all_finite in_range index_of_name place_tap read_window
constant_window fill_lines inputs_in_range put_inputs take_sample one_sample READY VALUES
CONSTANTS_FROM rested_start settled_start check_parameters compute_constants switch_terms ranges
value_table option_places parameter_names output_names input_names option_names name_at_index
is_index get_flag set_flag input_ranges flag_places finite_outputs
"""
PUBLIC = """
size value_count init reset settle step correct output limits set_input clear_input set get
set_option get_option set_step get_step update find find_output find_input find_option
parameter_name output_name sentence valid memory inputs measured value range
"""
"""Names that the interface takes: as they are, and after the prefix."""


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
        public = [f"{exported.prefix}_{word}" for word in PUBLIC.split()]
        used_names = {*OWN.split(), *public}
        used_names |= {exported.type, f"{exported.prefix}_window", f"{exported.prefix}_memory"}
        self.structs, self.loops = Structs(exported.prefix, used_names), Loops(used_names)
        self.tags: list[dict[str, str]] = []
        for part in self.model.parts:
            kinds = {"": part.parameters, "options": part.options, "given": part.given}
            kinds |= {"signals": part.signals, "state": part.state}
            if part.limits is not None:
                kinds["limits"] = get_type_hints(plain(part.limits))["return"]
            tags = {word: self.structs.of(kind) for word, kind in kinds.items() if kind}
            self.tags.append(tags)

    def place(self, source: SignalSource, state: str) -> str:
        """Where a signal of a part stands, or a number of its state."""
        part, member = self.model.parts[source.part], self.exported.members[source.part]
        inside = part.signals is not None and source.signal in floats_of(part.signals)
        where = f"m->{member}_signals" if inside else f"m->{state}.{member}"
        return f"{where}.{path_of(source.signal)}"

    def value_of(self, signal: str) -> str:
        """Where the newest value of an external signal stands."""
        member = c_name(signal)
        if signal in self.exported.measured:
            return f"m->inputs.measured[{self.P}_INPUT_{member}].value"
        return f"m->inputs.{member}"


def path_of(path: str) -> str:
    """A path of Python's as one of C's."""
    return ".".join(c_name(word) for word in path.split("."))
