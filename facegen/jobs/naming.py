"""File names of pictures: readable, unique, the same every time, and valid on every system."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from facegen.errors import InputError
from facegen.jobs.spec import Picture

LONGEST = 100       # characters: far below what any file system takes, even with a draft's ending
# Names that Windows keeps for devices, whatever their suffix.
_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{i}" for port in ("com", "lpt") for i in range(10))}


def file_names(pictures: Sequence[Picture]) -> list[str]:
    """Return one name (without suffix) for each picture: its pose and whatever differs among the pictures.

    A name that was used already, in capitals or not, gets a number. Raises InputError for two pictures that were
    given the same name.
    """
    vary = [write for key, write in _WRITERS.items() if len({getattr(p, key) for p in pictures}) > 1]
    used: set[str] = set()
    for called in (p.called for p in pictures if p.called):
        name = _safe(called)
        if name.casefold() in used:
            raise InputError(f"pictures: two have the name {called!r}; names must differ, also beside capitals and "
                             "what a file name cannot hold")
        used.add(name.casefold())
    last: dict[str, int] = {}       # so that a thousand alike are not tried a thousand times each
    return [_safe(p.called) if p.called else _free(_safe(_described(p, vary)), used, last) for p in pictures]


def _described(picture: Picture, vary: Iterable[Callable[[Picture], str]]) -> str:
    number = [f"r{picture.number:06d}"] if picture.number else []
    pose = picture.caption if picture.kind != "deformation" or is_named(picture) else "pose"
    return "_".join([*number, pose, *filter(None, (write(picture) for write in vary))])


def is_named(picture: Picture) -> bool:
    """Return whether the caption of raw data says something: a file's stem does."""
    return picture.caption != "deformation"


def _free(name: str, used: set[str], last: dict[str, int]) -> str:
    folded = name.casefold()
    number = last.get(folded, 1)
    found = name if number == 1 and folded not in used else None
    while found is None:
        number += 1
        if f"{folded}-{number}" not in used:
            found = f"{name}-{number}"
    last[folded] = number
    used.add(found.casefold())
    return found


def _safe(text: str) -> str:
    """Return a text as a file name: ASCII letters, digits and ``+-_=.`` alone."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    name = re.sub(r"[^A-Za-z0-9+=._-]+", "_", plain).strip("._-")[:LONGEST].rstrip("._-")
    return name if name and name.split(".")[0].casefold() not in _DEVICES else f"pose_{name}".rstrip("_")


def _stem(path: str) -> str:
    """Return a name, or the folder's or file's own name of a path."""
    one = Path(path)
    return one.parent.name if one.name == "face.yaml" else one.stem


def _angle(value: float) -> str:
    return f"{value:+g}" if value else "0"


_WRITERS: Mapping[str, Callable[[Picture], str]] = {
    "person": lambda p: _stem(p.person) if p.person else "",
    "intensity": lambda p: f"i{100 * p.intensity:g}",
    "face": lambda p: _stem(p.face),
    "light": lambda p: p.light,
    "background": lambda p: p.background if isinstance(p.background, str)
    else "bg" + "".join(f"{round(c):02x}" for c in p.background),
    "size": lambda p: f"{p.size[0]}x{p.size[1]}",
    "view": lambda p: f"y{_angle(p.view[0])}p{_angle(p.view[1])}",
}
