"""Which cases of a test are quick: `make test` is what a newcomer waits for."""

from collections.abc import Sequence
from typing import Any

import pytest


def rest_slow(cases: Sequence[Any], quick: int = 1) -> list[Any]:
    """The first cases as they are, the others marked slow.

    A case of several arguments is a tuple, as for ``parametrize``.
    """
    others = [case if type(case) is tuple else (case,) for case in cases[quick:]]
    return [*cases[:quick], *(pytest.param(*case, marks=pytest.mark.slow) for case in others)]
