import pytest
from reproduction.build import reproduce
from reproduction.catalogue import ERROR_TABLES
from reproduction.content import Reproduction


@pytest.fixture(scope="session")
def everything() -> Reproduction:
    """All figures and tables, of the default seed."""
    return reproduce()


@pytest.fixture(scope="session")
def small() -> Reproduction:
    """One figure of each kind and one table of each kind."""
    names = ("4.1", "4.4", "7.2", "7.14", "7.22", "7.28", "9.1")
    tables = ("4.3", "7.1", "7.2", "8.3")
    assert not set(tables) & set(ERROR_TABLES)
    return reproduce(
        only=[*(f"figure {each}" for each in names), *(f"table {each}" for each in tables)]
    )
