"""Derivatives of functions that are known by their rule: declared ones, roots, tables."""

from collections.abc import Callable
from typing import Any

from swashplate.equations import expressions as ex
from swashplate.equations.derived import Derived, function_name, listing, result_paths, word
from swashplate.equations.equation import module_of
from swashplate.equations.primitives import hat, located
from swashplate.equations.program import Primitive, Program, Tuple, floats, rebuilt
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
    residual = primitive.residual
    assert residual is not None
    x = residual.arguments[0][0]
    (low, _), (high, _), *rest = primitive.arguments
    by = (x, *(p for p in inputs if p not in (low, high)))
    inner = derive(residual, by)
    names = Names(primitive)
    function = names.of(primitive.function, "root")
    its = names.residual(primitive)
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
