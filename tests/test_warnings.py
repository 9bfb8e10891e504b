"""A warning is an error in the tests and in the processes they start: deprecations come first."""

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.skipif(
    "ignore" in sys.warnoptions, reason="the lowest versions themselves warn"
)
DEPRECATIONS = (
    DeprecationWarning,
    PendingDeprecationWarning,
    FutureWarning,
    np.exceptions.VisibleDeprecationWarning,
)


@pytest.mark.parametrize("category", DEPRECATIONS)
def test_a_deprecation_is_an_error(category: type[Warning]) -> None:
    with pytest.raises(category, match="will be removed"):
        warnings.warn("will be removed", category, stacklevel=1)


@pytest.mark.parametrize("category", DEPRECATIONS)
def test_a_deprecation_is_an_error_in_a_process(tmp_path: Path, category: type[Warning]) -> None:
    """Whoever calls it: the command line, not only a module of its own."""
    module = tmp_path / "deprecated.py"
    name = category.__name__
    source = f"np.exceptions.{name}" if category.__module__.startswith("numpy") else name
    module.write_text(
        "import warnings\nimport numpy as np\n"
        f"def call():\n    warnings.warn('will be removed', {source}, stacklevel=2)\n",
        "utf-8",
    )
    done = subprocess.run(
        [sys.executable, "-c", "import deprecated; deprecated.call()"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert f"{name}: will be removed" in done.stderr
