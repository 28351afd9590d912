"""Wavefront OBJ: objects, materials, triangles; the order of vertices and faces is kept."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from facegen.errors import FileError
from facegen.geometry.mesh import Mesh


def load_obj(path: str | Path) -> Mesh:
    """Return the mesh of an OBJ file.

    Reads ``v``, ``f``, ``o``/``g`` (parts) and ``usemtl`` (materials), whose names run to the end of the
    line; other lines are skipped. Faces of more than three corners are split into fans. FileError if the file
    is missing or a line makes no sense.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        raise FileError(f"mesh: cannot read {path} as an OBJ file ({error})") from None
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    parts: dict[str, int] = {}
    materials: dict[str, int] = {}
    face_parts: list[int] = []
    face_materials: list[int] = []
    part, material = "skin", "skin"
    for number, line in enumerate(text.split("\n"), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            if words[0] == "v":
                vertex = [float(w) for w in words[1:4]]
                if len(vertex) < 3 or not all(map(math.isfinite, vertex)):
                    raise ValueError("expected three finite numbers")
                vertices.append(vertex)
            elif words[0] in ("o", "g", "usemtl"):
                if len(words) < 2:
                    raise ValueError("expected a name")
                name = line.split(None, 1)[1].strip()
                part, material = (part, name) if words[0] == "usemtl" else (name, material)
            elif words[0] == "f":
                corners = [int(w.split("/", 1)[0]) for w in words[1:]]
                corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
                if len(corners) < 3 or min(corners) < 0 or max(corners) >= len(vertices):
                    raise ValueError("expected three or more vertices that came before")
                for i in range(1, len(corners) - 1):
                    faces.append((corners[0], corners[i], corners[i + 1]))
                    face_parts.append(parts.setdefault(part, len(parts)))
                    face_materials.append(materials.setdefault(material, len(materials)))
        except ValueError as error:
            text, why = line.strip()[:60], str(error)[:80]
            raise FileError(f"mesh: {path}, line {number}: {text!r} is no OBJ line ({why})") from None
    if not faces:
        raise FileError(f"mesh: {path} holds no faces; expected an OBJ file with v and f lines")
    return Mesh(np.array(vertices), np.array(faces), tuple(materials), np.array(face_materials), tuple(parts),
                np.array(face_parts))


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
