"""Workers of a batch: processes of this machine, or a Dask cluster. Either may be killed.

A pool takes tasks and gives back outcomes in the order of their ends. If a worker
dies, its task comes back as an outcome that says so, and
whoever runs the batch gives it out again.
"""

import importlib
import os
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

from codec.errors import CueError
from cuecast.dubbing.catalogue import Task

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_RECONNECTED_S = 20.0
"""How long to try to reach a scheduler that is gone."""

_WARMED_S = 600.0
"""How long a machine may take to compile."""

Work = Callable[[Task], dict[str, Any]]


@dataclass(frozen=True, slots=True)
class TaskOutcome:
    """How a task ended: with its row, or with the death of its worker."""

    task: Task
    row: dict[str, Any] | None
    reason: str = ""


class Processes:
    """Workers of this machine, one thread each.

    Parameters
    ----------
    count : int
    work : callable
        Importable function that turns a task into its row.
    """

    def __init__(self, count: int, work: Work) -> None:
        self._work = work
        self._waiting: deque[Task] = deque()
        self._workers: dict[Connection, tuple[Any, Task | None]] = {}
        self._count = count
        self._context = get_context("spawn")

    def submit(self, task: Task) -> None:
        """Take a task."""
        self._waiting.append(task)

    def outcomes(self) -> Iterator[TaskOutcome]:
        """Yield what ends, until nothing is left; more may be submitted meanwhile."""
        while self._waiting or any(task for _, task in self._workers.values()):
            self._give_out()
            busy = [pipe for pipe, (_, task) in self._workers.items() if task is not None]
            for pipe in wait(busy, timeout=1.0):
                assert isinstance(pipe, Connection)
                process, task = self._workers[pipe]
                assert task is not None
                try:
                    row = pipe.recv()
                    self._workers[pipe] = process, None
                    yield TaskOutcome(task, row)
                except (EOFError, OSError):
                    del self._workers[pipe]
                    process.join(5.0)
                    yield TaskOutcome(task, None, f"its worker died ({_death(process.exitcode)})")

    def _give_out(self) -> None:
        while self._waiting:
            free = next((p for p, (_, task) in self._workers.items() if task is None), None)
            if free is None and len(self._workers) < self._count:
                free = self._hire()
            if free is None:
                return
            task = self._waiting.popleft()
            process, _ = self._workers[free]
            try:
                free.send(task)
                self._workers[free] = process, task
            except OSError:
                del self._workers[free]
                self._waiting.appendleft(task)

    def _hire(self) -> Connection:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs, self._work), daemon=True)
        before = {name: os.environ.get(name) for name in _THREADS}
        os.environ.update(dict.fromkeys(_THREADS, "1"))
        try:
            process.start()
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value
        theirs.close()
        self._workers[ours] = process, None
        return ours

    def close(self) -> None:
        """End the workers."""
        for pipe, (process, task) in self._workers.items():
            pipe.close()
            if task is not None:
                process.terminate()
            process.join(5.0)
        self._workers.clear()


def _serve(pipe: Connection, work: Work) -> None:
    """Work on the tasks from a pipe until it is closed."""
    import signal

    # The batch ends its workers itself, by SIGTERM; what they hold is given back.
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):
            return
        row = work(task)
        try:
            pipe.send(row)
        except OSError:  # the batch is gone; what was made stays
            return


def _death(code: int | None) -> str:
    return f"signal {-code}" if code is not None and code < 0 else f"exit status {code}"


class Cluster:
    """The workers of a Dask scheduler, which see the files under the same names.

    Parameters
    ----------
    address : str
    work : callable
    tell : callable
        Called with notes about the cluster.

    warm : callable, optional
        Importable function that compiles the kernels, run once on each machine first.

    Raises
    ------
    CueError
        If Dask is not installed, or no scheduler answers.
    """

    def __init__(
        self,
        address: str,
        work: Work,
        tell: Callable[[str], None],
        warm: Callable[[], object] | None = None,
    ) -> None:
        try:
            self._dask: Any = importlib.import_module("distributed")
        except ImportError as error:
            raise CueError("--scheduler needs the extra `cluster` (Dask)") from error
        self._address, self._work = address, work
        self._waiting: deque[Task] = deque()
        self._client = self._connect()
        threads = [w["nthreads"] for w in self._client.scheduler_info()["workers"].values()]
        if any(count > 1 for count in threads):
            tell(
                "workers with several threads gain little: start them with --nthreads 1 and more "
                "--nworkers"
            )
        if warm is not None:
            self._warm(warm, tell)

    def _warm(self, warm: Callable[[], object], tell: Callable[[str], None]) -> None:
        """Compile the kernels once on each machine, before workers ask for them all at once."""
        known = self._client.scheduler_info()["workers"]
        machines = {worker["host"]: address for address, worker in known.items()}
        tell(f"warming {len(machines)} machines: kernels are compiled there once (about 40 s)")
        futures = [
            self._client.submit(warm, workers=[address], pure=False)
            for address in machines.values()
        ]
        try:
            self._dask.wait(futures, timeout=_WARMED_S)
            failed = [one for one in futures if one.status == "error"]
        except Exception as error:  # the tasks will show whether the scheduler is gone
            tell(f"not every machine is warm: {type(error).__name__}")
            return
        if failed:
            tell(f"not every machine is warm: {failed[0].exception()}")

    def submit(self, task: Task) -> None:
        """Take a task."""
        self._waiting.append(task)

    def outcomes(self) -> Iterator[TaskOutcome]:
        """Yield what ends, until nothing is left; more may be submitted meanwhile."""
        futures: dict[Any, Task] = {}
        while self._waiting or futures:
            try:
                while self._waiting:
                    future = self._client.submit(
                        self._work, self._waiting[0], pure=False, retries=2
                    )
                    futures[future] = self._waiting.popleft()
                ended = self._dask.wait(
                    list(futures), timeout=5.0, return_when="FIRST_COMPLETED"
                ).done
            except TimeoutError:
                ended = set()
            except Exception as error:  # Dask's ways to say that its scheduler is gone are many
                yield from self._lost(futures, error)
                continue
            if self._client.status != "running":
                yield from self._lost(futures, CueError(self._client.status))
                continue
            for future in ended:
                task = futures.pop(future)
                if future.status == "finished":
                    yield TaskOutcome(task, future.result())
                else:
                    yield TaskOutcome(task, None, f"its worker died ({future.status})")

    def _lost(self, futures: dict[Any, Task], error: Exception) -> Iterator[TaskOutcome]:
        """Give back all tasks, and try to reach the scheduler again."""
        tasks = [*futures.values(), *self._waiting]
        futures.clear()
        self._waiting.clear()
        self.close()
        try:
            self._client = self._connect(_RECONNECTED_S)
        except CueError:
            for task in tasks:
                row = {"status": "not done", "error": f"the scheduler {self._address} is gone"}
                yield TaskOutcome(task, row)
            return
        for task in tasks:
            yield TaskOutcome(task, None, f"the scheduler was gone: {type(error).__name__}")

    def _connect(self, patience_s: float = 0.0) -> Any:
        until_s = time.monotonic() + patience_s
        while True:
            try:
                return self._dask.Client(self._address, timeout="10s")
            except (OSError, ValueError) as error:
                if time.monotonic() >= until_s:
                    raise CueError(f"no scheduler answers at {self._address}") from error
                time.sleep(1.0)

    def close(self) -> None:
        """Leave the cluster; unfinished tasks are given up."""
        try:
            self._client.close(timeout=5)
        except Exception:  # it is gone in any case
            return
