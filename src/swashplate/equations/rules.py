"""Derivatives of what is known by a rule: declared functions, roots, tables, loops."""

from collections.abc import Callable
from typing import Any

from swashplate.equations import expressions as ex
from swashplate.equations.derived import Derived, function_name, listing, result_paths, word
from swashplate.equations.equation import module_of
from swashplate.equations.primitives import blank, hat, located
from swashplate.equations.program import Primitive, Program, Tuple, floats, paths, rebuilt
from swashplate.equations.writing import Call, Names, Region, Result, call_text, written

Derive = Callable[[Any, tuple[str, ...]], Derived]


def of_rule(program: Program, inputs: tuple[str, ...], outputs: tuple[int, ...]) -> Derived:
    """An equation whose derivatives are declared."""
    by, known = floats(program), result_paths(program)
    names = Names(program)
    function = names.of(program.function, program.source.name)
    rule = names.of(program.rule, f"{function}_rule")
    name = function_name(function, program, inputs, outputs)
    names.taken.add(name)
    entries, slopes = [], []
    targets = ["_"] * (len(by) * len(known))
    for o, out in enumerate(outputs):
        for i, path in enumerate(inputs):
            if path in program.moving[out]:
                label = "" if len(known) == 1 else known[out].replace(".", "_") + "_"
                slope = names.fresh(f"d_{label}{word(path)}")
                targets[out * len(by) + by.index(path)] = slope
                entries.append((o, i))
                slopes.append(ex.name(slope))
    results = [names.fresh(p.replace(".", "_")) for p in known]
    arguments = tuple(v for _, v in program.arguments)
    shown = rebuilt(program.result, iter([ex.name(r) for r in results]))
    alone = ex.name(targets[0]) if len(targets) == 1 else None
    region = Region()
    region.add(Call(function, (), arguments, shown, []))
    region.add(Call(rule, (), arguments, alone, targets))
    region.add(Result([ex.name(results[o]) for o in outputs] + slopes))
    says = f"{program.source.name} with its declared derivatives by {listing(inputs)}"
    where = f"{module_of(program.source.function)}, line {program.source.node.lineno}"
    source = written(name, program, region, names, says, where)
    wanted = tuple(known[o] for o in outputs)
    return Derived(name, wanted, inputs, tuple(entries), source, (), names.objects())


def of_root(primitive: Primitive, inputs: tuple[str, ...], derive: Derive) -> Derived:
    """A root: the implicit function theorem within the bracket, its ends at the ends."""
    residual = primitive.inner
    assert residual is not None
    x = residual.arguments[0][0]
    (low, _), (high, _), *rest = primitive.arguments
    by = (x, *(p for p in inputs if p not in (low, high)))
    inner = derive(residual, by)
    names = Names(primitive)
    function = names.of(primitive.function, "root")
    its = names.inner(primitive)
    assert its is not None
    name = function_name(f"root_of_{its}", primitive, inputs, (0,))
    x = names.fresh(x if x != "value" else "x")
    partials = {i: names.fresh(f"r_{word(inner.inputs[i])}") for _, i in inner.entries}
    given = [n for n, _ in rest]
    lines = [
        f"{x} = {call_text(function, [its, low, high, *given])}",
        f"_, {', '.join(partials.values())} = {call_text(inner.name, [x, *given])}",
        f"inside = {low} < {x} < {high}",
    ]
    if 0 not in partials:
        residual.source.refuse(None, f"no derivative by {by[0]}", "use the unknown in it")
    slope = partials[0]
    infinite = names.of(float("inf"), "inf")
    lines.append(f"inverse = 1.0 / ({slope} if inside and {slope} != 0.0 else {infinite})")
    entries, values = [], []
    for i, path in enumerate(inputs):
        if path == low:
            values.append(f"1.0 if {x} <= {low} else 0.0")
        elif path == high:
            values.append(f"1.0 if {x} >= {high} else 0.0")
        elif by.index(path) in partials:
            values.append(f"-{partials[by.index(path)]} * inverse if inside else 0.0")
        else:
            continue
        entries.append((0, i))
    lines += [f"d_{word(inputs[i])} = {v}" for (_, i), v in zip(entries, values, strict=True)]
    back = ", ".join([x, *(f"d_{word(inputs[i])}" for _, i in entries)])
    says = f"Root of {residual.source.name} with its derivatives by {listing(inputs)}"
    source = "\n".join(
        [
            f"def {name}({', '.join([low, high, *given])}):",
            f'    """{says}."""',
            *(f"    {line}" for line in lines),
            f"    return {back}\n",
        ]
    )
    return Derived(name, ("value",), inputs, tuple(entries), source, (inner,), names.references)


def of_repeated(primitive: Primitive, inputs: tuple[str, ...], derive: Derive) -> Derived:
    """A loop: the derivatives of the state by every input, carried along step by step."""
    step = primitive.inner
    assert step is not None
    count, state, *rest = (name for name, _ in primitive.arguments)
    structure = dict(primitive.arguments)[state]
    assert isinstance(structure, Tuple)
    own, width = paths(state, structure), len(inputs)
    inner = derive(step, (*own, *(p for p in inputs if p not in own)))
    names = Names(primitive)
    name = function_name(f"repeated_{step.source.name}", primitive, inputs, range(len(own)))
    cls, empty = names.of(structure.cls, structure.cls.__name__), names.of(blank, "blank")
    slopes, number, c = (names.fresh(each) for each in ("slopes", "number", "c"))
    now = [names.fresh(field) for field in structure.fields]
    new = [names.fresh(f"new_{field}") for field in structure.fields]
    before = [names.fresh(f"by_{field}") for field in structure.fields]
    partials = [names.fresh(f"d_{new[o]}_{word(inner.inputs[i])}") for o, i in inner.entries]
    carried, direct = [list[str]() for _ in own], []
    for partial, (o, i) in zip(partials, inner.entries, strict=True):
        if inner.inputs[i] in own:
            carried[o].append(f"{partial} * {before[own.index(inner.inputs[i])]}")
        if inner.inputs[i] in inputs and inner.inputs[i] not in own:
            direct.append(f"{slopes}[{o * width + inputs.index(inner.inputs[i])}] += {partial}")
    arguments = [f"{cls}({', '.join(now)})", f"float({number})", *rest]
    body = [
        f"{', '.join([*new, *partials])}, = {call_text(inner.name, arguments)}",
        f"for {c} in range({width}):",
        *(f"    {each} = {slopes}[{k * width} + {c}]" for k, each in enumerate(before)),
        *(
            f"    {slopes}[{k * width} + {c}] = {' + '.join(terms) or '0.0'}"
            for k, terms in enumerate(carried)
        ),
        *direct,
        f"{', '.join(now)} = {', '.join(new)}",
    ]
    entries = [
        (o, i)
        for o, followed in enumerate(primitive.moving)
        for i, path in enumerate(inputs)
        if path in followed
    ]
    back = [*now, *(f"{slopes}[{o * width + i}]" for o, i in entries)]
    lines = [
        f"{', '.join(now)}, = {state}",
        f"{slopes} = {call_text(empty, [str(len(own) * width)])}",
        *(
            f"{slopes}[{k * width + inputs.index(path)}] = 1.0"
            for k, path in enumerate(own)
            if path in inputs
        ),
        f"for {number} in range(int({count})):",
        *(f"    {line}" for line in body),
        f"return {', '.join(back)}",
    ]
    says = f"{step.source.name}, repeated, with its derivatives by {listing(inputs)}"
    source = "\n".join(
        [
            f"def {name}({', '.join([count, state, *rest])}):",
            f'    """{says}."""',
            *(f"    {line}" for line in lines),
            "",
        ]
    )
    outputs = tuple(path.rpartition(".")[2] for path in own)
    return Derived(name, outputs, inputs, tuple(entries), source, (inner,), names.references)


def of_table(primitive: Primitive, inputs: tuple[str, ...]) -> Derived:
    """A table: slope of the segment, and hat functions for its values."""
    names = Names(primitive)
    find, weight = names.of(located, "located"), names.of(hat, "hat")
    knots = primitive.arguments[1][1]
    assert isinstance(knots, Tuple)
    count = len(knots.items)
    name = function_name(f"interpolate_{count}", primitive, inputs, (0,))
    values = []
    for path in inputs:
        part = f"{weight}(at, share, {path.rpartition('.')[2]})"
        values.append(
            "slope" if path == "x" else part if path.startswith("values") else f"-slope * {part}"
        )
    source = "\n".join(
        [
            f"def {name}(x, knots, values):",
            f'    """Table of {count} knots with its derivatives by {listing(inputs)}."""',
            f"    value, slope, at, share = {find}(x, knots, values)",
            "    return (",
            "        value,",
            *(f"        {v}," for v in values),
            "    )\n",
        ]
    )
    entries = tuple((0, i) for i in range(len(inputs)))
    return Derived(name, ("value",), inputs, entries, source, (), names.references)
