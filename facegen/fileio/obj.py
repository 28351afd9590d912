"""Wavefront OBJ: objects, materials, triangles; the order of vertices and faces is kept."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError
from facegen.fileio.binfile import read_bytes
from facegen.fileio.fans import fans
from facegen.fileio.textlines import lines_of
from facegen.geometry.mesh import Mesh

# What follows a corner's first index: "/4/7" or "//7".
_REST_OF_CORNER = re.compile(r"/\S*")
# Colours of a vertex are 0..1 in most programs; whoever writes 0..255 has a number above this.
_LARGEST_UNIT_COLOUR = 1.0


@dataclass(frozen=True, eq=False)
class ObjFile:
    """What one OBJ file says. ``colours``: (n, 3) sRGB 0..255 of "v x y z r g b" lines, if all have them.

    ``polygons``: the faces as they stand there, all their corners' vertices and how many each has; the mesh has them in
    triangles. ``libraries``: what follows ``mtllib``, line by line. ``raw``: the file's bytes.
    """

    mesh: Mesh
    polygons: tuple[NDArray[np.int64], NDArray[np.int64]]
    colours: NDArray[np.float64] | None
    libraries: tuple[str, ...]
    raw: bytes


def load_obj(path: str | Path) -> Mesh:
    """Return the mesh of an OBJ file.

    Reads ``v``, ``f``, ``o``/``g`` (parts) and ``usemtl`` (materials), whose names run to the end of the
    line; other lines are skipped. Faces of more than three corners are split into fans, from the first corner unless
    a triangle would lie outside a concave face. UTF-8, or Latin-1 where it is none. FileError if the file
    is missing or a line makes no sense.
    """
    return read_obj(path).mesh


def read_obj(path: str | Path) -> ObjFile:
    """Return the mesh of an OBJ file with its colours and text; see `load_obj`. Raises FileError."""
    path = Path(path)
    raw = read_bytes(path, what="mesh", kind="an OBJ file")
    return _Reader(path, raw).result()



class _Reader:
    """Collects words line by line and turns them into numbers all at once, which is several times faster."""

    def __init__(self, path: Path, raw: bytes) -> None:
        self.path, self.raw = path, raw
        self.vertices: list[list[str]] = []         # the words of each "v" line
        self.vertex_lines: list[int] = []
        self.corners: list[str] = []                # the words of all "f" lines
        self.sizes: list[int] = []                  # corners of each face
        self.before: list[int] = []                 # vertices above each face
        self.face_lines: list[int] = []
        self.parts: dict[str, int] = {}
        self.materials: dict[str, int] = {}
        self.face_parts: list[int] = []
        self.face_materials: list[int] = []
        self.libraries: list[str] = []
        self.lines = lines_of(raw)

    def result(self) -> ObjFile:
        self._collect()
        vertices = self._positions()
        if not self.sizes:
            raise FileError(f"mesh: {self.path} holds no faces; expected an OBJ file with v and f lines")
        corners, sizes = self._indices(), np.array(self.sizes)
        triangles, owner = fans(vertices, corners, sizes)
        mesh = Mesh(vertices, triangles, tuple(self.materials), np.array(self.face_materials)[owner],
                    tuple(self.parts), np.array(self.face_parts)[owner])
        return ObjFile(mesh, (corners, sizes), self._colours(), tuple(self.libraries), self.raw)

    def _collect(self) -> None:
        part, material = "skin", "skin"
        part_index = material_index = -1            # unknown until a face uses the name
        lines = iter(enumerate(self.lines, 1))
        for number, line in lines:
            words = line.split()
            if not words or words[0][0] == "#":
                continue
            if words[-1][-1] == "\\":
                words = _continued(words, lines)
                line = " ".join(words)
                if not words:
                    continue
            head = words[0]
            if head == "v":
                self.vertices.append(words)
                self.vertex_lines.append(number)
            elif head == "f":
                if len(words) < 4:
                    raise self._error(number, "expected three or more vertices that came before", line)
                if part_index < 0:
                    part_index = self.parts.setdefault(part, len(self.parts))
                if material_index < 0:
                    material_index = self.materials.setdefault(material, len(self.materials))
                self.corners += words[1:]
                self.sizes.append(len(words) - 1)
                self.before.append(len(self.vertices))
                self.face_lines.append(number)
                self.face_parts.append(part_index)
                self.face_materials.append(material_index)
            elif head in ("o", "g", "usemtl", "mtllib"):
                name = line.split(None, 1)[1].strip() if len(words) > 1 else ""
                if head == "mtllib":
                    self.libraries.append(name)
                elif not name:
                    raise self._error(number, "expected a name", line)
                elif head == "usemtl":
                    material, material_index = name, -1
                else:
                    part, part_index = name, -1

    def _positions(self) -> NDArray[np.float64]:
        try:
            flat = list(map(float, itertools.chain.from_iterable(words[1:4] for words in self.vertices)))
            vertices = np.array(flat).reshape(len(self.vertices), 3)
            if not np.isfinite(vertices).all():
                raise ValueError
        except ValueError:
            raise self._first_bad(self.vertices, self.vertex_lines, _check_vertex) from None
        return vertices

    def _colours(self) -> NDArray[np.float64] | None:
        """Return sRGB 0..255 (n, 3) if every "v" line ends in them, else None."""
        if not all(7 <= len(words) <= 8 for words in self.vertices):       # 8: "v x y z w r g b"
            return None
        try:
            colours = np.array([[float(word) for word in words[-3:]] for words in self.vertices])
        except ValueError:
            return None                             # not colours: some programs put other things there
        if not np.isfinite(colours).all():
            return None
        scale = 255.0 if colours.max() <= _LARGEST_UNIT_COLOUR else 1.0
        return np.clip(colours * scale, 0.0, 255.0)

    def _indices(self) -> NDArray[np.int64]:
        """Return the vertex of each corner of each face, counted from 0."""
        text = " ".join(self.corners)
        words = _REST_OF_CORNER.sub("", text).split() if "/" in text else self.corners
        before = np.repeat(self.before, self.sizes)
        try:
            if len(words) != len(self.corners):     # a corner such as "/1"
                raise ValueError
            corners = np.array(list(map(int, words)), dtype=np.int64)
            corners = np.where(corners > 0, corners - 1, before + corners)
            if (corners < 0).any() or (corners >= before).any():
                raise ValueError
        except (ValueError, OverflowError):
            ends = np.cumsum(self.sizes)
            faces = [(self.corners[end - size:end], known) for end, size, known in
                     zip(ends, self.sizes, self.before, strict=True)]
            raise self._first_bad(faces, self.face_lines, _check_face) from None
        return corners


    def _first_bad(self, items: Sequence, numbers: Sequence[int], check) -> FileError:
        for item, number in zip(items, numbers, strict=True):
            try:
                check(item)
            except (ValueError, OverflowError) as error:
                return self._error(number, str(error))
        return FileError(f"mesh: {self.path} cannot be read as an OBJ file")

    def _error(self, number: int, why: str, line: str = "") -> FileError:
        line = line or self.lines[number - 1]
        return FileError(f"mesh: {self.path}, line {number}: {line.strip()[:60]!r} is no OBJ line ({why[:80]})")


def _continued(words: list[str], lines) -> list[str]:
    """Return the words of a line that ends in a backslash together with those of the lines it goes on in."""
    while words and words[-1].endswith("\\"):
        words = [*words[:-1], *filter(None, [words[-1][:-1]])]
        following = next(lines, None)
        if following is None:
            break
        words += following[1].split()
    return words


def _check_vertex(words: Sequence[str]) -> None:
    vertex = [float(word) for word in words[1:4]]
    if len(vertex) < 3 or not all(map(math.isfinite, vertex)):
        raise ValueError("expected three finite numbers")


def _check_face(face: tuple[Sequence[str], int]) -> None:
    words, known = face
    for word in words:
        corner = int(word.split("/", 1)[0])
        if not 0 <= (corner - 1 if corner > 0 else known + corner) < known:
            raise ValueError("expected three or more vertices that came before")


def format_obj(mesh: Mesh, *, comment: str = "", decimals: int = 3) -> str:
    """Return a mesh as OBJ text, faces in their order, vertices rounded to ``decimals``."""
    lines = [f"# {line}" for line in comment.splitlines()]
    for v in np.round(mesh.vertices, decimals) + 0.0:       # + 0.0: no "-0.000"
        lines.append(" ".join(["v", *(f"{c:.{decimals}f}" for c in v)]))
    part = material = None
    for face, p, m in zip(mesh.faces, mesh.face_parts, mesh.face_materials, strict=True):
        if p != part:
            lines.append(f"o {mesh.parts[p]}")
        if p != part or m != material:
            lines.append(f"usemtl {mesh.materials[m]}")
        part, material = p, m
        lines.append("f " + " ".join(str(i + 1) for i in face))
    return "\n".join(lines) + "\n"
