"""Write an avatar: OBJ with parts and materials, MTL with colours, and the landmarks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.obj import format_obj
from facegen.fileio.textfile import whole_file
from facegen.geometry.mesh import Mesh

SOURCE = "own work of the facegen authors, MIT"


def save_avatar(
    folder: Path,
    name: str,
    mesh: Mesh,
    colours: Mapping[str, tuple[int, int, int]],
    landmarks: Mapping[str, int],
    *,
    about: str,
    decimals: int,
) -> None:
    """Write ``name.obj``, ``name.mtl`` and ``landmarks.yaml``. colours: sRGB 0..255 of every material."""
    text = format_obj(mesh, comment=f"facegen: {about}\nSource: {SOURCE}, made by author.py.", decimals=decimals)
    head, _, rest = text.partition("\nv ")
    _write(folder / f"{name}.obj", f"{head}\nmtllib {name}.mtl\nv {rest}")
    lines = [f"# facegen: {about} Source: {SOURCE}."]
    for material in mesh.materials:
        shine = 0.6 if material in ("iris", "pupil", "limbus", "sclera") else 0.05
        kd = " ".join(f"{c / 255:.4f}" for c in colours[material])
        lines += [f"newmtl {material}", f"Kd {kd}", f"Ks {shine} {shine} {shine}", "Ns 40", ""]
    _write(folder / f"{name}.mtl", "\n".join(lines))
    lines = [
        f"# Landmarks of {name}.obj: a number is a vertex (0-based), three numbers a place, snapped to the surface.",
        "# Left and right are the animal's own.",
        f"source: {SOURCE}",
        f"mesh: {name}.obj",
        "landmarks:",
    ]
    lines += [f"  {mark}: {where}" for mark, where in landmarks.items()]
    _write(folder / "landmarks.yaml", "\n".join(lines) + "\n")


def _write(path: Path, text: str) -> None:
    with whole_file(path) as draft:
        draft.write_text(text, encoding="utf-8")


def both_sides(mesh: Mesh, left: Mapping[str, NDArray]) -> dict[str, int]:
    """Return the landmarks' vertices on both sides from places on the left half.

    left: name (``_L`` or of the middle) -> place (3,), which becomes the vertex there. ``eye_center_L`` lies
    on the eyeball.
    """
    out = {}
    for name, place in left.items():
        for side, sign in (("_L", 1.0), ("_R", -1.0)) if name.endswith("_L") else (("", 1.0),):
            at = np.asarray(place, float) * (sign, 1.0, 1.0)
            key = name.removesuffix("_L") + side
            rows = mesh.part_vertices(f"eye{side}" if name.startswith("eye_center") else "skin")
            out[key] = int(rows[np.argmin(np.linalg.norm(mesh.vertices[rows] - at, axis=1))])
    return out
