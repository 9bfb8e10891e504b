"""The C interface of an exported model: header and source around its equations."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from swashplate.equations import Definition
from swashplate.equations.code_generation import (
    HELPERS,
    c_name,
    comment_line,
    filled,
    function,
    helpers_in,
    indented,
    literal,
    sections,
    wrapped,
)
from swashplate.export.c_source.exported import Exported
from swashplate.export.c_source.layout import path_of
from swashplate.export.c_source.model import writer_of

TEXTS = sections(__package__, "interface.c.in")
"""Sections of the text around the equations, by name."""


def interface(exported: Exported) -> dict[str, str]:
    """Header and source of a model, by file name."""
    made = _Interface(exported)
    return {f"{exported.file}.h": made.header(), f"{exported.file}.c": made.source()}


class _Interface:
    """Fills the texts above."""

    def __init__(self, exported: Exported) -> None:
        self.e, self.model, self.writer = exported, exported.model, writer_of(exported)
        self.P = self.writer.P
        self.arguments = [c_name(name) for name in exported.signals]
        self.rows, self.numbers = list(self.writer.ranges()), self.writer.values()

    def filled(self, text: str, **more: str) -> str:
        e, signals = self.e, "".join(f", double {name}" for name in self.arguments)
        words = {
            "type": e.type,
            "p": e.prefix,
            "P": self.P,
            "samples": e.widest,
            "title": comment_line(e.title or f"The model {self.model.name}, one sample at a time."),
            "file": e.file,
            "GUARD": f"{e.file.upper()}_H",
            "signals": signals,
            "formals": signals[2:] or "void",
            "passed": "".join(f", {name}" for name in self.arguments),
            "given": ", ".join(self.arguments),
            "zeros": ", 0.0" * len(self.arguments),
            "checked": len(self.numbers) + 1,
            "count": len(self.numbers) + len(self.writer.constant_names()) + 1,
            "longest": literal(e.longest),
        }
        return filled(text, {**words, **more})

    # -- header ------------------------------------------------------------------------------------

    def header(self) -> str:
        e, P = self.e, self.P
        enums = [
            _enum("Outputs", f"{P}_", e.names, f"{P}_OUTPUTS"),
            _enum("Parameters", f"{P}_PARAMETER_", [n for n, _, _ in self.rows], f"{P}_PARAMETERS"),
            _enum(
                "Inputs beside those of a step, for which parameters stand",
                f"{P}_INPUT_", e.measured, f"{P}_INPUTS",
            ),
            _enum(
                "Options; terms that belong to a parameter come on with it",
                f"{P}_OPTION_", [n for _, n in e.settable], f"{P}_OPTIONS",
            ),
            _enum("Limits, as bits", f"{P}_LIMIT_", [n for _, n in e.limits], "", bits=True),
        ]  # fmt: skip
        structs = [text for _, text in self.writer.structs.texts.values()]
        structs += [*self.writer.constants, self.struct()]
        settle = self.filled(TEXTS["settle"]) if e.settles else ""
        return self.filled(
            TEXTS["header"],
            enums="\n\n".join(each for each in enums if each),
            structs="\n\n".join(structs),
            settle=settle,
        )

    def struct(self) -> str:
        """The struct that holds all of a model."""
        e, tags = self.e, self.writer.tags
        lines = [f"struct {e.prefix}_memory {{ /* what changes from sample to sample */"]
        for member, own in zip(e.members, tags, strict=True):
            lines.append(f"    struct {own['state']} {member};")
        for name in self.model.integrals:
            lines += [f"    double {c_name(name)};", f"    double {c_name(name)}_rate;"]
        lines += ["    bool begun; /* a sample was taken */", "};", ""]
        lines += [
            f"struct {e.prefix}_measured {{",
            "    double value;",
            "    bool given;",
            "};",
            "",
        ]
        lines.append(f"struct {e.prefix}_inputs {{")
        lines += [f"    double {name};" for name in self.arguments]
        lines.append(f"    struct {e.prefix}_measured measured[{max(len(e.measured), 1)}];")
        lines += ["};", "", f"struct {e.type} {{", "    double step; /* [s] */"]
        for member, own in zip(e.members, tags, strict=True):
            for word, tag in own.items():
                if word != "state":
                    lines.append(f"    struct {tag} {member}{'_' if word else ''}{word};")
        lines.append(f"    struct {e.prefix}_inputs inputs;")
        lines.append(f"    struct {e.prefix}_memory now, before; /* before the last sample */")
        if e.taps:
            count, rows = len(e.taps), len(e.lines)
            lines += [
                f"    int whole[{count}];       /* samples by which taps look back */",
                f"    double fraction[{count}]; /* and the rest of one */",
                f"    double line[{rows}][{self.P}_LINE];",
                f"    double before_record[{rows}];",
                "    int newest; /* place of the newest sample */",
            ]
        lines.append("    bool stale;   /* what follows from parameters is to be computed */")
        lines.append("    bool settled; /* the start is not at rest */")
        return "\n".join([*lines, "};"])

    # -- source ------------------------------------------------------------------------------------

    def source(self) -> str:
        e = self.e
        core = "\n\n".join(self.writer.core)
        sections = [
            self.filled(TEXTS["top"]),
            "\n".join(self.helpers(core)),
            self.filled(TEXTS["numbers"]),
            *([self.filled(TEXTS["lines"])] if e.taps else []),
            *([self.filled(TEXTS["constant"])] if "constant_window(" in core else []),
            "/* --- the model " + "-" * 80 + " */\n",
            core + "\n",
            self.filled(TEXTS["fill"], before=self.before_all()),
            self.filled(TEXTS["push"], bounds=self.bounds(), push=self.pushed()),
            self.tables(),
            self.switched(),
            self.filled(
                TEXTS["interface"],
                settle=self.filled(TEXTS["settled"]) if e.settles else "",
                constants=self.constants(),
                move=self.moved(),
                outputs=self.outputs(),
                limits=self.limits(),
                places=self.places(),
            ),
        ]
        return "\n".join(sections)

    def helpers(self, core: str) -> list[str]:
        """What the equations call, and the lines."""
        found = helpers_in(core)
        own = HELPERS["greater_of"]
        return [*found, own] if self.e.taps and own not in found else found

    def constants(self) -> str:
        """Statements that take the constants of each part."""
        lines, first = list[str](), len(self.numbers) + 1
        for part in self.writer.parts:
            if part.constants:
                place = f"m->{part.member}_constants"
                lines.append(f"memcpy(&{place}, values + {first}, sizeof {place});")
                first += len(part.constants)
        return _body(lines)

    def before_all(self) -> str:
        lines = [f"m->inputs.{name} = {name};" for name in self.arguments]
        for k, signal in enumerate(self.e.lines):
            value = c_name(signal) if signal in self.e.signals else "0.0"
            lines += [
                f"m->before_record[{k}] = {value};",
                f"for (int i = 0; i < {self.P}_LINE; i++) {{",
                f"    m->line[{k}][i] = {value};",
                "}",
            ]
        return _body([*lines, *(["m->newest = 0;"] if self.e.lines else [])] or ["(void)m;"])

    def bounds(self) -> str:
        found = []
        for name, own in zip(self.e.signals, self.arguments, strict=True):
            bound = self.e.bounds.get(name)
            found.append(
                f"is_finite({own})" if bound is None
                else f"{own} >= -{literal(bound)} && {own} <= {literal(bound)}"
            )  # fmt: skip
        return " && ".join(found) or "true"

    def pushed(self) -> str:
        lines = [f"m->inputs.{name} = {name};" for name in self.arguments]
        for k, signal in enumerate(self.e.lines):
            lines.append(f"m->line[{k}][m->newest] = {self.writer.layout.value_of(signal)};")
        return _body(lines or ["(void)m;"])

    def moved(self) -> str:
        if not self.e.lines:
            return ""
        return f"    m->newest = m->newest > 0 ? m->newest - 1 : {self.P}_LINE - 1;\n"

    def tables(self) -> str:
        """Values with their places and ranges, places of options, names."""
        e, ranges = self.e, dict[str, int]()
        declared = {place: definition for _, place, definition in self.rows}
        flags = {f"{e.members[i]}_options.{c_name(name)}" for i, name in e.options}
        rows = []
        for _, place in self.numbers:
            d = declared.get(place, Definition("", "", can_be_off=True))
            above = d.above is not None or (place in declared and d.lower == -inf)
            closed = d.can_be_off and d.upper == inf
            limits = (d.lower, d.upper, above, closed, place in flags)
            number = ranges.setdefault(", ".join(map(literal, limits)), len(ranges))
            rows.append(f"    {{offsetof({e.type}, {place}), {number}}},")
        lines = [f"static const struct {e.prefix}_range ranges[] = {{"]
        lines += [*(f"    {{{each}}}," for each in ranges), "};", ""]
        lines += [f"static const struct {e.prefix}_value value_table[] = {{", *rows, "};", ""]
        options = [f"{e.members[i]}_options.{c_name(name)}" for i, name in e.settable]
        lines.append("static const unsigned option_places[] = {")
        lines += [f"    offsetof({e.type}, {place})," for place in options] or ["    0,"]
        lines += ["};", ""]
        pairs = [e.ranges.get(name, (-inf, inf)) for name in e.measured] or [(0.0, 0.0)]
        listed = ", ".join(f"{{{literal(low)}, {literal(high)}}}" for low, high in pairs)
        lines += [*wrapped(f"static const double input_ranges[][2] = {{{listed}}};"), ""]
        lines.append("static const unsigned flag_places[] = {")
        lines += [*(f"    offsetof({e.type}, {place})," for place in e.flags), "};", ""]
        for word, names in (
            ("parameter", [name for name, _, _ in self.rows]),
            ("output", e.names),
            ("input", e.measured),
            ("option", [name for _, name in e.settable]),
        ):
            listed = " ".join(f'"{name}\\0"' for name in names) or '""'
            lines += [*wrapped(f"static const char {word}_names[] = {listed};"), ""]
        return "\n".join(lines)

    def switched(self) -> str:
        """Terms that come on and go off with their parameters."""
        cases: dict[str, list[str]] = {}
        places = {place: i for i, (_, place, _) in enumerate(self.rows)}
        for (part, option), paths in self.e.switches.items():
            member = self.e.members[part]
            own = [f"{member}.{path_of(path)}" for path in paths]
            test = " || ".join(f"m->{place} != 0.0" for place in own)
            line = f"m->{member}_options.{c_name(option)} = {test};"
            cases.setdefault(line, []).extend(str(places[place]) for place in own)
        says = "Terms of the equations that are on where their parameters are not 0."
        head = f"static void switched({self.e.type} *m, int parameter)"
        if not cases:
            return function(says, head, ["(void)m;", "(void)parameter;"]) + "\n"
        lines = ["switch (parameter) {"]
        for line, numbers in cases.items():
            lines += [*(f"case {number}:" for number in numbers), f"    {line}", "    break;"]
        return function(says, head, [*lines, "default:", "    break;", "}"]) + "\n"

    def places(self) -> str:
        """Whether taps and the newest sample lie within their lines."""
        most = f"{self.P}_LINE - {{}}"
        ends = [(f"m->whole[{tap.number}]", most.format(tap.tap.samples)) for tap in self.e.taps]
        ends += [("m->newest", most.format(1))] if self.e.lines else []
        tests = [f"{place} >= 0 && {place} <= {end}" for place, end in ends]
        return _body([f"return {' && '.join(tests) or 'true'};"])

    def outputs(self) -> str:
        lines = []
        for name in self.e.names:
            read = self.writer.output(name)
            lines += [f"    case {self.P}_{path_name(name)}:", f"        return {read};"]
        return "".join(f"{line}\n" for line in lines)

    def limits(self) -> str:
        if not self.e.limits:
            return _body(["(void)m;", "return 0u;"])
        lines = ["unsigned bits = 0u;"]
        for i, name in self.e.limits:
            place = f"m->{self.e.members[i]}_limits.{c_name(name)}"
            lines.append(f"bits |= {place} ? (unsigned){self.P}_LIMIT_{c_name(name)} : 0u;")
        return _body([*lines, "return bits;"])


def path_name(name: str) -> str:
    """A signal's name as part of one in an enum."""
    return c_name(name.replace(".", "_"))


def _body(lines: Sequence[str]) -> str:
    return "".join(f"{line}\n" for line in indented(lines))


def _enum(says: str, prefix: str, names: Sequence[str], count: str, *, bits: bool = False) -> str:
    if not names and not count:
        return ""
    lines = [f"/* {says}. */", "enum {"]
    for i, name in enumerate(names):
        value = 1 << i if bits else i
        comma = "," if count or i + 1 < len(names) else ""
        lines.append(f"    {prefix}{path_name(name)} = {value}{comma}")
    lines += [f"    {count} = {len(names)}"] if count else []
    return "\n".join([*lines, "};"])
