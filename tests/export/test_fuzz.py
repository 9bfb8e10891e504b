"""FMUs under random calls, odd numbers and damaged states; see `fuzzer`."""

import re
import shutil
import sys
from pathlib import Path

import pytest

pytest.importorskip("fmpy")

from tests.export.fuzzer import REFINEMENTS, fuzzer_of

from swashplate import Drive

SECONDS = 10.0
"""Of the processor, for each of four runs; `make fuzz` takes longer."""
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (shutil.which("gcc") or shutil.which("clang")), reason="there is no C compiler here"
    ),
    pytest.mark.skipif(sys.platform != "linux", reason="the sanitizers are those of Linux"),
]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("changes", [{}, REFINEMENTS], ids=["plain", "refined"])
def test_no_order_of_calls_and_no_damaged_state_breaks_an_fmu(
    changes: dict[str, float], fmi: str, hoist: Drive, tmp_path: Path
) -> None:
    done = fuzzer_of(hoist.replace(**changes), fmi, tmp_path).run(1, SECONDS)
    assert done.returncode == 0, done.stdout + done.stderr
    numbers = [int(each) for each in re.findall(r"\d+", done.stdout)]
    calls, instances, steps, messages, refused, damaged, accepted, forged = numbers
    assert calls == 30 * instances >= 10_000
    assert steps > calls // 20
    assert messages > 0
    assert refused == damaged > 100
    assert 0 < accepted < forged


@pytest.mark.parametrize(
    ("guard", "instead", "finding"),
    [
        ("memcmp(bytes + STATE_HASH, &hash, sizeof hash) != 0", "0", "a damaged state was accept"),
        ("!fmu_possible(made)", "0", "runtime error|AddressSanitizer|does not return"),
    ],
    ids=["hash", "places"],
)
def test_the_fuzzer_notices_a_guard_that_is_missing(
    guard: str, instead: str, finding: str, hoist: Drive, tmp_path: Path
) -> None:
    fuzzer = fuzzer_of(hoist, "2.0", tmp_path, weakened=(guard, instead))
    done = fuzzer.run(1, 4.0 * SECONDS)
    assert done.returncode != 0
    assert re.search(finding, done.stdout + done.stderr)
