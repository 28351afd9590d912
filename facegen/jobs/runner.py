"""Work off many tasks, here or on other processes and machines, and take up again what was stopped.

A task writes one file. Tasks that need the same costly preparation (a face, a renderer) carry the same ``group``; they
are handed out in chunks of one group, and `shared` keeps the preparation in the worker. Only a few chunks are handed
out at a time, so a million tasks cost no more memory than their list.

Nothing is lost when a worker dies: finished files stay, and what it had in hand is handed out again. A task that was
in hand at two deaths is run alone; one that kills workers then, too, is named in the error.
"""

from __future__ import annotations

import numbers
import pickle
import threading
import traceback
from collections import OrderedDict, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from facegen.errors import FacegenError, InputError, JobError
from facegen.fileio.textfile import remove_drafts
from facegen.jobs.crew import Crew, GivenExecutor, LocalProcesses, one_interrupt, stopping
from facegen.render.request import available_cores

LARGEST_CHUNK = 16
CHUNKS_A_WORKER = 8     # each gets this many at least, so that none waits long for the last one
CHUNKS_AHEAD = 2        # handed out per worker: one in work, one waiting
SUSPECT = 2             # worker deaths after which tasks are run alone
GUILTY = 4              # deaths after which a task that runs alone is given up
KEPT = 4                # preparations that a worker keeps

T = TypeVar("T")


class Task(Protocol):
    """One file to be made. It is pickled, so it holds names and numbers, not faces or arrays."""

    @property
    def output(self) -> Path:
        """The file. It appears whole (`whole_file`) or not at all, the last of all that the task writes."""

    @property
    def group(self) -> str:
        """What is prepared for it: tasks of one group share it."""

    def finished(self) -> bool:
        """Return whether the file is there already, as this task would make it."""

    def make(self) -> None:
        """Make the file; the same bytes wherever and whenever it runs."""


@dataclass(frozen=True)
class Report:
    """What a run did. ``made`` and ``kept``: tasks. ``lost``: deaths of workers that it survived."""

    made: int
    kept: int
    lost: int = 0


def run(tasks: Iterable[Task], *, executor: Executor | Crew | None = None, workers: int | None = None,
        chunk: int | None = None, step: Callable[[], None] | None = None) -> Report:
    """Make the files of all tasks that are not finished, and return what was done.

    executor: any `concurrent.futures.Executor` (it stays open), or a crew such as
        `facegen.jobs.cluster.connect(...)`; None starts processes of its own.
    workers: how many processes, by default one for each core that this process may use; 1 works in this process. With
        an executor: how many tasks it can do at once, if it cannot say so itself.
    chunk: tasks handed out at a time, 1 or more. step: called once for each task that is done or was.

    The first task that fails ends the run: its exception is raised, named after its file. Raises InputError for the
    arguments, JobError where workers die again and again or a cluster goes away. Files that were finished stay, and
    the next run goes on from there.
    """
    tasks = list(tasks)
    for name, value in (("workers", workers), ("chunk", chunk)):
        if value is not None and (isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < 1):
            raise InputError(f"{name}: expected a whole number of 1 or more, got {value!r}")
    step = step or _nothing
    cores = min(workers or available_cores(), len(tasks)) if executor is None else 0
    try:
        if executor is None and cores <= 1:
            return _run_here(tasks, step)
        crew = LocalProcesses(cores) if executor is None else \
            GivenExecutor(executor, workers) if isinstance(executor, Executor) else executor
        size = chunk or max(1, min(LARGEST_CHUNK, len(tasks) // (crew.slots * CHUNKS_A_WORKER)))
        with one_interrupt():
            return _Run(tasks, crew, size, step).finish()
    finally:
        remove_drafts(task.output for task in tasks)


def shared(group: object, prepare: Callable[[], T]) -> T:
    """Return what ``prepare()`` gave when this worker first met ``group``; a few groups are kept.

    Every thread has its own, for a renderer serves one caller at a time.
    """
    kept: OrderedDict[object, Any] | None = getattr(_kept, "groups", None)
    if kept is None:
        kept = _kept.groups = OrderedDict()
    if group not in kept:
        kept[group] = prepare()
        while len(kept) > KEPT:
            kept.popitem(last=False)
    kept.move_to_end(group)
    return kept[group]


_kept = threading.local()


def _nothing() -> None:
    pass


def _grouped(tasks: Sequence[Task]) -> list[Task]:
    """Return the tasks with those of one group together, groups in order of their first task."""
    groups: dict[str, list[Task]] = {}
    for task in tasks:
        groups.setdefault(task.group, []).append(task)
    return [task for group in groups.values() for task in group]


def _run_here(tasks: Sequence[Task], step: Callable[[], None]) -> Report:
    made = 0
    for task in _grouped(tasks):
        if not task.finished():
            failure = _attempt(task)
            if failure:
                raise failure.error
            made += 1
        step()
    return Report(made, len(tasks) - made)


# -- in a worker ------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class _Failure:
    error: BaseException


def _work(tasks: Sequence[Task]) -> _Failure | None:
    """Make some files; the first failure ends it. Runs in a worker."""
    for task in tasks:
        if stopping():
            break
        failure = _attempt(task)
        if failure:
            return _portable(failure)
    return None


def _attempt(task: Task) -> _Failure | None:
    try:
        task.make()
    except Exception as error:
        return _Failure(_named(error, task))
    return None


def _named(error: Exception, task: Task) -> Exception:
    """Return the same error with the task's file in front of its message."""
    if isinstance(error, FacegenError) and error.args and str(task.output) not in str(error):
        error.args = (f"{task.output}: {error.args[0]}", *error.args[1:])
    error.add_note(f"while making {task.output}")
    return error


def _portable(failure: _Failure) -> _Failure:
    """Return a failure that survives the way back: some exceptions cannot be pickled, none keeps its traceback."""
    error = failure.error
    error.add_note("in the worker:\n" + "".join(traceback.format_exception(error, chain=True)))
    try:
        pickle.loads(pickle.dumps(error))
        return failure
    except Exception:
        plain = JobError(f"{type(error).__name__}: {error}")
        for note in error.__notes__:
            plain.add_note(note)
        return _Failure(plain)


# -- at home ----------------------------------------------------------------------------------------------------
@dataclass
class _Chunk:
    tasks: list[Task]
    deaths: int = 0


class _Run:
    """One run over a crew."""

    def __init__(self, tasks: Sequence[Task], crew: Crew, size: int, step: Callable[[], None]) -> None:
        self.crew, self.step = crew, step
        self.made = self.kept = self.lost = 0
        self.fresh = self._chunks(tasks, size)
        self.again: deque[_Chunk] = deque()
        self.pending: dict[Future, _Chunk] = {}

    def finish(self) -> Report:
        """Hand out chunks until none is left."""
        try:
            while self._hand_out():
                done, _ = wait(self.pending, return_when=FIRST_COMPLETED)
                losses = [self._take(future) for future in done]
                if any(losses) and self.crew.breaks:
                    self._renew()
        except BaseException:
            self.crew.stop()
            for future in self.pending:
                future.cancel()
            raise
        finally:
            self.crew.close()
        return Report(self.made, self.kept, self.lost)

    def _chunks(self, tasks: Sequence[Task], size: int) -> Iterator[_Chunk]:
        """Yield chunks of unfinished tasks, each of one group; looks for finished files only as it goes."""
        chunk: list[Task] = []
        for task in _grouped(tasks):
            if chunk and (len(chunk) == size or task.group != chunk[0].group):
                yield _Chunk(chunk)
                chunk = []
            if task.finished():
                self.kept += 1
                self.step()
            else:
                chunk.append(task)
        if chunk:
            yield _Chunk(chunk)

    def _hand_out(self) -> bool:
        """Fill the crew's hands; return whether anything is in work. A suspect works alone."""
        while len(self.pending) < CHUNKS_AHEAD * self.crew.slots:
            if any(chunk.deaths >= SUSPECT for chunk in self.pending.values()):
                break
            if self.again and self.again[0].deaths >= SUSPECT and self.pending:
                break
            chunk = self.again.popleft() if self.again else next(self.fresh, None)
            if chunk is None:
                break
            try:
                self.pending[self.crew.submit(_work, chunk.tasks)] = chunk
            except self.crew.losses as error:       # it broke since the last look
                self._mourn(chunk, error, deaths=0)
                self._renew()
        return bool(self.pending)

    def _take(self, future: Future) -> bool:
        """Take a chunk back; return whether its worker died."""
        chunk = self.pending.pop(future)
        try:
            failure = future.result()
        except self.crew.losses as error:
            self._mourn(chunk, error, deaths=self.crew.deaths_a_loss)
            return True
        except CancelledError as error:
            raise JobError("the workers went away; finished files stay: run the same again to go on") from error
        if failure:
            raise failure.error
        for task in chunk.tasks:
            if not task.output.exists():
                raise JobError(f"{task.output}: a worker made it, but it is not here: the folder must be one that all "
                               "workers share, under the same path")
            self.made += 1
            self.step()
        return False

    def _renew(self) -> None:
        """Take back all that a broken crew had in hand and go on with a new one."""
        self.lost += 1
        wait(self.pending)
        for future in list(self.pending):
            self._take(future)
        self.crew.renew()

    def _mourn(self, chunk: _Chunk, error: BaseException, *, deaths: int) -> None:
        """Put what is left of a chunk back in the queue, or give it up."""
        if not self.crew.breaks:
            self.lost += 1
        chunk.deaths += deaths
        left = []
        for task in chunk.tasks:
            if task.finished():
                self.made += 1
                self.step()
            else:
                left.append(task)
        if not left:
            return
        if chunk.deaths >= GUILTY:
            raise JobError(f"{left[0].output}: workers die over it, {chunk.deaths} so far (out of memory? in a script, "
                           "start the work under `if __name__ == \"__main__\":`). Finished files stay") from error
        if not self.crew.renewable:
            raise JobError(f"the executor broke: {error}; finished files stay: run the same again to go on") from error
        if chunk.deaths >= SUSPECT:
            self.again.extend(_Chunk([task], chunk.deaths) for task in left)
        else:
            self.again.appendleft(_Chunk(left, chunk.deaths))
