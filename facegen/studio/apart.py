"""Work on what a stranger sent, done by a process of its own: with little memory, for a short time, ended when told.

What a file does to its reader then ends that process, and no page waits for it. `ask` is called by the studio,
`answer` is what the other process runs.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import facegen
from facegen.errors import FileError
from facegen.studio.limits import MEBIBYTE, Limits

Wish = Mapping[str, Any]
Waits = Callable[[float], None]

_CPU_SIGNAL = 24            # SIGXCPU, which ends a process after its time
_START = 10.0               # seconds that a process may need until it reads, on a machine that is busy
_LOOK = 0.1                 # seconds from look to look whether it is still wanted
_PROGRAM = """import sys
sys.path.append(sys.argv[1])
from facegen.studio import apart, reading
apart.answer(reading.JOBS)"""
# What an answer may be made of: who gave it has read a stranger's file, and is not trusted more than that.
_CLASSES = {("pathlib", "PosixPath"), ("pathlib", "WindowsPath"), ("pathlib", "PurePosixPath"), ("builtins", "set"),
            ("numpy", "ndarray"), ("numpy", "dtype"), ("numpy.core.multiarray", "_reconstruct"),
            ("numpy._core.multiarray", "_reconstruct"), ("numpy._core.numeric", "_frombuffer"),
            ("numpy.core.numeric", "_frombuffer"), ("numpy._core.multiarray", "scalar"),
            ("numpy.core.multiarray", "scalar"), ("builtins", "frozenset")}
_OURS = ("facegen.fileio.", "facegen.geometry.", "facegen.animation.performance", "facegen.landmarking.",
         "facegen.transfer.alignment")


def patient(seconds: float) -> None:
    """Wait on."""


def ask(job: str, path: Path, limits: Limits, wish: Wish, waits: Waits = patient) -> Any:
    """Have another process do a job of `facegen.studio.reading` with a file; return what it answers.

    waits: called again and again with the seconds so far; what it raises ends the other process and is passed on.
    Raises FileError for what takes too long or too much, and the error of which the other process tells.
    """
    return Answers(io.BytesIO(_asked(job, path, limits, wish, waits))).load()


def _asked(job: str, path: Path, limits: Limits, wish: Wish, waits: Waits) -> bytes:
    asked = json.dumps({"job": job, "path": str(path), "seconds": limits.read_seconds, "bytes": limits.read_bytes,
                        "wish": dict(wish)})
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore",
                   "PYTHONDONTWRITEBYTECODE": "1"}
    # -P: nothing is imported from the folder that the studio was started in
    command = [sys.executable, "-P", "-c", _PROGRAM, str(Path(facegen.__file__).parents[1])]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                          env=environment) as process:
        try:
            said = _heard(process, asked.encode(), limits.read_seconds + _START, waits)
        except BaseException:
            process.kill()
            raise
    if said is None or process.returncode == -_CPU_SIGNAL:
        raise FileError(f"{path}: cannot be read within {limits.read_seconds:.0f} s")
    mark, _, rest = said.partition(b"\n")
    if mark == b"found" and process.returncode == 0:
        return rest
    if mark == b"error" and process.returncode == 0:
        from facegen import errors

        told = json.loads(rest)
        raise getattr(errors, told["kind"], FileError)(told["text"])
    raise FileError(f"{path}: cannot be read: it needs more than {limits.read_bytes // MEBIBYTE} MiB, or makes "
                    "its reader fail")


def _heard(process: subprocess.Popen[bytes], asked: bytes, seconds: float, waits: Waits) -> bytes | None:
    """Return what a process says, None if it has not ended in time: it is ended then."""
    begun, given = time.monotonic(), asked
    while True:
        try:
            return process.communicate(given, timeout=_LOOK)[0]
        except subprocess.TimeoutExpired:
            given = None                # it has it
        passed = time.monotonic() - begun
        waits(passed)
        if passed > seconds:
            process.kill()
            process.communicate()
            return None


class Answers(pickle.Unpickler):
    """Reads an answer that is made of nothing but avatars, recordings, found faces, numbers and text."""

    def find_class(self, module: str, name: str) -> Any:
        """Return a class that may be part of an answer; UnpicklingError."""
        if (module, name) in _CLASSES or module.startswith(_OURS):
            found = super().find_class(module, name)
            if isinstance(found, type) or not module.startswith(_OURS):
                return found
        raise pickle.UnpicklingError(f"{module}.{name} is no part of an answer")


# In the other process

def answer(jobs: Mapping[str, Callable[[Path, Wish], Any]]) -> None:
    """Do what stdin asks for and write it to stdout; the main function of the other process."""
    asked = json.loads(sys.stdin.read())
    _bound(asked["seconds"], asked["bytes"])
    out = sys.stdout.buffer
    sys.stdout = sys.stderr         # nothing else may write there
    path = Path(asked["path"])
    try:
        found = b"found\n" + pickle.dumps(jobs[asked["job"]](path, asked["wish"]), protocol=5)
    except MemoryError:
        sys.exit(3)
    except Exception as error:
        from facegen.errors import FacegenError

        if not isinstance(error, FacegenError):
            error = FileError(f"{path}: cannot be read ({type(error).__name__})")
        found = b"error\n" + json.dumps({"kind": type(error).__name__, "text": str(error)[:2000]}).encode()
    out.write(found)
    out.flush()


def _bound(seconds: float, size: int) -> None:
    """Bound what this process may use, where the system can; the time is bounded by who waits for it, too."""
    try:
        import resource
    except ImportError:             # Windows
        return
    for name, bound in (("RLIMIT_AS", size), ("RLIMIT_CPU", math.ceil(seconds)), ("RLIMIT_CORE", 0),
                        ("RLIMIT_FSIZE", 0), ("RLIMIT_NPROC", 0)):
        if hasattr(resource, name):
            hard = bound + (name == "RLIMIT_CPU")       # the first bound has a signal of its own, the second kills
            with contextlib.suppress(ValueError, OSError):      # a lower bound stands already
                resource.setrlimit(getattr(resource, name), (bound, hard))
