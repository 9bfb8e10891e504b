"""Workers that end with their parent, and a cluster that is lost."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from swashplate import InputError
from swashplate.executors import Dask

PARENT = """
import os
import sys
import time
from pathlib import Path

from swashplate.executors import Processes


def work(folder, number):
    (Path(folder) / f"{os.getpid()}.pid").touch()
    time.sleep(60.0)


if __name__ == "__main__":
    list(Processes(2).run(work, sys.argv[1], range(4)))
"""


def alive(pid: int) -> bool:
    """Whether a process runs; one that only waits to be collected does not."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text("utf-8").rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks into /proc")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_workers_end_with_their_parent(tmp_path: Path, how: signal.Signals) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT, "utf-8")
    parent = subprocess.Popen([sys.executable, script, tmp_path], stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60.0
    while len(workers := [int(each.stem) for each in tmp_path.glob("*.pid")]) < 2:
        assert parent.poll() is None, "it ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(parent.pid, how)
    parent.wait(10.0)
    deadline = time.monotonic() + 10.0
    while any(map(alive, workers)):
        assert time.monotonic() < deadline, "workers outlive their parent"
        time.sleep(0.01)


CLUSTER = """
import time

from distributed import LocalCluster

if __name__ == "__main__":
    cluster = LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp://",
        dashboard_address=None,
    )
    print(cluster.scheduler_address, flush=True)
    time.sleep(120.0)
"""


@pytest.mark.filterwarnings("default")  # what Dask itself warns of when connections end
def test_a_scheduler_that_is_lost_ends_in_a_sentence(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER, "utf-8")
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as cluster:
        assert cluster.stdout is not None
        running = Dask(cluster.stdout.readline().strip()).run(pow, 2, range(2_000))
        assert next(running)[0] in range(2_000)
        cluster.kill()
        with pytest.raises(InputError, match="scheduler at .*tcp"):
            list(running)


def test_no_scheduler_and_no_dask_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match="extra 'dask'"):
        list(Dask("tcp://127.0.0.1:1").run(pow, 2, [1]))
