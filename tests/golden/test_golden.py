"""Today's numbers, case by case, against those in golden.npz; see README.md."""

import pytest
from cases import CASES
from store import Golden, differences, machine

GOLDEN = Golden.read()
LAST_BITS = "everything, steady start"
"""Steady states with leakage: their root is searched for in another way, see README.md."""


def test_the_file_holds_the_cases_of_the_table() -> None:
    assert list(GOLDEN.cases) == list(CASES)


@pytest.mark.parametrize("name", CASES)
def test_case(name: str) -> None:
    case, golden = CASES[name], GOLDEN.cases[name]
    found = case.compute(GOLDEN.inputs)
    assert list(found) == list(golden)
    kind = "tight" if case.kind == "bits" and LAST_BITS in name else case.kind
    told = [
        f"{name}, {output} {each}"
        for output, values in found.items()
        for each in differences(values, golden[output], kind)
    ]
    if told and GOLDEN.made_on != machine():
        told.append(f"The file was made on {GOLDEN.made_on}; this is {machine()}.")
    assert not told, "\n".join(told)
