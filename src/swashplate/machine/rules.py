"""What numbers of a machine must satisfy together: conditions with a sentence each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import ParameterError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class CheckedRule(NamedTuple):
    """A rule applied to sets of numbers."""

    is_broken: Mask
    """(m,) which sets break it."""
    sentence: Callable[[int], str]
    """For a set that breaks it, by its index."""


class MemberRules(NamedTuple):
    """Rules that a machine, or a member of a joined one, says of its numbers."""

    rules: Callable[[Mapping[str, Array]], Iterator[CheckedRule]]
    """Takes (m,) values by the member's own paths."""
    member: str = ""
    """Its path in a joined machine, empty for the machine itself."""

    def checked(self, numbers: Mapping[str, Array]) -> Iterator[CheckedRule]:
        """The rules applied to (m,) values of the whole machine by path."""
        if not self.member:
            yield from self.rules(numbers)
            return
        prefix = f"{self.member}."
        own = {path: values for path, values in numbers.items() if path.startswith(prefix)}
        for rule in self.rules({path.removeprefix(prefix): own[path] for path in own}):
            yield rule._replace(sentence=self._said(rule))

    def _said(self, rule: CheckedRule) -> Callable[[int], str]:
        return lambda number: f"{self.member}: {rule.sentence(number)}"


def refuse(owner: str, rules: Iterator[CheckedRule]) -> None:
    """Raise the sentence of the first rule that the first set breaks, as a `ParameterError`."""
    for rule in rules:
        if rule.is_broken[0]:
            raise ParameterError(f"{owner}: {rule.sentence(0)}")
