"""The C interface of an exported model: header and source around its equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isfinite

from swashplate.export.c_source.exported import BEYOND, Exported
from swashplate.export.c_source.layout import path_of
from swashplate.export.c_source.model import writer_of
from swashplate.export.c_source.structs import noted, with_comment
from swashplate.machine import Definition
from swashplate.machine.code_generation import (
    HELPERS,
    c_function,
    c_literal,
    c_name,
    comment_line,
    filled,
    helpers_in,
    indented,
    sections,
    wrapped,
)

TEXTS = sections(__package__, "interface.c.in")
LONGEST_STRING = 4000
"""Characters of a string that every C99 compiler takes, with some to spare: it must take 4095."""
"""Sections of the text around the equations, by name."""


def interface(exported: Exported) -> dict[str, str]:
    """Header and source of a model, by file name."""
    filled_interface = _Interface(exported)
    return {
        f"{exported.file}.h": filled_interface.header(),
        f"{exported.file}.c": filled_interface.source(),
    }


class _Interface:
    """Fills the texts above."""

    def __init__(self, exported: Exported) -> None:
        self.exported, self.model, self.writer = exported, exported.model, writer_of(exported)
        self.P = self.writer.P
        self.arguments = [*exported.arguments.values()]
        self.rows, self.numbers = list(self.writer.ranges()), self.writer.values()

    def filled(self, text: str, **further: str) -> str:
        exported, signals = self.exported, "".join(f", double {name}" for name in self.arguments)
        placeholders = {
            "type": exported.type,
            "p": exported.prefix,
            "P": self.P,
            "samples": exported.widest,
            "title": comment_line(
                exported.title or f"The model {self.model.name}, one sample at a time."
            ),
            "file": exported.file,
            "GUARD": f"{exported.file.upper()}_H",
            "signals": signals,
            "formals": signals[2:] or "void",
            "passed": "".join(f", {name}" for name in self.arguments),
            "given": ", ".join(self.arguments),
            "zeros": ", 0.0" * len(self.arguments),
            "checked": len(self.numbers) + 1,
            "count": len(self.numbers) + len(self.writer.constant_names()) + 1,
            "longest": c_literal(exported.model.longest),
        }
        return filled(text, {**placeholders, **further})

    # -- header ------------------------------------------------------------------------------------

    def header(self) -> str:
        exported, P, writer = self.exported, self.P, self.writer
        constants = exported.constants
        outputs = {name: writer.output_note(name) for name in exported.names}
        parameters = {name: noted(definition) for name, _, definition in self.rows}
        inputs = {name: self.input_note(name) for name in exported.measured}
        options = {
            full: writer.option_note(part, name)
            for full, (part, name) in zip(exported.option_names, exported.settable, strict=True)
        }
        limits = {
            limit.full: writer.limit_note(limit.part, limit.name) for limit in exported.limits
        }
        enums = [
            _enum("Outputs", constants[""], outputs, f"{P}_OUTPUTS"),
            _enum("Parameters", constants["PARAMETER_"], parameters, f"{P}_PARAMETERS"),
            _enum(
                "Inputs beside those of a step, for which parameters stand",
                constants["INPUT_"],
                inputs,
                f"{P}_INPUTS",
            ),
            _enum(
                "Options; terms that belong to a parameter come on with it",
                constants["OPTION_"],
                options,
                f"{P}_OPTIONS",
            ),
            _enum("Limits, as bits", constants["LIMIT_"], limits, "", bits=True),
        ]
        structs = [text for _, text in self.writer.structs.texts.values()]
        structs += [*self.writer.constants, self.struct()]
        settle = self.filled(TEXTS["settle"]) if exported.settles else ""
        return self.filled(
            TEXTS["header"],
            commands=self.commands(),
            enums="\n\n".join(enum for enum in enums if enum),
            structs="\n\n".join(structs),
            settle=settle,
        )

    def input_note(self, name: str) -> str:
        """What a measured input is, and its range."""
        note, limits = self.writer.input_note(name), self.exported.ranges.get(name)
        return note if limits is None else f"{note} {limits[0]:g} to {limits[1]:g}".strip()

    def commands(self) -> str:
        """Lines of a comment on what a step takes."""
        lines = ""
        for name, argument in zip(self.exported.signals, self.arguments, strict=True):
            note = self.writer.input_note(name)
            bound = self.exported.bounds.get(name)
            limits = "" if bound is None else f"within ±{bound:g}"
            if name in self.exported.ranges:
                limits = "{:g} to {:g}".format(*self.exported.ranges[name])
            description = comment_line(", ".join(filter(None, (note, limits))))
            if description:
                lines += f" * `{argument}`: {description}\n"
        return lines

    def cleared(self) -> str:
        """Statements that set what is known of a sample to 0."""
        words = ("signals", "limits")
        members = [
            f"m->{member}_{word}"
            for member, tags in zip(self.exported.members, self.writer.tags, strict=True)
            for word in words
            if word in tags
        ]
        return "".join(f"        memset(&{member}, 0, sizeof {member});\n" for member in members)

    def struct(self) -> str:
        """The struct that holds all of a model."""
        exported, tags = self.exported, self.writer.tags
        lines = [f"struct {exported.prefix}_memory {{ /* what changes from sample to sample */"]
        for member, part_tags in zip(exported.members, tags, strict=True):
            lines.append(f"    struct {part_tags['state']} {member};")
        lines += [
            f"    double {name}; /* of the sample before */" for name in exported.registers.values()
        ]
        for name in exported.integrals.values():
            lines += [f"    double {name};", f"    double {name}_rate;"]
        lines += ["    bool started; /* a sample was taken */", "};", ""]
        lines += [
            f"struct {exported.prefix}_measured {{",
            "    double value;",
            "    bool given;",
            "};",
            "",
        ]
        lines.append(f"struct {exported.prefix}_inputs {{")
        lines += [f"    double {name};" for name in self.arguments]
        lines.append(
            f"    struct {exported.prefix}_measured measured[{max(len(exported.measured), 1)}];"
        )
        lines += ["};", "", f"struct {exported.type} {{", "    double step; /* [s] */"]
        for member, part_tags in zip(exported.members, tags, strict=True):
            for word, tag in part_tags.items():
                if word != "state":
                    lines.append(f"    struct {tag} {member}{'_' if word else ''}{word};")
        lines.append(f"    struct {exported.prefix}_inputs inputs;")
        lines.append(
            f"    struct {exported.prefix}_memory now, before; /* before the last sample */"
        )
        count, rows = len(exported.taps), exported.line_count
        if exported.windows or exported.histories:
            lines += [
                f"    int whole[{count}];       /* samples by which taps look back */",
                f"    double fraction[{count}]; /* and the rest of one */",
            ]
        if exported.windows:
            lines += [
                f"    double line[{rows}][{self.P}_LINE]; /* what taps read, a ring for each */",
                f"    double before_record[{rows}]; /* what they were before the first sample */",
                "    int newest; /* place of the newest sample */",
            ]
        if exported.histories:
            count, total = len(exported.rings), sum(exported.ring_sizes)
            lines += [
                f"    double past[{total}]; /* what is looked back at: a ring behind the other */",
                f"    double past_before[{count}]; /* what it was before the first sample */",
                f"    int past_newest[{count}]; /* place of the newest sample in each ring */",
            ]
        lines.append("    bool stale;   /* what follows from parameters is to be computed */")
        lines.append("    bool settled; /* the start is not at rest */")
        lines.append("    unsigned ready; /* init has succeeded */")
        return "\n".join([*lines, "};"])

    # -- source ------------------------------------------------------------------------------------

    def source(self) -> str:
        exported = self.exported
        core = "\n\n".join(self.writer.core)
        sections = [
            self.filled(TEXTS["top"]),
            "\n".join(self.helpers(core)),
            self.filled(TEXTS["numbers"]),
            *([self.filled(TEXTS["lines"])] if exported.windows else []),
            *([self.filled(TEXTS["late"])] if "place_late(" in core else []),
            *([self.filled(TEXTS["past"], rings=self.rings())] if exported.histories else []),
            *([self.filled(TEXTS["constant"])] if "constant_window(" in core else []),
            "/* --- the model " + "-" * 80 + " */\n",
            core + "\n",
            self.filled(TEXTS["fill"], before=self.before_all()),
            self.filled(TEXTS["push"], bounds=self.bounds(), push=self.pushed()),
            self.tables(),
            self.switched(),
            self.filled(
                TEXTS["interface"],
                settle=self.settled() if exported.settles else "",
                too_far=self.too_far(),
                constants=self.constants(),
                cleared=self.cleared(),
                move=self.advance_line(),
                outputs=self.outputs(),
                limits=self.limits(),
                places=self.places(),
            ),
        ]
        return "\n".join(sections)

    def helpers(self, core: str) -> list[str]:
        """What the equations call, and the lines."""
        called = helpers_in(core)
        greater_of = HELPERS["greater_of"]
        reads_lines = self.exported.windows or self.exported.histories
        if reads_lines and greater_of not in called:
            called.append(greater_of)
        return called

    def constants(self) -> str:
        """Statements that take the constants of each part."""
        lines, first = list[str](), len(self.numbers) + 1
        for part in self.writer.parts:
            if part.constants:
                member = f"m->{part.member}_constants"
                lines.append(f"memcpy(&{member}, values + {first}, sizeof {member});")
                first += len(part.constants)
        return _body(lines)

    def before_all(self) -> str:
        lines = [f"m->inputs.{name} = {name};" for name in self.arguments]
        signals = self.exported.lines
        initial = [self.exported.arguments.get(signal, "0.0") for signal in signals]
        initial += ["0.0"] * (self.exported.line_count - len(signals))
        lines += [f"fill_line(m, {row}, {text});" for row, text in enumerate(initial)]
        lines += ["m->newest = 0;"] if initial else []
        for ring, signal in enumerate(self.exported.rings):
            text = self.exported.arguments.get(str(signal), "0.0")
            lines.append(f"fill_past(m, {ring}, {text});")
        return _body(lines or ["(void)m;"])

    def bounds(self) -> str:
        tests = []
        for name, argument in zip(self.exported.signals, self.arguments, strict=True):
            if name in self.exported.bounds:
                bound = c_literal(self.exported.bounds[name])
                tests.append(f"{argument} >= -{bound} && {argument} <= {bound}")
                continue
            tests.append(f"is_finite({argument})")
            least, most = self.exported.ranges.get(name, (-inf, inf))
            if isfinite(least):
                tests.append(f"{argument} >= {c_literal(least)}")
            if isfinite(most):
                tests.append(f"{argument} <= {c_literal(most)}")
        return " && ".join(tests) or "true"

    def pushed(self) -> str:
        lines = [f"m->inputs.{name} = {name};" for name in self.arguments]
        for row, signal in enumerate(self.exported.lines):
            lines.append(f"m->line[{row}][m->newest] = {self.writer.layout.value_of(signal)};")
        for ring, looked_at in enumerate(self.exported.rings):
            if isinstance(looked_at, str):
                lines.append(f"put_past(m, {ring}, {self.writer.layout.value_of(looked_at)});")
        return _body(lines or ["(void)m;"])

    def advance_line(self) -> str:
        lines = ""
        if self.exported.line_count:
            lines += f"    m->newest = m->newest > 0 ? m->newest - 1 : {self.P}_LINE - 1;\n"
        return lines + ("    move_rings(m);\n" if self.exported.rings else "")

    def settled(self) -> str:
        """The function that settles a model."""
        starts = "settled_start(m);"
        if self.writer.late:
            failed = [f"if (!{starts[:-1]}) {{", f"    return {self.P}_DOMAIN;", "}"]
            starts = "\n".join(indented(failed)).lstrip()
        return self.filled(TEXTS["settled"], starts=starts)

    def too_far(self) -> str:
        """What a delay beyond its line demands."""
        if not self.exported.rings:
            return f"compile with a larger {self.P}_LINE"
        return f"compile with a larger {self.P}_LINE, or export it with the longest past"

    def rings(self) -> str:
        """Lines that say where each ring begins, and how long it is."""
        begin, lines = 0, list[str]()
        for size in self.exported.ring_sizes:
            lines.append(f"{{{begin}, {size}}},")
            begin += size
        return _body(lines)

    def tables(self) -> str:
        """Values with their places and ranges, places of options, names."""
        exported, ranges = self.exported, dict[str, int]()
        declared = {member: definition for _, member, definition in self.rows}
        flags = {
            f"{exported.members[part_index]}_options.{c_name(name)}"
            for part_index, name in exported.options
        }
        rows = []
        for _, member in self.numbers:
            definition = declared.get(member, Definition("", "", can_be_off=True))
            lower_open = definition.above is not None or (
                member in declared and definition.lower == -inf
            )
            upper_closed = definition.can_be_off and definition.upper == inf
            limits = (
                definition.lower,
                definition.upper,
                not lower_open,
                upper_closed,
                member in flags,
            )
            number = ranges.setdefault(", ".join(map(c_literal, limits)), len(ranges))
            rows.append(f"    {{offsetof({exported.type}, {member}), {number}}},")
        lines = [f"static const struct {exported.prefix}_range ranges[] = {{"]
        lines += [*(f"    {{{limits_of_range}}}," for limits_of_range in ranges), "};", ""]
        lines += [
            f"static const struct {exported.prefix}_value value_table[] = {{",
            *rows,
            "};",
            "",
        ]
        options = [
            f"{exported.members[part_index]}_options.{c_name(name)}"
            for part_index, name in exported.settable
        ]
        lines.append("static const unsigned option_places[] = {")
        lines += [f"    offsetof({exported.type}, {member})," for member in options] or ["    0,"]
        lines += ["};", ""]
        pairs = [exported.ranges.get(name, (-inf, inf)) for name in exported.measured] or [
            (0.0, 0.0)
        ]
        listed = ", ".join(f"{{{c_literal(low)}, {c_literal(high)}}}" for low, high in pairs)
        lines += [*wrapped(f"static const double input_ranges[][2] = {{{listed}}};"), ""]
        lines.append("static const unsigned flag_places[] = {")
        lines += [
            *(f"    offsetof({exported.type}, {member})," for member in exported.flags),
            "};",
            "",
        ]
        for word, names in (
            ("parameter", [name for name, _, _ in self.rows]),
            ("output", exported.names),
            ("input", exported.measured),
            ("option", exported.option_names),
        ):
            lines += [*_names_table(f"{word}_names", names), ""]
        return "\n".join(lines)

    def switched(self) -> str:
        """Terms that come on and go off with their parameters."""
        cases: dict[str, list[str]] = {}
        name_of = {member: name for name, member, _ in self.rows}
        for (part, option), paths in self.model.switches.items():
            member = self.exported.members[part]
            members = [f"{member}.{path_of(path)}" for path in paths]
            test = " || ".join(f"m->{member} != 0.0" for member in members)
            line = f"m->{member}_options.{c_name(option)} = {test};"
            cases.setdefault(line, []).extend(
                self.exported.constants["PARAMETER_"][name_of[member]] for member in members
            )
        description = "Switch a term on if its parameter is not 0, off if it is 0."
        head = f"static void switch_terms({self.exported.type} *m, int parameter)"
        if not cases:
            return c_function(description, head, ["(void)m;", "(void)parameter;"]) + "\n"
        lines = ["switch (parameter) {"]
        for line, numbers in cases.items():
            lines += [*(f"case {number}:" for number in numbers), f"    {line}", "    break;"]
        return c_function(description, head, [*lines, "default:", "    break;", "}"]) + "\n"

    def places(self) -> str:
        """Whether taps and the newest sample lie within their lines."""
        most = f"{self.P}_LINE - {{}}"
        ends = [
            (f"m->whole[{tap.number}]", most.format(tap.tap.samples))
            for tap in self.exported.windows
        ]
        ends += [("m->newest", most.format(1))] if self.exported.lines else []
        for tap in self.exported.histories:
            size = self.exported.ring_sizes[self.exported.ring_of(tap)]
            ends.append((f"m->whole[{tap.number}]", str(size - BEYOND)))
        for ring, size in enumerate(self.exported.ring_sizes):
            ends.append((f"m->past_newest[{ring}]", str(size - 1)))
        tests = [f"{member} >= 0 && {member} <= {end}" for member, end in ends]
        return _body([f"return {' && '.join(tests) or 'true'};"])

    def outputs(self) -> str:
        lines = []
        for name in self.exported.names:
            read = self.writer.output(name)
            lines += [f"    case {self.exported.constants[''][name]}:", f"        return {read};"]
        return "".join(f"{line}\n" for line in lines)

    def limits(self) -> str:
        if not self.exported.limits:
            return _body(["(void)m;", "return 0u;"])
        lines = ["unsigned bits = 0u;"]
        bit_of = self.exported.constants["LIMIT_"]
        for part_index, name, full in self.exported.limits:
            member = f"m->{self.exported.members[part_index]}_limits.{c_name(name)}"
            lines.append(f"bits |= {member} ? (unsigned){bit_of[full]} : 0u;")
        return _body([*lines, "return bits;"])


def _names_table(table: str, names: Sequence[str]) -> list[str]:
    """Lines of an array of names, each with a zero behind it."""
    listed = " ".join(f'"{name}\\0"' for name in names) or '""'
    if sum(len(name) + 1 for name in names) <= LONGEST_STRING:
        return wrapped(f"static const char {table}[] = {listed};")
    lines = [f"static const char {table}[] = {{"]
    for name in names:
        characters = ", ".join(f"'{character}'" for character in name)
        lines += wrapped(f"    {characters}, '\\0',")
    return [*lines, "};"]


def _body(lines: Sequence[str]) -> str:
    return "".join(f"{line}\n" for line in indented(lines))


def _enum(
    description: str,
    constants: Mapping[str, str],
    notes: Mapping[str, str],
    count: str,
    *,
    bits: bool = False,
) -> str:
    """An enum with a constant for each name, and what is said of it."""
    if not notes and not count:
        return ""
    lines = [f"/* {description}. */", "enum {"]
    for index, (name, note) in enumerate(notes.items()):
        number = 1 << index if bits else index
        comma = "," if count or index + 1 < len(notes) else ""
        lines += with_comment(f"{constants[name]} = {number}{comma}", note)
    lines += [f"    {count} = {len(notes)}"] if count else []
    return "\n".join([*lines, "};"])
