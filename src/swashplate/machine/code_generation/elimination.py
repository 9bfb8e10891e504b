"""Which nodes of a graph carry derivatives, and the partial derivatives between them.

Nodes that move are vertices, partial derivatives are edges. To eliminate a vertex is to multiply
the edges into it with those out of it: scalars, once a sample. A vertex that is kept carries a
vector, the derivatives by all columns. From the results back to the sources, as adjoints go, a
vertex is eliminated if that costs less than to keep it; so one rule gives adjoints where few
results follow much, and node by node where all follows all (A. Griewank, A. Walther: Evaluating
Derivatives, 2nd ed., SIAM 2008, ch. 9).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Literal

from swashplate.machine.code_generation.slopes import Contribution, Slopes, total_of
from swashplate.machine.graph import ONE, TRUE, ZERO, Node, both, times

SIDE_BY_SIDE = 8
"""Columns that are carried side by side in one instruction, or in two or four."""
SCALAR = 0.5
"""Cost of an operation on one number, of which several are done at once, beside one on a vector."""
LITERAL = 0.6
"""Cost of an edge that is a literal number, beside a product and a sum of vectors."""


class Elimination:
    """Vertices that stay, and the edges between them.

    Parameters
    ----------
    results : sequence of Node
        What is differentiated; they stay.
    sources : sequence of Node
        What carries derivatives from before, such as states.
    columns : sequence of Node
        Names that results are differentiated by.
    count : int
        How many derivatives a vertex carries.
    stands_for : mapping of Node to Node
        Nodes that names stand for.
    keep : {"cheaper", "all", "results"}
        What stays of the others: what is cheaper to keep, all of them as a reference, or none.

    Attributes
    ----------
    edges : dict of Node to dict of Node to Contribution
        Of each vertex that stays, after those that it follows, its derivatives by these, by sources
        and by columns.
    """

    def __init__(
        self,
        results: Sequence[Node],
        sources: Sequence[Node],
        columns: Sequence[Node],
        count: int,
        stands_for: Mapping[Node, Node] = MappingProxyType({}),
        keep: Literal["cheaper", "all", "results"] = "cheaper",
    ) -> None:
        self._vectors = -(-count // SIDE_BY_SIDE)
        self._columns = dict.fromkeys(columns)
        self._slopes = Slopes(results, [*sources, *columns], stands_for)
        given = {*sources, *columns}
        self._vertices = [
            node for node in self._slopes.order if node in self._slopes.active and node not in given
        ]
        self.edges: dict[Node, dict[Node, Contribution]] = {}
        self._out: dict[Node, dict[Node, None]] = {node: {} for node in self._slopes.active}
        for node in self._vertices:
            arriving: dict[Node, list[Contribution]] = {}
            for operand, contribution in self._slopes.of(node):
                arriving.setdefault(operand, []).append(contribution)
            self.edges[node] = {
                operand: total_of(contributions) for operand, contributions in arriving.items()
            }
            for operand in arriving:
                self._out[operand][node] = None
        wanted = {*results}
        self._inner = [node for node in reversed(self._vertices) if node not in wanted]
        for node in self._inner:  # from the results back: what none of them follows
            if not self._out[node]:
                self._drop(node)
        if keep == "cheaper":
            self._eliminate_dearer()
        elif keep == "results":
            for node in reversed(self._vertices):
                if node in self.edges:
                    self._pass_by(node)
                    if node not in wanted:
                        self._drop(node)

    def _drop(self, node: Node) -> None:
        for operand in self.edges.pop(node):
            del self._out[operand][node]

    def _eliminate_dearer(self) -> None:
        """Eliminate what is dearer to keep, until nothing changes."""
        before = None
        while before != len(self.edges):
            before = len(self.edges)
            for node in self._inner:
                if node in self.edges and self._gain(node) >= 0.0:
                    self._pass_by(node)
                    self._drop(node)

    def _pass_by(self, node: Node) -> None:
        """Replace what follows a vertex by ways to all that it follows itself."""
        within = self.edges[node]
        for later in self._out[node]:
            edges = self.edges[later]
            outer = edges.pop(node)
            for operand, inner in within.items():
                way = self._chained(outer, inner)
                if way.amount is ZERO:
                    continue
                edges[operand] = total_of([edges[operand], way]) if operand in edges else way
                self._out[operand][later] = None
        self._out[node] = {}

    def _chained(self, outer: Contribution, inner: Contribution) -> Contribution:
        """The derivative by way of a vertex."""
        masked = all(
            one.test is TRUE or (one.masked and self._slopes.stays_finite(other.amount))
            for one, other in ((outer, inner), (inner, outer))
        )
        amount = times(outer.amount, inner.amount)
        return Contribution(both(outer.test, inner.test), amount, masked)

    # -- cost --------------------------------------------------------------------------------------

    def _gain(self, node: Node) -> float:
        """What the elimination of a vertex saves, in operations on vectors."""
        within = self.edges[node]
        gain = sum(self._cost(operand, inner.amount) for operand, inner in within.items())
        if any(operand in self._columns for operand in within):
            gain += self._vectors
        for later in self._out[node]:
            edges = self.edges[later]
            outer = edges[node].amount
            gain += self._cost(node, outer)
            for operand, inner in within.items():
                literal = inner.amount.op == "number" or outer.op == "number"
                product = outer if inner.amount.op == "number" else inner.amount
                if not literal:
                    gain -= SCALAR
                if operand in edges:
                    sum_ = inner.amount if outer.op == "number" else outer
                    gain -= SCALAR
                    gain -= self._cost(operand, sum_)
                    gain += self._cost(operand, edges[operand].amount)
                else:
                    gain -= self._cost(operand, product)
        return gain

    def _cost(self, operand: Node, amount: Node) -> float:
        """Of an edge that stays: a number that is stored, a product and a sum of vectors."""
        if operand in self._columns:
            return 0.0 if amount.op == "number" else SCALAR
        if amount.op == "number":
            return LITERAL * self._vectors
        return self._vectors + 2.0 * SCALAR


def partials_of(results: Sequence[Node], by: Sequence[Node]) -> dict[tuple[int, int], Node]:
    """Partial derivatives of results by some nodes that are not structurally zero.

    By the indices of result and node.
    """
    edges = Elimination(results, (), by, len(by), keep="results").edges
    number_of = {node: number for number, node in enumerate(by)}
    partials = dict[tuple[int, int], Node]()
    for number, result in enumerate(results):
        if result in number_of:
            partials[number, number_of[result]] = ONE
        for node, contribution in edges.get(result, {}).items():
            amount = contribution.zero_elsewhere
            if amount is not ZERO:
                partials[number, number_of[node]] = amount
    return dict(sorted(partials.items()))
