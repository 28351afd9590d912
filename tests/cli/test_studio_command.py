"""``facegen studio`` as a process: it listens, says where, ends with Ctrl-C and saves."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request

import pytest

from facegen.studio import works_folder
from facegen.studio.listening import listen

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are sent")


@pytest.fixture(autouse=True)
def _needs_viser():
    if not os.environ.get("FACEGEN_CI"):
        pytest.importorskip("viser")


@pytest.fixture
def start(tmp_path):
    """A function that starts the command and returns the process and its address."""
    running = []

    def go(*options: object, **environment: str):
        process = subprocess.Popen(
            [sys.executable, "-m", "facegen", "studio", "--no-browser", "--work", str(tmp_path / "works"),
             *map(str, options)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": os.getcwd(), **environment})
        running.append(process)
        line = process.stdout.readline()
        assert line.startswith("facegen studio: http://"), line + process.stderr.read()
        return process, line.split()[-1]

    yield go
    for process in running:
        process.kill()
        process.communicate()


def test_it_serves_until_ctrl_c(start, tmp_path):
    process, url = start()
    with urllib.request.urlopen(url, timeout=20) as page:
        assert b"<title>facegen studio</title>" in page.read()
        assert re.fullmatch(re.escape(url) + r"w/[\w-]{32}", page.url)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 0
    assert out == ""
    assert "stopped; every work is saved" in err
    assert "viser" not in err
    assert "Traceback" not in err
    assert (tmp_path / "works").is_dir()


def test_a_token_is_asked_for_and_an_end_that_the_system_asks_for_saves_too(start):
    process, url = start("--port", 0, FACEGEN_STUDIO_TOKEN="open-sesame-1")
    assert url.endswith("?token=open-sesame-1")
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(url.partition("?")[0], timeout=20)
    assert refused.value.code == 403
    assert "the one with ?token=" in refused.value.read().decode()
    process.send_signal(signal.SIGTERM)
    assert "every work is saved" in process.communicate(timeout=30)[1]
    assert process.returncode == 0


def test_a_taken_port_is_told_of(run, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, out, err = run("studio", "--no-browser", "--work", tmp_path, "--port", port)
    assert (code, out) == (2, "")
    assert f"port: {port} is taken" in err


def test_the_usual_port_gives_way_to_the_next():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with listen("127.0.0.1", port, tries=50) as found:
            assert port < found.getsockname()[1] < port + 50


@pytest.mark.parametrize(("options", "told"), [
    (["--host", "no.such.host.invalid"], "host: 'no.such.host.invalid' is no address of this machine"),
    (["--token", "short"], "token: expected 8 to 200"), (["--token", "with space"], "token: expected"),
    (["--open-folder", "nowhere"], "nowhere: is no folder"), (["--port", "-1"], "port: expected 0 to 65535"),
    (["--port", "99999"], "port: expected 0 to 65535, got 99999")])
def test_wrong_options_are_told_of(run, tmp_path, options, told):
    code, out, err = run("studio", "--no-browser", "--work", tmp_path / "works", *options)
    assert (code, out) == (2, "")
    assert told in err
    assert err.count("\n") == 1


def test_without_viser_the_install_command_is_told(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    code, _, err = run("studio", "--no-browser")
    assert code == 1
    assert 'pip install "facegen[studio]"' in err


def test_works_are_kept_below_the_users_own_data(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert works_folder() == tmp_path / "facegen" / "studio"
    monkeypatch.setenv("XDG_DATA_HOME", "relative")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert works_folder() == tmp_path / ".local" / "share" / "facegen" / "studio"
