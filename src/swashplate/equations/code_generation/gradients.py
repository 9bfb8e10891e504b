"""Derivatives of what equations say: adjoints, carried backwards over their graph.

What a result follows nowhere is a structural zero: it has no entry.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from swashplate.equations import graph
from swashplate.equations.code_generation.functions import FUNCTIONS, Function
from swashplate.equations.code_generation.printing import function_text, named_by_text
from swashplate.equations.code_generation.slopes import (
    OF_ITSELF,
    Contribution,
    Slopes,
    total_of,
)
from swashplate.equations.graph import ZERO, Node, times
from swashplate.errors import EquationError


@dataclass(frozen=True, eq=False, repr=False)
class Derived(Function):
    """A function that returns the values of an equation, then its partial derivatives.

    It takes the arguments of the equation and returns one flat tuple.

    Attributes
    ----------
    outputs, inputs : tuple of str
        Dotted paths of the wanted results and of what they are differentiated by.
    entries : tuple of (int, int)
        Numbers of output and input of each partial derivative that is not structurally zero, in
        the order in which they follow the values.
    """

    outputs: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    entries: tuple[tuple[int, int], ...] = ()


def derived_function(
    name: str,
    docstring: str,
    formals: Sequence[str],
    results: Sequence[tuple[str, Node]],
    by: Sequence[tuple[str, str]],
    labels: Mapping[Node, str],
    *,
    chained: bool = False,
) -> Derived:
    """The function of some results with their derivatives.

    `formals` are its arguments, `results` paths and nodes of what is returned, `by` paths and names
    of what that is differentiated by; `name` may have `UNNAMED` in it.
    """
    values = [node for _, node in results]
    gradients = Gradients(values, [graph.name(argument) for _, argument in by], chained=chained)
    outputs = tuple(path for path, _ in results)
    inputs = tuple(path for path, _ in by)
    hints = {**labels, **gradients.hints(outputs, inputs, labels)}
    text, functions = function_text(
        name,
        docstring,
        formals,
        [*gradients.values, *gradients.partials.values()],
        hints,
        always_tuple=True,
    )
    for argument in formals:
        if argument in FUNCTIONS and re.search(rf"\b{argument}\(", text):
            raise EquationError(
                f"An argument is called {argument}, and so is the function that its derivatives "
                "need: give the argument another name."
            )
    entries = tuple(gradients.partials)
    return Derived(*named_by_text(name, text), dict(functions), outputs, inputs, entries)


def partials_of(
    results: Sequence[Node], by: Sequence[Node], *, chained: bool = False
) -> dict[tuple[int, int], Node]:
    """Partial derivatives of results by some nodes that are not structurally zero.

    By the indices of result and node; see `Gradients`.
    """
    return Gradients(results, by, chained=chained).partials


class Gradients:
    """Derivatives of results with respect to some nodes, whose own operands count as given.

    By adjoints, backwards. With `chained`, if one result depends on another, the sweep ends at that
    one and goes on with its derivatives.

    Attributes
    ----------
    values : list of Node
        The results again: calls in them give their derivatives as well.
    partials : dict of (int, int) to Node
        By the indices of result and node, in their order.
    adjoints : list of dict of Node to Node
        Of each result, the derivatives by all that it follows.
    """

    def __init__(
        self, results: Sequence[Node], by: Sequence[Node], *, chained: bool = False
    ) -> None:
        self._by = dict.fromkeys(by)
        self._slopes = Slopes(results, by)
        order_of = {node: index for index, node in enumerate(self._slopes.order)}
        self._links: dict[Node, dict[Node, Node]] = {}
        self.adjoints: list[dict[Node, Node]] = [{} for _ in results]
        # a result that others follow comes first: their adjoints end at it
        for index in sorted(range(len(results)), key=lambda index: order_of[results[index]]):
            self.adjoints[index] = self._swept(results[index])
            if chained and results[index] not in self._by:
                self._links.setdefault(results[index], self.adjoints[index])
        entries = [
            (result, argument)
            for result in range(len(results))
            for argument, node in enumerate(by)
            if self.adjoints[result].get(node, ZERO) is not ZERO
        ]
        partials = [self.adjoints[result][by[argument]] for result, argument in entries]
        nodes = graph.rewritten([*results, *partials], self._slopes.calls)
        self.values = nodes[: len(results)]
        self.partials = dict(zip(entries, nodes[len(results) :], strict=True))

    def hints(
        self, outputs: Sequence[str], inputs: Sequence[str], labels: Mapping[Node, str]
    ) -> dict[Node, str]:
        """Names for derivatives, should they need one."""
        names: dict[Node, str] = {}
        computed = {*self._slopes.order}
        for (result, argument), node in self.partials.items():
            label = "" if len(outputs) == 1 else f"{word(outputs[result])}_"
            if node not in computed:
                names.setdefault(node, f"d_{label}{word(inputs[argument])}")
        for result, pending in enumerate(self.adjoints):
            label = "" if len(outputs) == 1 else f"{word(outputs[result])}_"
            for node, contribution in pending.items():
                name = labels.get(graph.plain_value(node))
                if name and contribution not in computed:
                    names.setdefault(contribution, f"d_{label}{name}")
        return names

    # -- backward ----------------------------------------------------------------------------------

    def _swept(self, result: Node) -> dict[Node, Node]:
        """Derivatives of a result by all that it follows."""
        if result in self._links:
            return self._links[result]
        pending: dict[Node, list[Contribution]] = {result: [OF_ITSELF]}
        adjoints: dict[Node, Node] = {}
        for node in reversed(self._slopes.order):
            if node not in pending or node not in self._slopes.active:
                continue
            total = total_of(pending.pop(node))
            adjoints[node] = total.zero_elsewhere
            if adjoints[node] is ZERO or node in self._by:
                continue
            for below, contribution in self._contributions(node, total):
                pending.setdefault(below, []).append(contribution)
        return adjoints

    def _contributions(
        self, node: Node, total: Contribution
    ) -> Iterator[tuple[Node, Contribution]]:
        """What an adjoint gives on, with the nodes that it goes to."""
        if node in self._links:
            for below, slope in self._links[node].items():
                if below in self._by:
                    yield below, Contribution(total.test, times(total.amount, slope), masked=False)
            return
        for operand, contribution in self._slopes.pushed(node, total):
            if contribution.amount is not ZERO:
                yield operand, contribution


def word(path: str) -> str:
    """A path as part of a name."""
    return path.replace(".", "_").replace("[", "_").replace("]", "")


def listed(inputs: Sequence[str]) -> str:
    """Inputs, as far as one wants to read them."""
    return ", ".join(inputs) if len(inputs) <= 6 else f"{len(inputs)} inputs"
