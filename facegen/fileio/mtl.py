"""Material libraries of Wavefront OBJ: the diffuse colours."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from facegen.errors import FileError
from facegen.fileio.binfile import read_bytes
from facegen.fileio.textlines import lines_of


def read_colours(obj: Path, libraries: Iterable[str]) -> dict[str, tuple[float, ...]]:
    """Return sRGB 0..255 of each material in an OBJ file's libraries, as far as they can be read.

    A library that is missing, or lies outside the OBJ file's folder, is left out: colours are not what an avatar is
    rigged by.
    """
    colours: dict[str, tuple[float, ...]] = {}
    for line in dict.fromkeys(libraries):
        for name in _names(obj.parent, line):
            try:
                raw = read_bytes(obj.parent / name, what="material library", kind="an MTL file")
            except FileError:
                continue
            colours.update(_colours(lines_of(raw)))
    return colours


def _names(folder: Path, line: str) -> list[str]:
    """Return the files that a ``mtllib`` line means: one whose name may have spaces, or several."""
    def inside(name: str) -> bool:
        try:
            return (folder / name).resolve().is_relative_to(folder.resolve()) and (folder / name).is_file()
        except (OSError, ValueError, RuntimeError):
            return False

    return [name for name in ([line] if inside(line) else line.split()) if inside(name)]


def _colours(lines: Iterable[str]) -> dict[str, tuple[float, ...]]:
    result, material = {}, None
    for line in lines:
        words = line.split()
        if len(words) > 1 and words[0] == "newmtl":
            material = line.split(None, 1)[1].strip()
        elif len(words) > 1 and words[0] == "Kd" and material is not None:
            try:
                values = [float(word) for word in words[1:4]]
            except ValueError:
                continue                            # "Kd spectral file": no colour
            values = values * 3 if len(values) == 1 else values
            if len(values) == 3 and all(map(math.isfinite, values)):
                result[material] = tuple(min(max(value, 0.0), 1.0) * 255.0 for value in values)
    return result
