"""A derived function: its text, and what came of it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from typing import Any

from swashplate.equations.equation import inlined, interpreted, remember_text
from swashplate.equations.program import Primitive, Program, leaves, path_of


@dataclass(frozen=True, eq=False)
class Derived:
    """A function that returns the values of an equation, then its partial derivatives.

    It takes the arguments of the equation and returns one flat tuple.

    Attributes
    ----------
    name : str
        Of the function.
    outputs, inputs : tuple of str
        Dotted paths of the wanted results and of what they are differentiated by.
    entries : tuple of (int, int)
        Numbers of output and input of each partial derivative that is not structurally zero, in
        the order in which they follow the values.
    source : str
        Text of the function.
    callees : tuple of Derived
        Those that it calls.
    own_names : dict
        What else its text refers to: equations, classes of named tuples, constants.
    """

    name: str
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    entries: tuple[tuple[int, int], ...]
    source: str
    callees: "tuple[Derived, ...]"
    own_names: dict[str, Any]

    @cached_property
    def texts(self) -> dict[str, str]:
        """Texts of all derived functions that are needed, callees first, by name."""
        out: dict[str, str] = {}
        for each in self.callees:
            out.update(each.texts)
        out[self.name] = self.source
        return out

    @cached_property
    def names(self) -> dict[str, Any]:
        """What the texts refer to beside each other, by name."""
        out: dict[str, Any] = {}
        for each in self.callees:
            out.update(each.names)
        return {**out, **self.own_names}

    @cached_property
    def python(self) -> Callable[..., tuple[Any, ...]]:
        """The function, as plain Python throughout."""
        space = {each.name: each.python for each in self.callees}
        for name, value in self.own_names.items():
            space[name] = interpreted(value)
        made: Callable[..., tuple[Any, ...]] = self._made(space)
        return made

    @cached_property
    def compiled(self) -> Any:
        """The function, compiled so that callers inline it."""
        space = {each.name: each.compiled for each in self.callees}
        return inlined(self._made({**space, **self.own_names}))

    def _made(self, space: dict[str, Any]) -> Any:
        file = remember_text(self.name, self.source)
        exec(compile(self.source, file, "exec"), space)
        return space[self.name]


# --- names in derived functions -------------------------------------------------------------------


def result_paths(program: Program | Primitive) -> tuple[str, ...]:
    """Dotted paths of a result's scalars; one without a name is "value"."""
    return tuple(p or "value" for p, _ in leaves(program.result))


def function_name(base: str, program: Any, inputs: tuple[str, ...], outputs: Any) -> str:
    """Name of a derived function: by what, and a short hash unless that says all."""
    last = [path.rpartition(".")[2] for path in inputs]
    label = "_".join(last)
    plainly = len(label) <= 32 and len(set(last)) == len(last) and "'" not in str(outputs)
    simple = plainly and all(s in ("float", "int") for s in getattr(program, "shapes", ("",)))
    if inputs and simple and outputs == tuple(range(len(result_paths(program)))):
        return f"{base}_by_{label}"
    said = repr((inputs, getattr(program, "shapes", program.arguments), outputs))
    digest = blake2b(said.encode(), digest_size=3).hexdigest()
    if not inputs:
        return f"{base}_decided_{digest}"
    return f"{base}_by_{label if plainly else len(inputs)}_{digest}"


def word(text: str) -> str:
    """A path as part of a name."""
    return path_of(text).replace(".", "_")


def listing(inputs: tuple[str, ...]) -> str:
    """Inputs, as far as one wants to read them."""
    return ", ".join(inputs) if len(inputs) <= 6 else f"{len(inputs)} inputs"
