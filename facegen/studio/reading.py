"""A stranger's avatar, read in a process of its own: with little memory, for a short time, and nothing of it stays.

The readers of facegen.fileio check what they read. This is for what they might not know: a file that makes them slow or
hungry ends its own process, and no page.
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
from pathlib import Path
from typing import Any

import facegen
from facegen.errors import FileError
from facegen.fileio.avatar import READABLE, AvatarFile, load_avatar
from facegen.studio.limits import MEBIBYTE, Limits

_CPU_SIGNAL = 24            # SIGXCPU, which ends a process after its time
_START = 10.0               # seconds that a process may need until it reads, on a machine that is busy
_PROGRAM = """import sys
sys.path.append(sys.argv[1])
from facegen.studio import reading
reading.answer()"""
# What the answer of the other process may be made of: it read a stranger's file, and is not trusted more than that.
_CLASSES = {("pathlib", "PosixPath"), ("pathlib", "WindowsPath"), ("pathlib", "PurePosixPath"), ("builtins", "set"),
            ("numpy", "ndarray"), ("numpy", "dtype"), ("numpy.core.multiarray", "_reconstruct"),
            ("numpy._core.multiarray", "_reconstruct"), ("numpy._core.numeric", "_frombuffer"),
            ("numpy.core.numeric", "_frombuffer"), ("numpy._core.multiarray", "scalar"),
            ("numpy.core.multiarray", "scalar"), ("builtins", "frozenset")}
_OURS = ("facegen.fileio.", "facegen.geometry.mesh")


def read_avatar_safely(path: str | os.PathLike[str], limits: Limits | None = None) -> AvatarFile:
    """Return what `facegen.load_avatar` returns, read by another process with bounds on its time and memory.

    Raises FileError for a file that is wrong, has more triangles than ``limits.triangles``, takes too long or too much.
    """
    path = Path(path)
    if path.suffix.lower() not in READABLE:
        return load_avatar(path)        # which says what it reads
    return _Answers(io.BytesIO(_asked(path, limits or Limits()))).load()


def _asked(path: Path, limits: Limits) -> bytes:
    """Have another process read a file; return its answer, or raise the error that it tells of."""
    wish = json.dumps({"path": str(path), "triangles": limits.triangles, "seconds": limits.read_seconds,
                       "bytes": limits.read_bytes})
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore",
                   "PYTHONDONTWRITEBYTECODE": "1"}
    try:        # -P: nothing is imported from the folder that the studio was started in
        done = subprocess.run([sys.executable, "-P", "-c", _PROGRAM, str(Path(facegen.__file__).parents[1])],
                              input=wish.encode(), capture_output=True, check=False, env=environment,
                              timeout=limits.read_seconds + _START)
    except subprocess.TimeoutExpired:
        raise _too_slow(path, limits) from None
    mark, _, rest = done.stdout.partition(b"\n")
    if mark == b"found" and done.returncode == 0:
        return rest
    if mark == b"error" and done.returncode == 0:
        from facegen import errors

        told = json.loads(rest)
        kind = getattr(errors, told["kind"], FileError)
        raise kind(told["text"])
    if done.returncode == -_CPU_SIGNAL:
        raise _too_slow(path, limits)
    raise FileError(f"{path}: cannot be read: it needs more than {limits.read_bytes // MEBIBYTE} MiB, or makes "
                    "its reader fail")


def _too_slow(path: Path, limits: Limits) -> FileError:
    return FileError(f"{path}: cannot be read within {limits.read_seconds:.0f} s")


class _Answers(pickle.Unpickler):
    """Reads an answer that is made of nothing but an avatar."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in _CLASSES or module.startswith(_OURS):
            found = super().find_class(module, name)
            if isinstance(found, type) or not module.startswith(_OURS):
                return found
        raise pickle.UnpicklingError(f"{module}.{name} is no part of an avatar")


# In the other process

def answer() -> None:
    """Read what stdin asks for and write it to stdout; the main function of the other process."""
    wish = json.loads(sys.stdin.read())
    _bound(wish["seconds"], wish["bytes"])
    out = sys.stdout.buffer
    sys.stdout = sys.stderr         # nothing else may write there
    path = Path(wish["path"])
    try:
        found = b"found\n" + _avatar(path, wish["triangles"])
    except MemoryError:
        sys.exit(3)
    except FileError as error:
        found = _error("FileError", error)
    except Exception as error:
        from facegen.errors import FacegenError

        if isinstance(error, FacegenError):
            found = _error(type(error).__name__, error)
        else:
            found = _error("FileError", FileError(f"{path}: cannot be read ({type(error).__name__})"))
    out.write(found)
    out.flush()


def _error(kind: str, error: Exception) -> bytes:
    return b"error\n" + json.dumps({"kind": kind, "text": str(error)[:2000]}).encode()


def _avatar(path: Path, most: int) -> bytes:
    from facegen.studio.counting import triangles

    count = triangles(path)
    if count is not None and count > most:
        raise _too_many(path, count, most)
    found = load_avatar(path)
    if len(found.mesh.faces) > most:
        raise _too_many(path, len(found.mesh.faces), most)
    return pickle.dumps(found, protocol=5)


def _too_many(path: Path, count: int, most: int) -> FileError:
    return FileError(f"{path}: has {count:,} triangles, the studio takes up to {most:,}; make fewer of them first (in "
                     "Blender: the Decimate modifier), or use the command facegen rig")


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
