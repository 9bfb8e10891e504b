"""Where each node of a graph is computed: as seldom as the branches allow.

A choice between two values becomes a branch, in which what only one side needs is computed, unless
it costs less to compute both. Choices of one test that do not wait for each other share a branch.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from heapq import heappop, heappush

from swashplate.machine.graph import CHEAP, LEAVES, Node, ordered

FEW = 8
"""Most operations that are computed without need instead of a branch."""


class Region:
    """What is computed together: the whole, or one side of a branch."""

    def __init__(self, branch: Conditional | None = None, side: int = 0) -> None:
        self.branch, self.side = branch, side
        self.enclosing: tuple[Region, ...] = (self,)
        """The region and those that it lies in, the innermost first."""
        if branch is not None:
            self.enclosing = (self, *branch.region.enclosing)
        self.nodes: list[Node] = []
        self.branches: list[Conditional] = []

    @property
    def earlier(self) -> Iterator[Region]:
        """Sides of earlier branches that are taken whenever this one is."""
        if self.branch is not None:
            for branch in self.branch.region.branches:
                if branch.test is self.branch.test and branch.depth < self.branch.depth:
                    yield branch.sides[self.side]


class Conditional:
    """An `if` with its `else`, and the choices that get their values in it.

    Attributes
    ----------
    test : Node
        What decides.
    depth : int
        How many branches it waits for, one after the other.
    region : Region
        Where it stands.
    sides : (Region, Region)
        What is computed if the test is true, and if it is not.
    members : list of Node
        The choices.
    """

    def __init__(self, test: Node, depth: int, region: Region) -> None:
        self.test = test
        self.depth = depth
        self.region = region
        self.sides = Region(self, 0), Region(self, 1)
        self.members: list[Node] = []

    @property
    def inside(self) -> Iterator[Node]:
        """Nodes that are computed on either side, its own choices apart."""
        for side in self.sides:
            yield from side.nodes
            for branch in side.branches:
                yield from branch.members
                yield from branch.inside


class Schedule:
    """Regions of all nodes that some results need.

    `available` nodes are there already.

    Attributes
    ----------
    whole : Region
        What is always computed.
    selects : set of Node
        Choices for which both sides are computed.
    """

    def __init__(self, results: Sequence[Node], available: Mapping[Node, object]) -> None:
        self._results = [*results]
        self._order = [node for node in ordered(results, available) if node.op not in LEAVES]
        self._index = {node: index for index, node in enumerate(self._order)}
        self._results_of: dict[Node, list[Node]] = {}
        for node in self._order:
            if node.op == "result":
                self._results_of.setdefault(node.args[0], []).append(node)
        self.selects: set[Node] = set()
        while True:
            self._place()
            little = [
                branch
                for branch in self._all
                if not any(side.branches for side in branch.sides) and is_little([*branch.inside])
            ]
            if not little:
                break
            self.selects |= {node for branch in little for node in branch.members}

    # -- placing -----------------------------------------------------------------------------------

    def _place(self) -> None:
        """Give every node its regions: the outermost of those that need it."""
        self.whole = Region()
        self._all: list[Conditional] = []
        self._of: dict[Node, list[Region]] = {}
        self._branch_of: dict[tuple[Node, Region], Conditional] = {}
        branches: dict[tuple[int, Node, Region], Conditional] = {}
        depth = self._depths()
        needed: dict[Node, dict[Region, None]] = {}
        for node in self._results:
            needed.setdefault(node, {})[self.whole] = None

        def last_first(node: Node) -> tuple[int, bool, int]:
            return -depth[node], self._is_branch(node), -self._index[node]

        for node in sorted(self._order, key=last_first):
            regions = outermost_regions(needed[node])
            if node.op == "result":  # made together with all others, where the call is
                needed.setdefault(node.args[0], {}).update(dict.fromkeys(regions))
                continue
            self._of[node] = regions
            self._of |= dict.fromkeys(self._results_of.get(node, ()), regions)
            for region in regions:
                if not self._is_branch(node):
                    region.nodes += [node, *self._results_of.get(node, ())]
                    for operand in node.args:
                        needed.setdefault(operand, {})[region] = None
                    continue
                test, if_true, if_false = node.args
                key = depth[node], test, region
                branch = branches.get(key)
                if branch is None:
                    branch = branches[key] = Conditional(test, depth[node], region)
                    region.branches.append(branch)
                    self._all.append(branch)
                    needed.setdefault(test, {})[region] = None
                branch.members.append(node)
                self._branch_of[node, region] = branch
                needed.setdefault(if_true, {})[branch.sides[0]] = None
                needed.setdefault(if_false, {})[branch.sides[1]] = None

    def _is_branch(self, node: Node) -> bool:
        return node.op == "if" and node not in self.selects

    def _depths(self) -> dict[Node, int]:
        """How many branches each node waits for, one after the other."""
        depth: dict[Node, int] = {}
        for node in self._order:
            deepest = max((depth.get(operand, 0) for operand in node.args), default=0)
            depth[node] = deepest + self._is_branch(node)
        return depth

    def region_of(self, node: Node, region: Region) -> Region | None:
        """Where a node is computed that is needed in some region; None if it was known before."""
        regions = self._of.get(node)
        if regions is None:
            return None
        for enclosing in region.enclosing:
            for candidate in (enclosing, *enclosing.earlier):
                if candidate in regions:
                    return candidate
        raise AssertionError(node)

    def branch_of(self, node: Node, region: Region) -> Conditional | None:
        """The branch that gives a choice its value in a region; None of anything else."""
        return self._branch_of.get((node, region))

    # -- order -------------------------------------------------------------------------------------

    def steps(self, region: Region) -> Iterator[Node | Conditional]:
        """Nodes and branches of a region, each after those that it needs."""
        steps: list[Node | Conditional] = [*region.nodes, *region.branches]
        at: dict[Node | Conditional, int] = {}
        waits: dict[Node | Conditional, set[Node | Conditional]] = {}
        for step in steps:
            waits[step] = {*self._needs(step, region)} - {step}
            nodes = [step] if isinstance(step, Node) else step.members
            at[step] = min(self._index[node] for node in nodes)
        waiting: dict[Node | Conditional, list[Node | Conditional]] = {}
        for step, others in waits.items():
            for other in others:
                waiting.setdefault(other, []).append(step)
        ready: list[tuple[int, int, Node | Conditional]] = []
        for index, step in enumerate(steps):
            if not waits[step]:
                heappush(ready, (at[step], index, step))
        index_of = {step: index for index, step in enumerate(steps)}
        while ready:
            _, _, step = heappop(ready)
            yield step
            for later in waiting.get(step, ()):
                waits[later].remove(step)
                if not waits[later]:
                    heappush(ready, (at[later], index_of[later], later))

    def _needs(self, step: Node | Conditional, region: Region) -> Iterator[Node | Conditional]:
        """Items of a region that one of its items needs."""
        for node, where in self.uses(step, region):
            computed_in = self.region_of(node, where)
            if computed_in is None or region not in computed_in.enclosing:
                continue
            if computed_in is not region:  # within a branch of the region
                inner = computed_in.enclosing[computed_in.enclosing.index(region) - 1]
                assert inner.branch is not None
                yield inner.branch
            elif self._is_branch(node):
                yield self._branch_of[node, region]
            else:
                yield node

    def uses(self, step: Node | Conditional, region: Region) -> Iterator[tuple[Node, Region]]:
        """What an item of a region reads, all that lies within it included, and from where."""
        if isinstance(step, Node):
            yield from ((operand, region) for operand in step.args)
            return
        yield step.test, region
        for index, side in enumerate(step.sides):
            for member in step.members:
                yield member.args[1 + index], side
            for node in side.nodes:
                yield from self.uses(node, side)
            for branch in side.branches:
                yield from self.uses(branch, side)


def outermost_regions(regions: Iterable[Region]) -> list[Region]:
    """The outermost of some regions; both sides of a branch become the region around it."""
    outermost: list[Region] = []
    for region in regions:
        outermost.append(region)
        changed = True
        while changed:
            changed = False
            last = outermost[-1]
            for index, other in enumerate(outermost[:-1]):
                both = common_region(other, last)
                if both is not None:
                    del outermost[index]
                    outermost[-1] = both
                    changed = True
                    break
    return outermost


def common_region(first: Region, second: Region) -> Region | None:
    """The region in which to compute a node that two regions need; None if there is none.

    Both see the node's name there, and no run computes the node without need.
    """
    if first in second.enclosing:
        return first
    if second in first.enclosing:
        return second
    common = next(region for region in first.enclosing if region in second.enclosing)
    side_a = first.enclosing[first.enclosing.index(common) - 1]
    side_b = second.enclosing[second.enclosing.index(common) - 1]
    assert side_a.branch is not None
    assert side_b.branch is not None
    if side_a.branch is side_b.branch:
        return common if side_a is first and side_b is second else None
    if side_a.branch.test is side_b.branch.test and side_a.side == side_b.side:
        if side_a.branch.depth < side_b.branch.depth:
            return side_a if side_a is first else None
        return side_b if side_b is second else None
    return None


def is_little(nodes: Sequence[Node]) -> bool:
    """Whether some nodes cost less than a branch, and can be computed on any numbers."""
    return len(nodes) <= FEW and all(is_cheap(node) for node in nodes)


VECTOR = {*CHEAP, "/", "sqrt", "**"}
"""Operations that processors have for many numbers at once."""


def is_cheap(node: Node) -> bool:
    """Whether an operation costs little, and is defined for all numbers."""
    divided = node.op == "/" and node.args[1].op == "number" and node.args[1].value != 0.0
    return node.op in CHEAP or divided
