"""What can be wrong with landmarks by what they rest on: vertices, slits, and pieces that lie behind the skin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.geometry.mesh import Mesh
from facegen.transfer.piece_names import INSIDE, kind_of_name
from facegen.transfer.weld import weld

Array = NDArray[np.float64]

# Two places nearer than this share of the extent are one.
_SAME = 1e-7
# Lips and lids nearer to each other than this share of the extent are closed: height does not tell them apart.
_TOUCHES = 0.01
_COINCIDE = {
    frozenset({"mouth_inner_top", "mouth_inner_bottom"}): "mouth",
    frozenset({"mouth_top", "mouth_inner_top"}): "lip", frozenset({"mouth_bottom", "mouth_inner_bottom"}): "lip",
    **{frozenset({f"eye_upper{part}_{s}", f"eye_lower{part}_{s}"}): "eye"
       for s in "LR" for part in ("", "_inner", "_outer")},
}
_CANNOT = {
    "mouth": "this avatar's lips are one surface without an opening: its mouth moves but cannot open, and shapes that "
             "part the lips stay closed",
    "lip": "this lip has no edge of its own: it moves as a line and cannot be pressed, rolled or puckered in itself",
    "eye": "these lids are one surface without an opening: they cannot open or close over an eye",
}


def check_faces(names: Sequence[str], corners: NDArray, weights: Array, mesh: Mesh) -> None:
    """Raise InputError if landmarks do not fit a mesh's shape: corners it does not have, or what is not finite."""
    if corners.shape != (len(names), 3) or weights.shape != (len(names), 3) or not np.isfinite(weights).all():
        raise InputError(f"landmarks: expected three corners and three finite weights for each of {len(names)} names")
    if len(names) and not 0 <= corners.min() <= corners.max() < len(mesh.vertices):
        raise InputError(f"landmarks: use vertex {corners.max()}, the mesh has {len(mesh.vertices)}: "
                         "they belong to another mesh")
    if not np.isfinite(mesh.vertices).all():
        raise InputError("mesh: expected finite vertices")


def coincidences(p: dict[str, Array], corners: NDArray, weights: Array, mesh: Mesh) -> tuple[list[str], list[str]]:
    """Two names on one place. Closed lips and lids touch, and are still two surfaces: then nothing is wrong."""
    names, places = list(p), np.array(list(p.values()))
    extent = np.linalg.norm(np.ptp(places, axis=0))
    apart = np.sqrt(((places[:, None] - places) ** 2).sum(axis=2))
    # The vertices that a place rests on, one number for those a UV seam has split.
    _, same_vertex = weld(mesh.vertices, mesh.faces)
    rests = [frozenset(same_vertex[c[w > 1e-6]].tolist()) for c, w in zip(corners, weights, strict=True)]
    errors, warnings = [], []
    for i, j in zip(*np.nonzero(np.triu(apart <= _SAME * extent, 1)), strict=True):
        what = _COINCIDE.get(frozenset({names[i], names[j]}))
        if what is None:
            errors.append(f"'{names[i]}' and '{names[j]}' lie on one place; give each its own")
        elif rests[i] == rests[j]:
            warnings.append(f"'{names[i]}' and '{names[j]}' lie on one place: {_CANNOT[what]}")
    return errors, warnings


def on_pieces(names: Sequence[str], corners: NDArray, weights: Array, mesh: Mesh) -> list[str]:
    """Lids and lips that were set on what lies behind them, going by the names of parts and materials."""
    label = np.array([[kind_of_name(part), kind_of_name(material)] for part in mesh.parts
                      for material in mesh.materials] or [["", ""]]).reshape(len(mesh.parts), -1, 2)
    errors, own = [], {}
    for name, c, w in zip(names, corners, weights, strict=True):
        if name.startswith(("mouth_", "eye_")) and not name.startswith("eye_center"):
            touching = np.isin(mesh.faces, c[w > 1e-6]).sum(axis=1) >= (w > 1e-6).sum()
            kinds = label[mesh.face_parts[touching], mesh.face_materials[touching]]
            # One skin-like triangle is enough: where skin and eye are one mesh, the margin belongs to both.
            inside = [next((k for k in kind if k in INSIDE), "") for kind in kinds]
            behind = {"eye": {"eye"}, "mouth": {"teeth", "tongue"}}[name.split("_")[0]]
            if inside and all(kind in behind for kind in inside):
                row = np.flatnonzero(touching)[0]
                own.setdefault(mesh.parts[mesh.face_parts[row]], []).append(f"'{name}'")
    for part, wrong in own.items():
        errors.append(f"{', '.join(wrong)} {'lie' if len(wrong) > 1 else 'lies'} on '{part}'; set "
                      f"{'them' if len(wrong) > 1 else 'it'} on the skin: on the margin of the lid or the edge of the "
                      "lip, not on what lies behind")
    return errors


def touching(p: dict[str, Array], corners: NDArray, weights: Array, mesh: Mesh) -> list[str]:
    """Closed lips and lids whose landmarks are swapped: places that touch, told apart by the surface round each."""
    extent = np.linalg.norm(np.ptp(np.array(list(p.values())), axis=0))
    row = {name: i for i, name in enumerate(p)}
    errors = []
    for pair, what in _COINCIDE.items():
        high, low = sorted(pair, key=lambda name: "top" not in name and "upper" not in name)
        if what == "lip" or not pair <= row.keys() or np.linalg.norm(p[high] - p[low]) > _TOUCHES * extent:
            continue
        above, below = ("mouth_top", "mouth_bottom") if what == "mouth" else (f"brow_mid_{low[-1]}", low)
        if above not in p or below not in p:
            continue
        up = p[above] - p[below]
        around = []
        for name in (high, low):
            own = corners[row[name]][weights[row[name]] > 1e-6]
            touching = np.isin(mesh.faces, own).sum(axis=1) >= len(own)
            if touching.any():
                around.append(float((mesh.vertices[mesh.faces[touching]].mean(axis=(0, 1)) - p[name]) @ up))
        if len(around) == 2 and around[0] < 0 < around[1]:
            errors.append(f"'{high}' and '{low}' are swapped: the first is on what lies above the slit")
    return errors
