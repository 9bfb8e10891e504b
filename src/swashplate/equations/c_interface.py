"""The C interface of an exported model: header and source around its equations."""

from __future__ import annotations

from collections.abc import Sequence

from swashplate.equations.c_model import Exported, Writer, indented, path_of
from swashplate.equations.c_source import HELPERS, c_name, literal, wrapped
from swashplate.equations.fields import floats_of
from swashplate.equations.model import Window

HEADER = """\
/* @title@
 *
 * SI throughout. Plain data: no pointers, so that a copy of the struct is a copy of the state, and
 * two of them never meet. No allocation, no globals, no input or output.
 */
#ifndef @GUARD@
#define @GUARD@

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef @P@_LINE
#define @P@_LINE 1024 /* samples of a delay line: the longest delay is @P@_LINE - @samples@ steps */
#endif
#ifndef @P@_API
#define @P@_API
#endif

/* What a call may return; @p@_sentence says it in words. */
enum {
    @P@_OK = 0,
    @P@_BAD_VALUE = 1, /* not a number, or out of range: nothing has changed */
    @P@_UNSTABLE = 2,  /* the equations do not bear this step with these parameters */
    @P@_BAD_DELAY = 3, /* a delay is longer than its line */
    @P@_DOMAIN = 4     /* the equations do not hold here, or a number overflowed: reset */
};

@enums@

@structs@

typedef struct @type@ @type@;

@P@_API size_t @p@_size(void);        /* bytes of a @type@ */
@P@_API size_t @p@_value_count(void); /* numbers that @p@_init takes */

/* At rest, with `count` values: step, parameters, options, and constants that follow from them. */
@P@_API int @p@_init(@type@ *m, const double *values, size_t count);
@P@_API int @p@_reset(@type@ *m); /* at rest, values kept */
@settle@
/* One sample; the first one after init, reset or settle is that at time zero. */
@P@_API int @p@_step(@type@ *m@signals@);
/* The last sample again, with another command and the inputs as they are set now, as if it had been
 * so from the beginning. */
@P@_API int @p@_correct(@type@ *m@signals@);

@P@_API double @p@_output(const @type@ *m, int output); /* of the last sample */
@P@_API unsigned @p@_limits(const @type@ *m);           /* limits that act there, as bits */

/* Inputs that were measured: from the next sample on; cleared, a parameter stands for them. */
@P@_API int @p@_set_input(@type@ *m, int input, double value);
@P@_API int @p@_clear_input(@type@ *m, int input);

/* Parameters, options and the step count from the next sample on. */
@P@_API int @p@_set(@type@ *m, int parameter, double value);
@P@_API double @p@_get(const @type@ *m, int parameter);
@P@_API int @p@_set_option(@type@ *m, int option, bool on);
@P@_API bool @p@_get_option(const @type@ *m, int option);
@P@_API int @p@_set_step(@type@ *m, double step); /* [s] */
@P@_API double @p@_get_step(const @type@ *m);
@P@_API int @p@_update(@type@ *m); /* now, not in the next sample */

/* Numbers of names, -1 for none; names of numbers, NULL for none. */
@P@_API int @p@_find(const char *parameter);
@P@_API int @p@_find_output(const char *output);
@P@_API int @p@_find_input(const char *input);
@P@_API int @p@_find_option(const char *option);
@P@_API const char *@p@_parameter_name(int parameter);
@P@_API const char *@p@_output_name(int output);
@P@_API const char *@p@_sentence(int status);

#ifdef __cplusplus
}
#endif

#endif
"""
SETTLE = """\
/* Settled under a constant command and the inputs that are set; before the first step. */
@P@_API int @p@_settle(@type@ *m@signals@);
"""
TOP = """\
/* @title@ */
#include "@file@.h"

#include <float.h>
#include <math.h>
#include <string.h>

#ifdef __FAST_MATH__
#error "compile without -ffast-math: the order of operations and what is no number count"
#endif
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "double arithmetic must be done in double: with gcc on 32-bit x86 say -msse2 -mfpmath=sse"
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF /* gcc does not know it: compile with -ffp-contract=off */
#endif
"""
NUMBERS = """\
/* --- numbers by their places ------------------------------------------------------------------ */

struct @p@_parameter {
    const char *name;
    size_t place;
    double lower, upper;
    bool above;  /* the lower bound itself is not allowed */
    bool closed; /* the upper bound itself is allowed */
};

static double number_at(const @type@ *m, size_t place)
{
    double value;
    memcpy(&value, (const char *)m + place, sizeof value);
    return value;
}

static void put_at(@type@ *m, size_t place, double value)
{
    memcpy((char *)m + place, &value, sizeof value);
}

static bool is_finite(double value) { return value - value == 0.0; }

static bool in_range(const struct @p@_parameter *p, double value)
{
    const bool low = p->above ? value > p->lower : value >= p->lower;
    return low && (p->closed ? value <= p->upper : value < p->upper);
}

static int number_of(const char *const *names, int count, const char *name)
{
    for (int i = 0; i < count; i++) {
        if (strcmp(names[i], name) == 0) {
            return i;
        }
    }
    return -1;
}
"""
LINES = """\
/* --- delay lines ------------------------------------------------------------------------------ */

/* Where a tap reads: whole samples back and the rest of one. */
static bool placed(@type@ *m, int tap, double delay, double ahead, int samples)
{
    const double steps = delay / m->step;
    const double end = greater_of(steps, ahead) - ahead;
    if (!(steps >= 0.0 && end <= (double)(@P@_LINE - samples))) {
        return false;
    }
    m->whole[tap] = (int)end;
    m->fraction[tap] = end - (double)m->whole[tap];
    return true;
}

static struct @window@ seen(const @type@ *m, int tap, int line, int samples)
{
    struct @window@ window = {{{0.0}}, m->fraction[tap]};
    for (int j = 0; j < samples; j++) {
        const int at = m->newest + m->whole[tap] + j;
        window.s.v[j] = m->line[line][at < @P@_LINE ? at : at - @P@_LINE];
    }
    return window;
}
"""
CONSTANT = """\
static struct @window@ constant_window(double value)
{
    struct @window@ window = {{{0.0}}, 0.0};
    for (int j = 0; j < @samples@; j++) {
        window.s.v[j] = value;
    }
    return window;
}
"""
FILL = """\
/* Lines and inputs as they were before the record. */
static void before_all(@type@ *m@signals@)
{
@before@}
"""
PUSH = """\
static bool good_inputs(@formals@)
{
    return @bounds@;
}

/* The newest inputs, in their lines. */
static void put_inputs(@type@ *m@signals@)
{
@push@}

/* The sample that is next, of the inputs as they are. */
static int taken(@type@ *m)
{
    if (!m->now.begun && !m->settled) {
        rested_start(m);
    }
    m->before = m->now;
    return one_sample(m);
}
"""
INTERFACE = """\
/* --- interface -------------------------------------------------------------------------------- */

size_t @p@_size(void) { return sizeof(@type@); }

size_t @p@_value_count(void) { return @count@; }

int @p@_init(@type@ *m, const double *values, size_t count)
{
    if (count != @count@ || !(values[0] > 0.0 && values[0] <= @longest@)) {
        return @P@_BAD_VALUE;
    }
    memset(m, 0, sizeof *m);
    const double *next = values;
    m->step = *next++;
    for (int i = 0; i < @P@_PARAMETERS; i++, next++) {
        if (!in_range(&parameter_table[i], *next)) {
            return @P@_BAD_VALUE;
        }
        put_at(m, parameter_table[i].place, *next);
    }
@rest@    m->stale = false;
    const int status = checked(m);
    if (status != @P@_OK) {
        return status;
    }
    return @p@_reset(m);
}

int @p@_update(@type@ *m)
{
    if (!m->stale) {
        return @P@_OK;
    }
    const int status = checked(m);
    if (status == @P@_OK) {
        computed(m);
        m->stale = false;
    }
    return status;
}

int @p@_reset(@type@ *m)
{
    memset(&m->now, 0, sizeof m->now);
    m->before = m->now;
    m->settled = false;
    before_all(m@zeros@);
    return @p@_update(m);
}
@settle@
int @p@_step(@type@ *m@signals@)
{
    if (!good_inputs(@given@)) {
        return @P@_BAD_VALUE;
    }
    const int status = @p@_update(m);
    if (status != @P@_OK) {
        return status;
    }
@move@    put_inputs(m@passed@);
    return taken(m);
}

int @p@_correct(@type@ *m@signals@)
{
    if (!m->now.begun || !good_inputs(@given@)) {
        return @P@_BAD_VALUE;
    }
    const int status = @p@_update(m);
    if (status != @P@_OK) {
        return status;
    }
    m->now = m->before;
    put_inputs(m@passed@);
    return taken(m);
}

double @p@_output(const @type@ *m, int output)
{
    switch (output) {
@outputs@    default:
        return NAN;
    }
}

unsigned @p@_limits(const @type@ *m)
{
@limits@}

int @p@_set_input(@type@ *m, int input, double value)
{
    if (!is_finite(value)) {
        return @P@_BAD_VALUE;
    }
@no_inputs@    switch (input) {
@set_inputs@    default:
        return @P@_BAD_VALUE;
    }
}

int @p@_clear_input(@type@ *m, int input)
{
@no_inputs@    switch (input) {
@clear_inputs@    default:
        return @P@_BAD_VALUE;
    }
}

int @p@_set(@type@ *m, int parameter, double value)
{
    if (parameter < 0 || parameter >= @P@_PARAMETERS || !in_range(&parameter_table[parameter], value)) {
        return @P@_BAD_VALUE;
    }
    if (value != number_at(m, parameter_table[parameter].place)) {
        put_at(m, parameter_table[parameter].place, value);
        switched(m, parameter);
        m->stale = true;
    }
    return @P@_OK;
}

double @p@_get(const @type@ *m, int parameter)
{
    if (parameter < 0 || parameter >= @P@_PARAMETERS) {
        return NAN;
    }
    return number_at(m, parameter_table[parameter].place);
}

int @p@_set_option(@type@ *m, int option, bool on)
{
@no_options@@no_on@    switch (option) {
@set_options@    default:
        return @P@_BAD_VALUE;
    }
}

bool @p@_get_option(const @type@ *m, int option)
{
@no_options@    switch (option) {
@get_options@    default:
        return false;
    }
}

int @p@_set_step(@type@ *m, double step)
{
    if (!(step > 0.0 && step <= @longest@)) {
        return @P@_BAD_VALUE;
    }
    if (step != m->step) {
        m->step = step;
        m->stale = true;
    }
    return @P@_OK;
}

double @p@_get_step(const @type@ *m) { return m->step; }

int @p@_find(const char *parameter)
{
    for (int i = 0; i < @P@_PARAMETERS; i++) {
        if (strcmp(parameter_table[i].name, parameter) == 0) {
            return i;
        }
    }
    return -1;
}

int @p@_find_output(const char *output) { return number_of(output_names, @P@_OUTPUTS, output); }

int @p@_find_input(const char *input) { return number_of(input_names, @P@_INPUTS, input); }

int @p@_find_option(const char *option) { return number_of(option_names, @P@_OPTIONS, option); }

const char *@p@_parameter_name(int parameter)
{
    return parameter < 0 || parameter >= @P@_PARAMETERS ? NULL : parameter_table[parameter].name;
}

const char *@p@_output_name(int output)
{
    return output < 0 || output >= @P@_OUTPUTS ? NULL : output_names[output];
}

const char *@p@_sentence(int status)
{
    switch (status) {
    case @P@_OK:
        return "all is well";
    case @P@_BAD_VALUE:
        return "a value is no number or out of range; nothing has changed";
    case @P@_UNSTABLE:
        return "the equations are unstable at this step: take a shorter one";
    case @P@_BAD_DELAY:
        return "a delay is longer than its line: compile with a larger @P@_LINE";
    case @P@_DOMAIN:
        return "the equations do not hold for these numbers, or one of them overflowed";
    default:
        return "there is no such status";
    }
}
"""
SETTLED = """
int @p@_settle(@type@ *m@signals@)
{
    if (!good_inputs(@given@)) {
        return @P@_BAD_VALUE;
    }
    const int status = @p@_reset(m);
    if (status != @P@_OK) {
        return status;
    }
    before_all(m@passed@);
    put_inputs(m@passed@);
    settled_start(m);
    m->settled = true;
    m->before = m->now;
    return @finite@ ? @P@_OK : @P@_DOMAIN;
}
"""


def interface(exported: Exported) -> dict[str, str]:
    """Header and source of a model.

    Returns
    -------
    dict of str to str
        Text by file name.

    Raises
    ------
    EquationError
        If something in an equation has no counterpart in C; the sentence has file, line and name.
    """
    made = _Interface(exported)
    return {f"{exported.file}.h": made.header(), f"{exported.file}.c": made.source()}


class _Interface:
    """Fills the texts above."""

    def __init__(self, exported: Exported) -> None:
        self.e, self.writer = exported, Writer(exported)
        self.model, self.P = exported.model, self.writer.P
        self.arguments = [c_name(name) for name in exported.signals]
        self.rows = list(self.writer.ranges())
        self.values = self.writer.values()
        # first, so that the equations behind links are among the functions
        self.read = [self.writer.output(name) for name in exported.names]

    def filled(self, text: str, **more: str) -> str:
        e = self.e
        signals = "".join(f", double {name}" for name in self.arguments)
        return self.writer.filled(
            text,
            title=e.title or f"The model {self.model.name}, one sample at a time.",
            file=e.file,
            GUARD=f"{e.file.upper()}_H",
            signals=signals,
            formals=signals[2:] or "void",
            passed="".join(f", {name}" for name in self.arguments),
            given=", ".join(self.arguments),
            zeros=", 0.0" * len(self.arguments),
            count=str(len(self.values) + 1),
            longest=literal(e.longest),
            no_inputs="" if e.measured else "    (void)m;\n",
            no_options="" if e.settable else "    (void)m;\n",
            no_on="" if e.settable else "    (void)on;\n",
            **more,
        )

    # -- header ------------------------------------------------------------------------------------

    def header(self) -> str:
        e, writer, P = self.e, self.writer, self.P
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
        structs = [text for _, text in list(writer.unit.structs.values())]
        structs = [*structs[: self.first_private()], self.struct()]
        settle = self.filled(SETTLE) if e.settles else ""
        return self.filled(
            HEADER,
            enums="\n\n".join(each for each in enums if each),
            structs="\n\n".join(structs),
            settle=settle,
        )

    def first_private(self) -> int:
        """Number of structs that the header needs."""
        return self.writer.public

    def struct(self) -> str:
        """The struct that holds all of a model."""
        e, unit = self.e, self.writer.unit
        lines = [f"struct {e.prefix}_memory {{ /* what changes from sample to sample */"]
        for member, part in zip(e.members, self.model.parts, strict=True):
            lines.append(f"    struct {unit.struct(part.state)} {member};")
        for name in self.model.integrals:
            lines += [f"    double {c_name(name)};", f"    double {c_name(name)}_rate;"]
        lines += ["    bool begun; /* a sample was taken */", "};", ""]
        lines.append(f"struct {e.prefix}_inputs {{")
        lines += [f"    double {name};" for name in self.arguments]
        for name in e.measured:
            lines += [f"    double {c_name(name)};", f"    bool {c_name(name)}_given;"]
        lines += ["};", "", f"struct {e.type} {{", "    double step; /* [s] */"]
        for member, part in zip(e.members, self.model.parts, strict=True):
            lines += [f"    struct {tag} {member}{tail};" for tag, tail in self.of_part(part)]
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

    def of_part(self, part: object) -> Sequence[tuple[str, str]]:
        """Tags and endings of the members that belong to a part."""
        return [(tag, tail) for tag, tail in self.writer.members_of(part)]

    # -- source ------------------------------------------------------------------------------------

    def source(self) -> str:
        e, writer, unit = self.e, self.writer, self.writer.unit
        window = unit.struct(Window) if e.taps else ""
        private = [text for _, text in list(unit.structs.values())[self.first_private() :]]
        constants = [text for _, text in unit.constants.values()]
        core = "\n\n".join(writer.core)
        sections = [
            self.filled(TOP),
            "\n".join(self.helpers()),
            self.filled(NUMBERS),
            *([self.filled(LINES, window=window)] if e.taps else []),
            *([self.filled(CONSTANT, window=window)] if "constant_window(" in core else []),
            "/* --- equations " + "-" * 80 + " */\n",
            *(["\n\n".join(private) + "\n"] if private else []),
            *(["\n".join(constants) + "\n"] if constants else []),
            "\n\n".join(unit.texts) + "\n",
            "/* --- the model " + "-" * 80 + " */\n",
            core + "\n",
            self.filled(FILL, before=self.before_all()),
            self.filled(PUSH, bounds=self.bounds(), push=self.pushed()),
            self.tables(),
            self.switched(),
            self.filled(
                INTERFACE,
                rest=self.rest(),
                settle=self.filled(SETTLED, finite=self.finite()) if e.settles else "",
                move=self.moved(),
                outputs=self.outputs(),
                limits=self.limits(),
                set_inputs=self.set_inputs(),
                clear_inputs=self.clear_inputs(),
                set_options=self.set_options(),
                get_options=self.get_options(),
            ),
        ]
        return "\n".join(sections)

    def helpers(self) -> list[str]:
        """What the equations call, and the lines."""
        found = self.writer.unit.helpers()
        own = HELPERS["greater_of"]
        return [*found, own] if self.e.taps and own not in found else found

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
            value = f"m->inputs.{c_name(signal)}"
            lines.append(f"m->line[{k}][m->newest] = {value};")
        return _body(lines or ["(void)m;"])

    def moved(self) -> str:
        if not self.e.lines:
            return ""
        return f"    m->newest = m->newest > 0 ? m->newest - 1 : {self.P}_LINE - 1;\n"

    def tables(self) -> str:
        """Parameters, names and places."""
        e, lines = self.e, list[str]()
        lines.append(f"static const struct {e.prefix}_parameter parameter_table[] = {{")
        for name, place, d in self.rows:
            above = d.above is not None or d.lower == -float("inf")
            closed = d.can_be_off and d.upper == float("inf")
            row = f'"{name}", offsetof({e.type}, {place}), {literal(d.lower)}, {literal(d.upper)}'
            lines.append(f"    {{{row}, {literal(above)}, {literal(closed)}}},")
        lines += ["};", ""]
        count = len(self.rows)
        given = self.values[count : count + len(e.named("given"))]
        flags = [f"{e.members[i]}_options.{c_name(name)}" for i, name in e.options]
        constants = self.values[count + len(given) + len(flags) :]
        for word, places in (
            ("given_places", [place for _, place in given]),
            ("flag_places", flags),
            ("constant_places", [place for _, place in constants]),
        ):
            if places:
                lines.append(f"static const size_t {word}[] = {{")
                lines += [f"    offsetof({e.type}, {place})," for place in places]
                lines += ["};", ""]
        for word, names in (
            ("output_names", e.names),
            ("input_names", e.measured),
            ("option_names", [name for _, name in e.settable]),
        ):
            listed = ", ".join(f'"{name}"' for name in names) or "NULL"
            lines += [*wrapped(f"static const char *const {word}[] = {{{listed}}};"), ""]
        return "\n".join(lines)

    def rest(self) -> str:
        """Lines of an initialisation behind the parameters."""
        e, lines = self.e, list[str]()
        P = self.P
        sized = "(int)(sizeof {0} / sizeof {0}[0])"
        for word, present in (
            ("given_places", bool(e.named("given"))),
            ("flag_places", bool(e.options)),
            ("constant_places", any(p.constants is not None for p in self.model.parts)),
        ):
            if not present:
                continue
            bad = "*next != 0.0 && *next != 1.0" if word == "flag_places" else "*next != *next"
            lines += [
                f"for (int i = 0; i < {sized.format(word)}; i++, next++) {{",
                f"    if ({bad}) {{",
                f"        return {P}_BAD_VALUE;",
                "    }",
            ]
            if word == "flag_places":
                lines.append("    const bool on = *next != 0.0;")
                lines.append("    memcpy((char *)m + flag_places[i], &on, sizeof on);")
            else:
                lines.append(f"    put_at(m, {word}[i], *next);")
            lines.append("}")
        return _body(lines)

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
        lines = ["/* Terms of the equations that are on where their parameters are not 0. */",
                 f"static void switched({self.e.type} *m, int parameter)", "{"]  # fmt: skip
        if not cases:
            return "\n".join([*lines, "    (void)m;", "    (void)parameter;", "}", ""])
        lines.append("    switch (parameter) {")
        for line, numbers in cases.items():
            lines += [f"    case {number}:" for number in numbers]
            lines += [*indented([f"    {line}"]), "        break;"]
        return "\n".join([*lines, "    default:", "        break;", "    }", "}", ""])

    def finite(self) -> str:
        tests = [f"is_finite(m->now.{self.e.members[i]}.{path_of(path)})"
                 for i, path in self.model.places("state")]  # fmt: skip
        return "\n        && ".join(tests) or "true"

    def outputs(self) -> str:
        lines = []
        for name, read in zip(self.e.names, self.read, strict=True):
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

    def set_inputs(self) -> str:
        lines = []
        for name in self.e.measured:
            own = c_name(name)
            lines += [
                f"case {self.P}_INPUT_{own}:",
                f"    m->inputs.{own} = value;",
                f"    m->inputs.{own}_given = true;",
                f"    return {self.P}_OK;",
            ]
        return _body(lines)

    def clear_inputs(self) -> str:
        lines = []
        for name in self.e.measured:
            own = c_name(name)
            lines += [f"case {self.P}_INPUT_{own}:", f"    m->inputs.{own}_given = false;",
                      f"    return {self.P}_OK;"]  # fmt: skip
        return _body(lines)

    def set_options(self) -> str:
        lines = []
        for i, name in self.e.settable:
            place = f"m->{self.e.members[i]}_options.{c_name(name)}"
            lines += [
                f"case {self.P}_OPTION_{c_name(name)}:",
                f"    m->stale = m->stale || {place} != on;",
                f"    {place} = on;",
                f"    return {self.P}_OK;",
            ]
        return _body(lines)

    def get_options(self) -> str:
        lines = []
        for i, name in self.e.settable:
            lines += [f"case {self.P}_OPTION_{c_name(name)}:",
                      f"    return m->{self.e.members[i]}_options.{c_name(name)};"]  # fmt: skip
        return _body(lines)


def path_name(name: str) -> str:
    """A signal's name as part of one in an enum."""
    return c_name(name.replace(".", "_"))


def _body(lines: Sequence[str]) -> str:
    return "".join(f"{line}\n" for line in indented(lines))


def _enum(
    says: str, prefix: str, names: Sequence[str], count: str, *, bits: bool = False
) -> str:
    if not names and not count:
        return ""
    lines = [f"/* {says}. */", "enum {"]
    for i, name in enumerate(names):
        value = 1 << i if bits else i
        comma = "," if count or i + 1 < len(names) else ""
        lines.append(f"    {prefix}{path_name(name)} = {value}{comma}")
    lines += [f"    {count} = {len(names)}"] if count else []
    return "\n".join([*lines, "};"])
