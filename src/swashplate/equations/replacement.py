"""One equation of a model replaced by another, without a change to the model's own text.

Equations call each other by name, so a replacement needs new versions of all that lead to it: each
is the same function with other names around it. They are equations like any others, and everything
made of a model follows: derivatives, marches, batches, linear models, fits.
"""

from __future__ import annotations

import sys
from collections import namedtuple
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import cache
from importlib import import_module
from types import CellType, FunctionType, ModuleType
from typing import Any, NamedTuple, get_type_hints

from swashplate.equations.declaration import closure, equation, equation_of_text, is_function
from swashplate.equations.language import is_named_tuple, plain
from swashplate.equations.model import Equation, Model, arguments_of, join
from swashplate.errors import InputError


class Replacement(NamedTuple):
    """One's own equation in the place of a model's."""

    old: Equation
    new: Equation
    parameters: type[Any] | None = None
    """What it brings along, see `replaced`."""

    @property
    def places(self) -> dict[str, str]:
        """Where its members stand, as ``module:name``."""
        present = {name: plain(each) for name, each in self._asdict().items() if each is not None}
        return {name: f"{each.__module__}:{each.__qualname__}" for name, each in present.items()}

    def __reduce__(self) -> tuple[Any, ...]:
        # by name: another process must find the very equation that its model uses
        return _sent, (self.places,)


def _sent(places: Mapping[str, str]) -> Replacement:
    for place in places.values():
        import_module(place.partition(":")[0])
    return found_at(places)


OURS = "swashplate.models."
"""What the modules begin with that are imported to find an equation; all others must be already."""


def found_at(places: Mapping[str, str]) -> Replacement:
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
        if home is None and module.startswith(OURS):
            home = import_module(module)
        members[what] = vars(home).get(name) if isinstance(home, ModuleType) else None
        if members[what] is None:
            raise InputError(
                f"an equation of one's own is {name} of the module {module}: import that first."
            )
    check_members(members, places)
    return Replacement(**members)


def check_members(members: Mapping[str, Any], names: Mapping[str, str]) -> None:
    """Refuse a replacement whose members are no equations, or bring no named tuple along.

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
                f"{names[what]} is no equation: give a function marked with @equation."
            )
    parameters = members.get("parameters")
    if parameters is not None and not is_named_tuple(parameters):
        raise InputError(f"{names['parameters']} is no class of named tuples.")


def uses(model: Model, equation: Equation) -> bool:
    """Whether any of a model's equations is or calls this one."""
    return any(_leading(part, equation) for part in model.parts)


@cache
def as_called(model: Model, equation: Equation) -> Equation:
    """An equation as a model calls it: itself, or what stands in its place there."""
    name = plain(equation).__name__
    for part in model.parts:
        for each in part.equations:
            found = closure(each)
            if name in found:
                version: Equation = found[name]
                return version
    return equation


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
        Its replacement: the same arguments, and behind them, by name, any further parameters.
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
    parts = [_part(part, old, new, parameters) for part in model.parts]
    if all(part is own for part, own in zip(parts, model.parts, strict=True)):
        raise InputError(f"Model {model.name} does not use {plain(old).__name__}.")
    made = parts[0]
    if len(parts) > 1:
        made = join(
            model.name,
            *parts,
            links={name: link.equation for name, link in model.links.items() if link.equation},
            integrals=model.integrals,
            outputs=model.outputs,
            free_start=model.free_start,
        )
    object.__setattr__(made, "recipe", (again, (model, Replacement(old, new, parameters))))
    return made


@cache
def again(model: Model, made: Replacement) -> Model:
    """What `replaced` gives, once in a process."""
    return replaced(model, *made)


def _part(part: Model, old: Equation, new: Equation, parameters: Any) -> Model:
    """A part with the replacement, itself if it does not use the equation."""
    leading = _leading(part, old)
    if not leading:
        return part
    own: Any = part.parameters
    kind = _extended(own, parameters) if parameters else own
    names = {part.parameters.__name__: kind}
    made = {plain(old): _called_like(old, new, part.name, kind)}
    rebuilt = {name: _rebuilt(each, old, made, names) for name, each in leading.items()}
    return replace(part, parts=(), parameters=kind, **rebuilt)


def _leading(part: Model, old: Equation) -> dict[str, Equation]:
    """Equations of a part that are another one, or call it, by the part's fields."""
    found = {each.name: getattr(part, each.name) for each in fields(part)}
    return {name: each for name, each in found.items() if _reaches(each, old)}


def _reaches(function: Any, old: Equation) -> bool:
    known = closure(function).values() if is_function(function) else ()
    return any(plain(each) is plain(old) for each in known)


@cache
def _extended(kind: Any, more: Any) -> type[Any]:
    """A class of named tuples with the fields of two."""
    hints: dict[str, Any] = {}
    defaults: dict[str, Any] = {}
    for each in (kind, more):
        twice = sorted(set(hints) & set(each._fields))
        if twice:
            raise InputError(f"{kind.__name__} has a parameter {twice[0]} already.")
        hints |= get_type_hints(each, include_extras=True)
        defaults |= each._field_defaults
    bare = [name for name in more._fields if name not in more._field_defaults]
    if bare:
        raise InputError(f"{more.__name__}.{bare[0]} needs a default: old numbers lack it.")
    order = sorted(hints, key=lambda name: name in defaults)
    make: Any = namedtuple
    made = make(kind.__name__, order, defaults=[defaults[n] for n in order if n in defaults])
    made.__annotations__ = {name: hints[name] for name in order}
    made.__module__ = more.__module__
    return made  # type: ignore[no-any-return]


def _called_like(old: Equation, new: Equation, part: str, kind: type[Any]) -> Equation:
    """The new equation with the arguments of the old one."""
    taken, wanted = arguments_of(old), arguments_of(new)
    name = plain(old).__name__
    if wanted[: len(taken)] != taken:
        raise InputError(
            f"{plain(new).__name__} must begin with the arguments of {name}: {', '.join(taken)}."
        )
    more = wanted[len(taken) :]
    if not more:
        return new
    unknown = [each for each in more if each not in kind._fields]
    if unknown:
        raise InputError(f"{plain(new).__name__} asks for {unknown[0]}, no parameter of {part}.")
    if "p" not in taken:
        raise InputError(
            f"{name} does not take the parameters p, so {plain(new).__name__} cannot have "
            f"{more[0]}; replace an equation that calls it and takes p."
        )
    hints = get_type_hints(plain(old)) | {"p": kind}
    names: dict[str, Any] = {f"Type_{each}": hints[each] for each in (*taken, "return")}
    arguments = ", ".join(f"{each}: Type_{each}" for each in taken)
    passed = ", ".join((*taken, *(f"p.{each}" for each in more)))
    text = f"def {name}({arguments}) -> Type_return:\n    return own_equation({passed})\n"
    return equation_of_text(text, name, names | {"own_equation": new})  # type: ignore[no-any-return]


def _rebuilt(function: Any, old: Equation, made: dict[Any, Any], names: Mapping[str, Any]) -> Any:
    """Anything, and a function that leads to the old equation leading to the new one."""
    f: Any = plain(function)
    if not _reaches(function, old):
        return function
    if f not in made:
        space = {**f.__globals__, **{k: v for k, v in names.items() if k in f.__globals__}}
        called = [name for name in f.__code__.co_names if name in f.__globals__]
        space |= {n: _rebuilt(f.__globals__[n], old, made, names) for n in called if n not in names}
        inner = [_rebuilt(each.cell_contents, old, made, names) for each in f.__closure__ or ()]
        cells = tuple(map(CellType, inner)) or None
        copy = FunctionType(f.__code__, space, f.__name__, f.__defaults__, cells)
        copy.__kwdefaults__, copy.__module__ = f.__kwdefaults__, f.__module__
        copy.__annotations__ = {
            key: names.get(each.__name__, each) if is_named_tuple(each) else each
            for key, each in f.__annotations__.items()
        }
        copy.__doc__, copy.__qualname__ = f.__doc__, f.__qualname__
        made[f] = equation(copy)
    return made[f]
