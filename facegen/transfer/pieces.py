"""The pieces of an avatar: which of its components are skin, eyes, teeth, tongue, hair, and so on.

The paper takes one connected face for granted (Onizuka et al. 2018, section 5). Avatars come in dozens of components;
each has to be moved as what it is. What a component is, we read from where it lies relative to the landmarks and from
its shape; its names are evidence that must fit the place; what the user says wins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import InputError, nearest
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.transfer.components import Components
from facegen.transfer.piece_kinds import kinds_by_place, skin_components
from facegen.transfer.piece_names import KINDS

# A part's name speaks for a component if it covers this share of its triangles.
_MOST = 0.5


@dataclass(frozen=True, eq=False)
class Piece:
    """One component of an avatar, or all of its skin.

    ``kind``: one of `KINDS`. ``name``: what the file calls it. ``vertices`` (p,): sorted indices; ``faces`` (q,): rows
    of the triangle list. ``components``: their numbers, in the order of their first triangle. ``why``: the reason.
    """

    kind: str
    name: str
    vertices: NDArray[np.int64]
    faces: NDArray[np.int64]
    components: tuple[int, ...] = ()
    why: str = ""


def face_names(mesh: Mesh) -> list[str]:
    """Return a name for every triangle of a mesh, its part's and its material's: "head|skin"."""
    pairs = [[f"{part}|{material}" for material in mesh.materials] for part in mesh.parts]
    return [pairs[p][m] for p, m in zip(mesh.face_parts.tolist(), mesh.face_materials.tolist(), strict=True)]


def find_pieces(vertices: ArrayLike, faces: ArrayLike, points: Mapping[str, ArrayLike], *,
                names: Sequence[str] | None = None, explicit: Mapping[str, str] | None = None) -> tuple[Piece, ...]:
    """Return the pieces: the skin first, then the others by their first triangle.

    vertices (n, 3), welded, in the template's frame, mm; faces (m, 3). points: landmarks, name -> place (3,), at least
    the required ones. names: of each triangle, as `face_names` gives. explicit: part, material or number of a
    component -> kind, which overrules everything. Raises InputError: unknown parts or kinds, no skin left.
    """
    vertices, faces = np.asarray(vertices, float), np.asarray(faces, np.int64).reshape(-1, 3)
    if not len(faces) or vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
        raise InputError("vertices, faces: expected finite vertices (n, 3) and at least one triangle")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"faces: indices must lie in 0..{len(vertices) - 1}, got {faces.min()}..{faces.max()}")
    if names is not None and len(names) != len(faces):
        raise InputError(f"names: expected one for each of {len(faces)} triangles, got {len(names)}")
    _, of_vertex = Surface(vertices, faces).components()
    parts = Components.of(vertices, faces, of_vertex, names)
    given = _explicit(explicit or {}, parts)
    places = {name: np.asarray(place, float) for name, place in points.items()}
    skin, carried = skin_components(parts, places, given)
    kinds = kinds_by_place(parts, places, skin, given)
    found = [_piece("skin", parts, sorted(skin), _skin_reason(skin, carried, given))]
    found += [_piece(kind, parts, [c], why) for c, (kind, why) in sorted(kinds.items())]
    return tuple(found)


def describe(pieces: Sequence[Piece]) -> list[dict[str, object]]:
    """Return a row for each piece, or for several alike: name, kind, triangles, components, why."""
    rows: dict[tuple[str, str, str], dict[str, object]] = {}
    for piece in pieces:
        row = rows.setdefault((piece.name, piece.kind, piece.why), {
            "name": piece.name, "kind": piece.kind, "triangles": 0, "components": (), "why": piece.why})
        row["triangles"] += len(piece.faces)
        row["components"] += piece.components
    return list(rows.values())


def _piece(kind: str, parts: Components, numbers: list[int], why: str) -> Piece:
    rows = np.sort(np.concatenate([parts.faces_of(c) for c in numbers]))
    vertices = np.sort(np.concatenate([parts.vertices_of(c) for c in numbers]))
    names = dict.fromkeys(parts.name(c) for c in numbers)
    return Piece(kind, ", ".join(n for n in names if n)[:80], vertices, rows, tuple(numbers), why)


def _skin_reason(skin: frozenset[int], carried: Mapping[int, int], given: Mapping[int, str]) -> str:
    count = sum(carried.get(c, 0) for c in skin)
    return f"carries {count} landmarks" if count else "given"


def _explicit(explicit: Mapping[str, str], parts: Components) -> dict[int, str]:
    """Return component -> kind as the user says; InputError for unknown names and kinds."""
    fields: dict[str, list[int]] = {}
    for code, name in enumerate(parts.names):
        for field in dict.fromkeys([name, *name.split("|")]):
            fields.setdefault(field, []).append(code)
    result: dict[int, str] = {}
    for key, kind in explicit.items():
        key = str(key)
        if kind not in KINDS:
            raise InputError(f"pieces: unknown kind {kind!r} for {key!r}{nearest(str(kind), KINDS)} "
                             f"(known: {', '.join(KINDS)})")
        if key in fields and key:
            share = parts.name_share[:, fields[key]].sum(axis=1)
            own = np.flatnonzero(share > _MOST)
            if not len(own):
                whole = parts.name(int(share.argmax()))
                raise InputError(f"pieces: '{key}' is no piece of its own: its triangles are joined to '{whole}'; "
                                 "separate them in the file, or name the whole piece")
            result.update((int(c), kind) for c in own)
        elif key.isdecimal() and int(key) < parts.count:
            result[int(key)] = kind
        else:
            raise InputError(f"pieces: the avatar has no part, material or component {key!r}{nearest(key, fields)} "
                             f"(components: 0..{parts.count - 1})")
    return result
