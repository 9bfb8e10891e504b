"""No file of a package needs one that needs it; imports for types only are counted.

The contracts of import-linter leave those out: a result may name matplotlib's types.
"""

import pytest
from grimp import ImportGraph, build_graph


@pytest.fixture(scope="module")
def graph() -> ImportGraph:
    return build_graph("swashplate", exclude_type_checking_imports=False, cache_dir=None)


PACKAGES = [
    "swashplate.crane",
    "swashplate.crane.closed_loop",
    "swashplate.crane.sea",
    "swashplate.crane.studies",
    "swashplate.drive",
    "swashplate.equations",
    "swashplate.equations.marching",
    "swashplate.identification",
    "swashplate.identification.diagnostics",
    "swashplate.identification.estimation",
    "swashplate.identification.statistics",
]


@pytest.mark.parametrize("package", PACKAGES)
def test_files_of_a_package_form_no_circle(graph: ImportGraph, package: str) -> None:
    assert len(graph.find_children(package)) >= 5
    assert graph.nominate_cycle_breakers(package) == set()
