"""Small tasks that can be pickled, for the runner's tests."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from facegen.fileio.textfile import save_text
from facegen.jobs.runner import shared


@dataclass(frozen=True)
class Write:
    """Writes its number; what else it does, its kind says."""

    output: Path
    number: int
    group: str = "a"
    kind: str = ""

    def finished(self) -> bool:
        return self.output.exists()

    def make(self) -> None:
        log = self.output.parent / "log"
        prepared = shared((str(log), self.group), lambda: save_text("", log / f"prepared-{self.group}-{os.getpid()}"))
        assert prepared.exists()
        save_text("", log / f"begun-{self.number}-{time.monotonic_ns()}")
        if self.kind == "slow":
            time.sleep(0.1)
        if self.kind == "kills":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.kind == "kills once" and not (log / "killed").exists():
            save_text("", log / "killed")
            self.output.with_name(f".{self.output.name}.{os.getpid()}.part").write_text("half")
            os.kill(os.getpid(), signal.SIGKILL)
        if self.kind == "fails":
            raise ValueError("no such luck")
        if self.kind == "fails oddly":
            raise Odd(1, 2)
        if self.kind == "elsewhere":
            return
        save_text(f"{self.number}\n", self.output)


class Odd(Exception):
    """Cannot be unpickled: its arguments are not its constructor's."""

    def __init__(self, one, two):
        super().__init__(f"odd {one + two}")


def some(folder: Path, kinds: dict[int, str] | None = None, *, count: int = 12, groups: int = 1, kind: str = ""):
    (folder / "log").mkdir(exist_ok=True)
    return [Write(folder / f"{i}.txt", i, f"g{i % groups}", (kinds or {}).get(i, kind)) for i in range(count)]


def texts(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


def finished(folder: Path) -> set[str]:
    """The names of the files that are whole; those being written come and go."""
    return {path.name for path in folder.glob("*.txt")}


def begun(folder: Path) -> list[int]:
    return sorted(int(path.name.split("-")[1]) for path in (folder / "log").glob("begun-*"))
