"""Where independent pieces of work run: here, in threads or processes, or on a Dask cluster."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from swashplate.errors import InputError, SwashplateError
from swashplate.stopping import as_a_whole, let_signals_end_waits, undone

if TYPE_CHECKING:
    from concurrent.futures import Executor as Pool

Work = Callable[[Any, Any], Any]
Done = Iterator[tuple[int, Any]]
"""Position of an item and what the work gave for it, as each is done."""

LOOK = 2.0
"""How often a client looks whether its cluster is still there, while nothing ends. [s]"""


class Executor(Protocol):
    """Runs one function over many items; all give the same results, in any order."""

    def run(self, function: Work, shared: Any, items: Sequence[Any]) -> Done:
        """Yield (position of the item, result) as each is done.

        Parameters
        ----------
        function : callable
            Of a module, so that it can be sent to another process.
        shared :
            Its first argument, the same for all items; each worker gets it once.
        items : sequence
            Its second argument.

        Raises
        ------
        InputError
            If workers or a cluster cannot be reached or are lost, or cannot import the model.
        """
        ...


class Serial:
    """One after another, in this process."""

    def run(self, function: Work, shared: Any, items: Sequence[Any]) -> Done:
        """See `Executor.run`."""
        for position, item in enumerate(items):
            yield position, function(shared, item)


@dataclass(frozen=True)
class Threads:
    """Threads of this process, for work that releases the interpreter's lock, as marches do."""

    workers: int | None = None
    """How many; by default one for each core that this process may use."""

    def run(self, function: Work, shared: Any, items: Sequence[Any]) -> Done:
        """See `Executor.run`."""
        from concurrent.futures import ThreadPoolExecutor

        workers = self.workers or available_cores()
        with ThreadPoolExecutor(workers) as pool:
            try:
                yield from _completed(pool, partial(function, shared), items, workers)
            finally:
                pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _in_a_file(shared: Any) -> Iterator[Path]:
    """Path of a file with what all workers share, which only this user can read.

    What goes through the pipe of a worker's start beyond the 64 kB that a pipe holds keeps its
    parent waiting until the worker has imported the main module. A parent that is ended meanwhile
    leaves a worker that it does not know yet, with half of its data.
    """
    import pickle
    from tempfile import mkstemp

    handle, name = mkstemp(prefix="swashplate-")
    path = Path(name)
    with undone(path.unlink):
        try:
            with os.fdopen(handle, "wb") as file:
                pickle.dump(shared, file, pickle.HIGHEST_PROTOCOL)
            yield path
        finally:
            path.unlink()


_shared: Any = None


def _receive(path: Path) -> None:
    """Initialise a worker: read what all items share, and end when its parent does, and only then.

    Ctrl-C reaches the workers as well as the parent, which ends them. A parent that is killed
    cannot end its workers, and what they hold of its pipes would keep whoever reads them waiting.
    """
    import pickle
    from multiprocessing import parent_process
    from threading import Thread

    global _shared
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=end_with_parent, daemon=True).start()
    try:
        data = path.read_bytes()
    except FileNotFoundError:  # the parent has ended
        os._exit(1)
    _shared = pickle.loads(data)


def _apply(function: Work, item: Any) -> Any:
    return function(_shared, item)


@dataclass(frozen=True)
class Processes:
    """Worker processes on this machine."""

    workers: int | None = None
    """How many; by default one for each core that this process may use."""

    def run(self, function: Work, shared: Any, items: Sequence[Any]) -> Done:
        """See `Executor.run`."""
        from concurrent.futures import ProcessPoolExecutor
        from concurrent.futures.process import BrokenProcessPool
        from multiprocessing import active_children, get_context

        workers = min(self.workers or available_cores(), max(len(items), 1))
        if workers == 1:
            yield from Serial().run(function, shared, items)
            return
        others = set(active_children())

        def end_workers() -> None:
            for worker in set(active_children()) - others:
                worker.kill()

        # spawned, not forked: a fork copies locks of NumPy's threads in any state
        with (
            _in_a_file(shared) as path,
            undone(end_workers),
            ProcessPoolExecutor(
                workers, get_context("spawn"), initializer=_receive, initargs=(path,)
            ) as pool,
        ):
            try:
                yield from _completed(pool, partial(_apply, function), items, workers)
            except BrokenProcessPool:
                raise InputError(
                    "A worker process died or could not import the model; define the model in a "
                    "module, and guard the start of a script by if __name__ == '__main__'."
                ) from None
            except BaseException:  # Ctrl-C, or whoever asked has had enough: nobody waits for them
                # and nothing is cancelled, which Python's pool would complain of when it sees them
                # killed
                end_workers()
                raise


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Have processes that are started meanwhile never hear Ctrl-C, not even while they import.

    What a thread blocks is blocked in the processes that it starts. A Ctrl-C of this moment waits.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows, where a worker is deaf once initialised
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _completed(
    pool: Pool, function: Callable[[Any], Any], items: Sequence[Any], workers: int
) -> Done:
    """Results as they come; no more are waiting than it takes to keep all workers busy."""
    from concurrent.futures import FIRST_COMPLETED, Future, wait

    waiting = iter(enumerate(items))
    running: dict[Future[Any], int] = {}
    while True:
        for k, item in islice(waiting, 2 * workers - len(running)):
            # a worker that is ended while it starts says so
            with as_a_whole(), _deaf_to_interrupts():
                running[pool.submit(function, item)] = k
        if not running:
            return
        let_signals_end_waits()
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            yield running.pop(future), future.result()


@dataclass(frozen=True)
class Dask:
    """Workers of a Dask cluster, by the scheduler's address."""

    address: str
    """Such as ``tcp://10.0.0.1:8786``."""
    retries: int = 3
    """How often an item is done again after its worker was lost."""

    def run(self, function: Work, shared: Any, items: Sequence[Any]) -> Done:
        """See `Executor.run`."""
        from importlib.util import find_spec

        if find_spec("distributed") is None:
            raise InputError("A cluster needs Dask: install swashplate with its extra 'dask'.")
        from concurrent.futures import CancelledError
        from queue import Empty, Queue

        from distributed import Client, Future

        try:
            client = Client(self.address, timeout=10, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(f"No Dask scheduler answers at {self.address}: {error}.") from None
        ended: Queue[Future] = Queue()
        with client:
            try:
                sent = client.scatter(shared, broadcast=True, hash=False)
                waiting = {}
                for k, item in enumerate(items):
                    future = client.submit(function, sent, item, pure=False, retries=self.retries)
                    waiting[future.key] = k, future
                    future.add_done_callback(ended.put)
                while waiting:
                    try:
                        future = ended.get(timeout=LOOK)
                    except Empty:
                        if client.status in ("running", "connecting"):
                            continue
                        raise ConnectionError from None
                    yield waiting.pop(future.key)[0], future.result()
            except SwashplateError:
                raise
            except (OSError, CancelledError) as error:
                raise InputError(
                    f"The Dask scheduler at {self.address} was lost ({type(error).__name__}): "
                    "start it again, then repeat this."
                ) from None


def available_cores() -> int:
    """Cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on Windows and macOS
        return os.cpu_count() or 1
