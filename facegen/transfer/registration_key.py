"""What a registration depends on, in one digest: while it stays the same, a kept registration can be used again."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from numpy.typing import NDArray

from facegen.fileio.kept import content_key
from facegen.geometry.operators import Surface
from facegen.transfer.template import Template

CODE = ("geometry/closest.py", "geometry/factor.py", "geometry/fade.py", "geometry/normals.py",
        "geometry/operators.py", "transfer/registration.py", "transfer/sides.py", "transfer/skin.py",
        "transfer/template.py")
"""The files that decide how a skin is registered: when one changes, what was kept counts no more."""


@cache
def _code() -> str:
    root = Path(__file__).parents[1]
    return content_key(*((root / name).read_text(encoding="utf-8") for name in CODE))


def registration_key(template: Template, surface: Surface, places: Mapping[str, tuple[NDArray, NDArray]]) -> str | None:
    """Return the digest of the code, the template's neutral skin and landmarks, and the avatar's; shapes do not count.

    None where the code cannot be read, as in an archive.
    """
    try:
        parts: list[str | NDArray] = [_code()]
    except OSError:
        return None
    for skin, marks in ((template.surface, template.places), (surface, places)):
        parts += [skin.vertices, skin.faces]
        for name in sorted(marks):
            parts += [name, *marks[name]]
    for name in sorted(template.landmarks):
        parts += [name, template.landmarks[name]]
    return content_key(*parts)
