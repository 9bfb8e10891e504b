"""No file of a package needs one that needs it; imports for types only are counted.

The contracts of import-linter leave those out: a result may name matplotlib's types.
"""

import pytest
from grimp import ImportGraph, build_graph


@pytest.fixture(scope="module")
def graph() -> ImportGraph:
    return build_graph("swashplate", exclude_type_checking_imports=False, cache_dir=None)


@pytest.mark.parametrize(
    "package", ["swashplate.crane", "swashplate.drive", "swashplate.identification"]
)
def test_files_of_a_package_form_no_circle(graph: ImportGraph, package: str) -> None:
    assert len(graph.find_children(package)) > 10
    assert graph.nominate_cycle_breakers(package) == set()
