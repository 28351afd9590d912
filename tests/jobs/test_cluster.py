"""A real dask cluster on loopback: two worker processes, one of them killed in mid-run."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import warnings

import pytest

from facegen.errors import InputError, JobError
from facegen.jobs.batch import run_batch

if os.environ.get("FACEGEN_CI"):
    import distributed  # here a missing package is a failure, not a reason to skip
else:
    distributed = pytest.importorskip("distributed")

from tasks import begun, finished, some

from facegen.jobs.cluster import connect
from facegen.jobs.runner import Report, run

# distributed leaves sockets and loops to the garbage collector, and so do its shut-down clients.
pytestmark = [pytest.mark.filterwarnings("ignore::ResourceWarning"),
              pytest.mark.filterwarnings("ignore::DeprecationWarning"),
              pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
              pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")]
HERE = os.path.dirname(__file__)


@pytest.fixture(scope="module")
def cluster():
    from distributed import LocalCluster

    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join([HERE, *([before] if before else [])])      # tasks.py for the workers
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None,
                          host="127.0.0.1", silence_logs=50) as found:
            yield found
    if before is None:
        del os.environ["PYTHONPATH"]
    else:
        os.environ["PYTHONPATH"] = before


def worker_pids(cluster) -> list[int]:
    return sorted(nanny.pid for nanny in cluster.workers.values() if nanny.pid)


def test_the_same_bytes(cluster, tmp_path, serial, jobs, contents):
    steps = []
    report = run_batch(jobs, tmp_path / "set", scheduler=cluster.scheduler_address, step=lambda: steps.append(1))
    assert (report.made, report.kept, len(steps)) == (12, 0, 12)
    assert contents(tmp_path / "set") == contents(serial)
    assert run_batch(jobs, tmp_path / "set", scheduler=cluster.scheduler_address).kept == 12


def test_a_killed_worker_loses_nothing(cluster, tmp_path, serial, jobs, contents):
    killed = []

    def step():
        if not killed:
            killed.append(worker_pids(cluster)[0])
            os.kill(killed[0], signal.SIGKILL)

    report = run_batch(jobs, tmp_path / "set", scheduler=cluster.scheduler_address, step=step)
    assert killed
    assert report.made == 12
    assert contents(tmp_path / "set") == contents(serial)


def test_work_is_shared_and_prepared_once(cluster, tmp_path):
    assert run(some(tmp_path, count=40, groups=2, kind="slow"), executor=connect(cluster.scheduler_address)).made == 40
    prepared = [path.name.split("-")[1:] for path in (tmp_path / "log").glob("prepared-*")]
    assert len({pid for _, pid in prepared}) == 2
    assert len(prepared) <= 4


def test_a_task_that_kills_workers_is_named(cluster, tmp_path):
    with pytest.raises(JobError, match=r"5\.txt: workers die over it"):
        run(some(tmp_path, {5: "kills"}, count=8), executor=connect(cluster.scheduler_address), chunk=2)
    assert "5.txt" not in finished(tmp_path)
    assert begun(tmp_path).count(5) >= 4
    # the cluster recovers by itself
    for task in some(tmp_path, count=8):
        task.output.unlink(missing_ok=True)
    assert run(some(tmp_path, count=8), executor=connect(cluster.scheduler_address)) == Report(8, 0)


def test_a_failure_comes_home_with_its_file(cluster, tmp_path):
    with pytest.raises(ValueError, match="no such luck") as caught:
        run(some(tmp_path, {3: "fails"}), executor=connect(cluster.scheduler_address))
    assert any("3.txt" in note for note in caught.value.__notes__)


def test_the_command(cluster, tmp_path, serial, jobs, contents):
    page = tmp_path / "jobs.json"
    page.write_text(json.dumps(jobs))
    done = subprocess.run([sys.executable, "-m", "facegen", "batch", page, "-o", tmp_path / "set", "--json",
                           "--scheduler", cluster.scheduler_address], capture_output=True, text=True, timeout=60,
                          check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["made"] == 12
    assert contents(tmp_path / "set") == contents(serial)


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


@pytest.mark.parametrize(("address", "words"), [
    ("tcp://127.0.0.1:{}", r"nothing answers at tcp://127\.0\.0\.1:\d+ \(waited 1 s\)"),
    ("nonsense://x:1", "scheduler: expected an address such as tcp://"),
    ("", "scheduler: expected an address such as tcp://"),
    ("nonsense", "scheduler: expected an address such as tcp://"),
])
def test_no_scheduler_there(address, words):
    start = time.monotonic()
    with pytest.raises(InputError, match=words):
        connect(address.format(free_port()), wait=1)
    assert time.monotonic() - start < 6


def test_nothing_is_made_without_a_scheduler(tmp_path, jobs, monkeypatch):
    monkeypatch.setattr("facegen.jobs.cluster.WAIT", 1.0)
    with pytest.raises(InputError, match="nothing answers"):
        run_batch(jobs, tmp_path / "set", scheduler=f"tcp://127.0.0.1:{free_port()}")
    assert not (tmp_path / "set").exists()


def test_distributed_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r'pip install "facegen\[cluster\]"'):
        connect("tcp://127.0.0.1:8786")


@pytest.fixture
def lonely():
    """A scheduler in a process of its own, without workers."""
    port = free_port()
    code = ("from distributed.cli.dask_scheduler import main; import sys; "
            f"main(['--host', '127.0.0.1', '--port', '{port}', '--no-dashboard'])")
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        with socket.socket() as s:
            if s.connect_ex(("127.0.0.1", port)) == 0:
                break
        time.sleep(0.1)
    yield f"tcp://127.0.0.1:{port}", process
    process.kill()
    process.wait()


def test_a_scheduler_without_workers(lonely):
    with pytest.raises(InputError, match="has no workers"):
        connect(lonely[0], wait=1.5)


def test_a_scheduler_that_dies_in_mid_run(lonely, tmp_path):
    address, process = lonely
    code = ("from distributed.cli.dask_worker import main; "
            f"main(['{address}', '--nthreads', '1', '--no-nanny', '--no-dashboard', '--death-timeout', '5'])")
    worker = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                              env={**os.environ, "PYTHONPATH": os.pathsep.join([HERE, *sys.path])})
    try:
        tasks = some(tmp_path, count=40, kind="slow")
        with pytest.raises(JobError, match="run the same again to go on"):
            run(tasks, executor=connect(address, wait=20), chunk=2,
                step=lambda: process.kill() if process.poll() is None else None)
    finally:
        worker.kill()
        worker.wait()
    assert 0 < len(finished(tmp_path)) < 40
    assert run(tasks, workers=1).kept >= 1
