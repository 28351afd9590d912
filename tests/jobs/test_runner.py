"""The runner: every task once, whatever happens to the workers."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import pytest
from tasks import begun, finished, some, texts

from facegen.errors import FileError, InputError, JobError
from facegen.jobs import runner
from facegen.jobs.crew import GivenExecutor
from facegen.jobs.runner import Report, run, shared
from facegen.render.request import available_cores

ALL = {f"{i}.txt": f"{i}\n" for i in range(12)}


@pytest.mark.parametrize("workers", [1, 2])
def test_every_task_once(tmp_path, workers):
    steps = []
    assert run(some(tmp_path, groups=2), workers=workers, step=lambda: steps.append(1)) == Report(12, 0)
    assert texts(tmp_path) == ALL
    assert begun(tmp_path) == list(range(12))
    assert len(steps) == 12
    prepared = [path.name.split("-")[1:] for path in (tmp_path / "log").glob("prepared-*")]
    assert {group for group, _ in prepared} == {"g0", "g1"}
    assert len({pid for _, pid in prepared}) <= workers


def test_threads_and_chunks_of_any_size(tmp_path):
    for chunk in (1, 5, 100):
        folder = tmp_path / str(chunk)
        folder.mkdir()
        with ThreadPoolExecutor(2) as pool:
            assert run(some(folder, groups=3), executor=pool, chunk=chunk).made == 12
        assert texts(folder) == ALL


def test_finished_files_are_left_alone(tmp_path):
    tasks = some(tmp_path)
    for task in tasks[:5]:
        task.output.write_text("there")
    steps = []
    assert run(tasks, workers=1, step=lambda: steps.append(1)) == Report(7, 5)
    assert begun(tmp_path) == list(range(5, 12))
    assert len(steps) == 12
    with ThreadPoolExecutor(2) as pool:
        assert run(tasks, executor=pool) == Report(0, 12)


def test_nothing_to_do(tmp_path):
    assert run([]) == Report(0, 0)


def test_only_a_few_chunks_wait_at_a_time(tmp_path):
    most = []

    class Watched(ThreadPoolExecutor):
        def submit(self, *arguments, **more):
            most.append(self._work_queue.qsize())
            return super().submit(*arguments, **more)

    with Watched(2) as pool:
        run(some(tmp_path, count=100), executor=pool, chunk=1)
    assert len(most) == 100
    assert max(most) <= 2 * runner.CHUNKS_AHEAD


def test_a_killed_worker_loses_nothing(tmp_path):
    tasks = some(tmp_path, {4: "kills once"}, groups=2)
    report = run(tasks, workers=2, chunk=3)
    assert report == Report(12, 0, 1)
    assert texts(tmp_path) == ALL           # the draft that it left is gone too
    assert not list(tmp_path.glob(".*"))


def test_a_task_that_kills_workers_is_named(tmp_path):
    with pytest.raises(JobError, match=r"7\.txt: workers die over it, 4 so far"):
        run(some(tmp_path, {7: "kills"}), workers=2, chunk=3)
    made = texts(tmp_path)
    assert "7.txt" not in made
    assert made.items() <= ALL.items()
    assert begun(tmp_path).count(7) == runner.GUILTY
    # the others were let off after two deaths
    assert all(begun(tmp_path).count(i) <= runner.SUSPECT + 1 for i in range(12) if i != 7)


def test_a_broken_executor_of_somebody_else(tmp_path):
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool, \
            pytest.raises(JobError, match=r"the executor broke.*run the same again"):
        run(some(tmp_path, {0: "kills"}), executor=pool, chunk=2)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_failure_ends_the_run_and_names_the_file(tmp_path, workers):
    with pytest.raises(ValueError, match="no such luck") as caught:
        run(some(tmp_path, {3: "fails"}, count=60, kind="slow"), workers=workers, chunk=2)
    assert f"while making {tmp_path / '3.txt'}" in caught.value.__notes__
    assert len(finished(tmp_path)) < 20
    if workers == 2:
        assert any("in the worker:" in note and "tasks.py" in note for note in caught.value.__notes__)


def test_an_error_that_cannot_travel(tmp_path):
    with pytest.raises(JobError, match="Odd: odd 3") as caught:
        run(some(tmp_path, {3: "fails oddly"}), workers=2)
    assert any("3.txt" in note for note in caught.value.__notes__)


def test_an_error_of_ours_has_the_file_in_its_message(tmp_path):
    class Refuses:
        output, group = tmp_path / "x.png", "g"

        def finished(self):
            return False

        def make(self):
            raise InputError("pose: too sad")

    with pytest.raises(InputError, match=r"x\.png: pose: too sad"):
        run([Refuses()], workers=1)


def test_a_full_disk(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    tasks = some(tmp_path)
    run(tasks[:3], workers=1)
    monkeypatch.setattr(Path, "write_text", full)
    from facegen.fileio import textfile
    monkeypatch.setattr("tasks.save_text", textfile.save_text)
    with pytest.raises(FileError, match="No space left"):
        run(tasks, workers=1)
    assert texts(tmp_path) == {f"{i}.txt": f"{i}\n" for i in range(3)}


def test_files_that_do_not_come_back(tmp_path):
    with ThreadPoolExecutor(1) as pool, pytest.raises(JobError, match="all workers share"):
        run(some(tmp_path, {2: "elsewhere"}), executor=pool)


@pytest.mark.parametrize("arguments", [{"workers": 0}, {"workers": True}, {"chunk": 0}, {"chunk": 1.5}])
def test_wrong_arguments(arguments):
    name = next(iter(arguments))
    with pytest.raises(InputError, match=f"^{name}: expected a whole number"):
        run([], **arguments)


def test_an_executor_that_says_nothing_about_itself():
    assert GivenExecutor(object()).slots == available_cores() >= 1
    assert GivenExecutor(object(), 7).slots == 7


def test_a_worker_keeps_a_few_preparations():
    made = []

    def ask(group):
        return shared(("test", group), lambda: made.append(group) or group)

    assert [ask(g) for g in "aabab"] == list("aabab")
    assert made == ["a", "b"]
    for group in "cdef":
        ask(group)
    ask("a")
    assert made == list("abcdefa")
    thread = threading.Thread(target=lambda: ask("a"))
    thread.start()
    thread.join()
    assert made[-2:] == ["a", "a"]      # every thread its own


SCRIPT = """
import sys
sys.path.insert(0, {here!r})
from pathlib import Path
from tasks import some
from facegen.jobs.runner import run
if __name__ == "__main__":
    run(some(Path({folder!r}), count=60, kind="slow"), workers=2, chunk=4)
"""


def start(folder: Path) -> subprocess.Popen:
    (folder / "log").mkdir()
    script = folder / "log" / "script.py"
    script.write_text(SCRIPT.format(here=str(Path(__file__).parent), folder=str(folder)))
    # Started in the background by a shell we would be deaf to Ctrl-C, and so would be our children.
    process = subprocess.Popen([sys.executable, "-u", str(script)], stderr=subprocess.PIPE, text=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    deadline = time.monotonic() + 30
    while len(finished(folder)) < 4:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return process


def gone(folder: Path, seconds: float = 8.0) -> bool:
    """Whether no worker goes on writing."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        before = finished(folder)
        time.sleep(0.5)
        if finished(folder) == before:
            return True
    return False


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_stopped_run_goes_on_where_it_was(tmp_path, how):
    process = start(tmp_path)
    os.kill(process.pid, how)
    _, err = process.communicate(timeout=20)
    assert gone(tmp_path)
    before = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*.txt")}
    assert 4 <= len(before) < 60
    if how == signal.SIGINT:
        assert err.count("Traceback") == 1          # the main process's own: the workers keep still
        assert "KeyboardInterrupt" in err
    report = run(some(tmp_path, count=60), workers=1)
    assert report == Report(60 - len(before), len(before))
    after = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*.txt")}
    assert before.items() <= after.items()
    assert {p.name for p in tmp_path.iterdir()} == {f"{i}.txt" for i in range(60)} | {"log"}
