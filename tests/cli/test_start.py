"""The command starts quickly and ends with a word and a code, whatever happens."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

import facegen
from facegen.cli import app, main

HEAVY = ("numpy", "scipy", "PIL", "yaml", "rich")


def python(*arguments: str, **options) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=120,
                          check=False, **options)


def test_help_imports_nothing_heavy():
    code = ("import sys; from facegen.cli import main; code = main(['--help']);"
            f"print([m for m in {HEAVY} if m in sys.modules], code, file=sys.stderr)")
    done = python("-c", code)
    assert done.stderr.strip() == "[] 0"
    assert "facegen" in done.stdout


def test_import_facegen_imports_nothing_heavy():
    done = python("-c", f"import sys, facegen; print([m for m in {HEAVY} if m in sys.modules])")
    assert done.stdout.strip() == "[]", done.stderr


def test_a_wrong_name_is_found_before_the_face_is_loaded():
    code = ("import sys; from facegen.cli import main; code = main(['render', 'hapiness', '-o', 'x.png']);"
            "print('facegen.face.face' in sys.modules, code)")
    assert python("-c", code).stdout.strip() == "False 2"


def test_version(run):
    assert run("--version") == (0, f"facegen {facegen.__version__}\n", "")


def test_python_m_facegen():
    done = python("-m", "facegen", "--version")
    assert (done.returncode, done.stdout) == (0, f"facegen {facegen.__version__}\n")


@pytest.mark.parametrize("command", ["render", "list", "explain", "gallery", "figures"])
def test_every_command_explains_itself(run, command):
    code, out, err = run(command, "--help")
    assert (code, err) == (0, "")
    assert "Usage: facegen" in out


def test_nothing_asked_shows_the_help_on_stderr(run):
    code, out, err = run()
    assert (code, out) == (2, "")
    assert "Usage: facegen" in err


@pytest.mark.parametrize(("argv", "words"), [
    (["dance"], "dance"),
    (["render"], "WHAT"),
    (["render", "happiness", "--colour", "red"], "--colour"),
    (["render", "happiness", "sadness", "-o", "x.png"], "sadness"),
    (["render", "happiness", "-o"], "-o"),
    (["list", "animals"], "animals"),
    (["list"], "Missing command"),
    (["explain", "happiness", "--intensity", "much"], "--intensity"),
    (["render", "happiness", "-o", "x.png", "--detail", "9"], "--detail"),
])
def test_usage_errors(run, argv, words):
    code, out, err = run(*argv)
    assert (code, out) == (2, "")
    assert err.startswith("facegen: ")
    assert words.casefold() in err.casefold()
    assert "Traceback" not in err


def test_a_fault_of_ours_shows_no_traceback(run, monkeypatch):
    def broken(*_, **__):
        raise RuntimeError("two plus two")

    monkeypatch.setattr(app, "app", broken)
    code, out, err = run("list", "units")
    assert (code, out) == (1, "")
    assert "RuntimeError: two plus two" in err
    assert "Traceback" not in err
    monkeypatch.setenv("FACEGEN_DEBUG", "1")
    with pytest.raises(RuntimeError):
        main(["list", "units"])


def test_being_stopped(run, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(app, "app", stopped)
    assert run("list", "units") == (1, "", "facegen: stopped\n")


@pytest.mark.skipif(os.name == "nt", reason="pipes break differently there")
def test_a_closed_pipe_is_no_crash():
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([sys.executable, "-m", "facegen", "list", "expressions", "--json"], stdout=write,
                          stderr=subprocess.PIPE, text=True, timeout=60)
    os.close(write)
    assert done.stderr == ""


def test_a_narrow_console_is_no_crash():
    done = python("-m", "facegen", "explain", "sadness", env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stderr) == (0, "")
