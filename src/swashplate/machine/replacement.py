"""One equation of a model replaced by another, without a change to the model's own text.

A model says which equations stand for which. Whatever runs its equations, on symbols or on numbers,
looks there whenever one is called, so that everything made of a model follows: derivatives,
marches, batches, linear models, fits, C.
"""

from __future__ import annotations

import operator
import sys
from collections import namedtuple
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple, get_type_hints

from swashplate.errors import InputError
from swashplate.machine.declaration import (
    Replacements,
    equation_of_text,
    functions_run,
    is_function,
)
from swashplate.machine.joining import join
from swashplate.machine.language import is_named_tuple
from swashplate.machine.model import Equation, Model, arguments_of


class Replacement(NamedTuple):
    """A user-defined equation in place of a model's."""

    old: Equation
    new: Equation
    parameters: type[Any] | None = None
    """What it brings along, see `replaced`."""

    @property
    def places(self) -> dict[str, str]:
        """Where its members stand, as ``module:name``."""
        present = {name: member for name, member in self._asdict().items() if member is not None}
        return {
            name: f"{member.__module__}:{member.__qualname__}" for name, member in present.items()
        }

    def __reduce__(self) -> tuple[Any, ...]:
        # by name: another process must find the very equation that its model uses
        return _sent, (self.places,)


def _sent(places: Mapping[str, str]) -> Replacement:
    for place in places.values():
        import_module(place.partition(":")[0])
    return replacement_at(places)


PACKAGE_MODELS = "swashplate.models."
"""What the modules begin with that are imported to find an equation; all others must be already."""


def replacement_at(places: Mapping[str, str]) -> Replacement:
    """A replacement by `Replacement.places`, each ``module:name``.

    No code runs: modules of the package's models apart, a module must be imported already.

    Raises
    ------
    InputError
        If there is no such module, or what it has of that name is no equation, or no class of named
        tuples. Nothing of the object is in the sentence.
    """
    members: dict[str, Any] = {}
    for what, place in places.items():
        module, _, name = place.partition(":")
        home = sys.modules.get(module)
        if home is None and module.startswith(PACKAGE_MODELS):
            home = import_module(module)
        members[what] = vars(home).get(name) if isinstance(home, ModuleType) else None
        if members[what] is None:
            raise InputError(
                f"a user-defined equation is {name} of the module {module}: import that first."
            )
    check_members(members, places)
    return Replacement(**members)


def check_members(members: Mapping[str, Any], names: Mapping[str, str]) -> None:
    """Refuse a replacement whose members are not equations, or have no named tuple.

    Parameters
    ----------
    members : mapping of str to object
        By the fields of `Replacement`; None for parameters that are not given.
    names : mapping of str to str
        What the sentence calls them.
    """
    for what in ("old", "new"):
        if not is_function(members[what]):
            raise InputError(
                f"{names[what]} is not an equation: give a function marked with @equation."
            )
    parameters = members.get("parameters")
    if parameters is not None and not is_named_tuple(parameters):
        raise InputError(f"{names['parameters']} is not a class of named tuples.")


def uses_equation(model: Model, equation: Equation) -> bool:
    """Whether any of a model's equations is or calls this one."""
    parts = any(_calls(part.equations, part.replacements, equation) for part in model.parts)
    return parts or _calls(_link_equations(model).values(), model.replacements, equation)


def _link_equations(model: Model) -> dict[str, Equation]:
    """Equations over the signals of several parts, by the signals that they make."""
    return {name: link.equation for name, link in model.links.items() if link.equation}


def _calls(equations: Iterable[Equation], replacements: Replacements, equation: Equation) -> bool:
    """Whether any of some equations is or calls another one."""
    return equation in functions_run(equations, replacements)


def replaced(
    model: Model, old: Equation, new: Equation, parameters: type[Any] | None = None
) -> Model:
    """A model in which one equation stands for another wherever that is called.

    Parameters
    ----------
    model : Model
        A single model, or a joined one.
    old : equation
        One that the model uses.
    new : equation
        Its replacement: the same arguments, and after them, by name, any further parameters.
    parameters : class of named tuples, optional
        Parameters that the model gets in addition, each a float with its `Definition` and a
        default.

    Returns
    -------
    Model
        A new one; the old one is as it was.

    Raises
    ------
    InputError
        If the model does not use the equation, or the arguments do not fit.
    """
    replacement = Replacement(old, new, parameters)
    if not uses_equation(model, old):
        raise InputError(f"Model {model.name} does not use {old.__name__}.")
    parts = [_part(part, replacement) for part in model.parts]
    if not model.is_joined:
        return parts[0]
    links, replacements = _link_equations(model), model.replacements
    if parameters is not None and all(map(operator.is_, parts, model.parts)):
        raise InputError(
            f"{old.__name__} is an equation of a link between models, which has no "
            "parameters: its replacement must take the same arguments and cannot add any."
        )
    if _calls(links.values(), replacements, old):
        in_links = _called_like(old, new, model.name, model.parameters)
        replacements = _with(replacements, old, in_links)
    wires = {
        name: (link.equation, *(model.parts[part].full(signal) for part, signal in link.sources))
        for name, link in model.links.items()
    }
    return join(
        model.name,
        *parts,
        links=wires,
        integrals=model.integrals,
        outputs=model.outputs,
        free_start=model.free_start,
        replacements=replacements,
        recipe=(replaced_once, (model, replacement)),
    )


@cache
def replaced_once(model: Model, replacement: Replacement) -> Model:
    """What `replaced` gives, once in a process."""
    return replaced(
        model,
        replacement.old,
        replacement.new,
        replacement.parameters,
    )


def _part(part: Model, replacement: Replacement) -> Model:
    """A part with the replacement, itself if it does not use the equation."""
    if not _calls(part.equations, part.replacements, replacement.old):
        return part
    kind: Any = part.parameters
    if replacement.parameters is not None:
        further: Any = replacement.parameters
        kind = _extended(kind, further)
    new = _called_like(replacement.old, replacement.new, part.name, kind)
    changes: dict[str, Any] = {
        field.name: new for field in fields(part) if getattr(part, field.name) is replacement.old
    }
    changes["replacements"] = _with(part.replacements, replacement.old, new)
    changes["recipe"] = replaced_once, (part, replacement)
    return replace(part, parts=(), parameters=kind, **changes)


def _with(replacements: Replacements, old: Equation, new: Equation) -> Replacements:
    """Replacements with one more, also in the place of what already stands for another."""
    chains = {
        equation: tuple(new if stands is old else stands for stands in chain)
        for equation, chain in replacements.items()
    }
    chains[old] = (*chains.get(old, ()), new)
    return chains


@cache
def _extended(kind: Any, further: Any) -> type[Any]:
    """A class of named tuples with the fields of two."""
    hints: dict[str, Any] = {}
    defaults: dict[str, Any] = {}
    for part in (kind, further):
        twice = sorted(set(hints) & set(part._fields))
        if twice:
            raise InputError(f"{kind.__name__} has a parameter {twice[0]} already.")
        hints |= get_type_hints(part, include_extras=True)
        defaults |= part._field_defaults
    bare = [name for name in further._fields if name not in further._field_defaults]
    if bare:
        raise InputError(
            f"{further.__name__}.{bare[0]} needs a default: existing parameter sets lack it."
        )
    order = sorted(hints, key=lambda name: name in defaults)
    make: Any = namedtuple
    extended = make(
        kind.__name__, order, defaults=[defaults[name] for name in order if name in defaults]
    )
    extended.__annotations__ = {name: hints[name] for name in order}
    extended.__module__ = further.__module__
    return extended  # type: ignore[no-any-return]


def _called_like(old: Equation, new: Equation, part: str, kind: type[Any]) -> Equation:
    """The new equation with the arguments of the old one."""
    taken = arguments_of(old)
    requested = arguments_of(new)
    name = old.__name__
    if requested[: len(taken)] != taken:
        raise InputError(
            f"{new.__name__} must begin with the arguments of {name}: {', '.join(taken)}."
        )
    further = requested[len(taken) :]
    if not further:
        return new
    unknown = [path for path in further if path not in kind._fields]
    if unknown:
        raise InputError(f"{new.__name__} needs {unknown[0]}, which is not a parameter of {part}.")
    if "p" not in taken:
        raise InputError(
            f"{name} does not take the parameters p, so {new.__name__} cannot have "
            f"{further[0]}; replace an equation that calls it and takes p."
        )
    hints = get_type_hints(old) | {"p": kind}
    names: dict[str, Any] = {f"Type_{argument}": hints[argument] for argument in (*taken, "return")}
    arguments = ", ".join(f"{argument}: Type_{argument}" for argument in taken)
    passed = ", ".join((*taken, *(f"p.{path}" for path in further)))
    text = f"def {name}({arguments}) -> Type_return:\n    return own_equation({passed})\n"
    return equation_of_text(text, name, names | {"own_equation": new})  # type: ignore[no-any-return]
