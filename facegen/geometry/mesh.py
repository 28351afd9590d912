"""The one mesh type: triangles with a material each and named parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh; +x is the subject's left, +y up, +z forward.

    vertices: (n, 3) float64, millimetres for the shipped faces. faces: (m, 3) int32, counter-clockwise seen
    from outside. ``face_materials`` (m,) and ``face_parts`` (m,) index ``materials`` and ``parts``. ``colours``: (n, 3)
    float32, sRGB 0..255 of each vertex, drawn instead of the materials' own; None where there are none.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    materials: tuple[str, ...]
    face_materials: NDArray[np.int32]
    parts: tuple[str, ...]
    face_parts: NDArray[np.int32]
    colours: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        for name, dtype in (("vertices", np.float64), ("faces", np.int32), ("face_materials", np.int32),
                            ("face_parts", np.int32)):
            array = np.array(getattr(self, name), dtype=dtype, order="C")    # a copy: the caller keeps theirs
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if self.colours is not None:
            colours = np.array(self.colours, dtype=np.float32, order="C")
            if colours.shape != self.vertices.shape:
                raise InputError(f"colours: expected shape {self.vertices.shape}, got {colours.shape}")
            if not ((colours >= 0) & (colours <= 255)).all():
                raise InputError("colours: expected sRGB values 0..255, got others")
            colours.flags.writeable = False
            object.__setattr__(self, "colours", colours)
        m = len(self.faces)
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3:
            raise InputError(f"vertices: expected shape (n, 3), got {self.vertices.shape}")
        if self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise InputError(f"faces: expected shape (m, 3), got {self.faces.shape}; "
                             "split polygons into triangles")
        if m and (self.faces.min() < 0 or self.faces.max() >= len(self.vertices)):
            raise InputError(f"faces: indices must lie in 0..{len(self.vertices) - 1}, "
                             f"got {self.faces.min()}..{self.faces.max()}")
        if self.face_materials.shape != (m,) or self.face_parts.shape != (m,):
            raise InputError(f"face_materials, face_parts: expected shape ({m},), one entry a triangle, "
                             f"got {self.face_materials.shape} and {self.face_parts.shape}")
        for name, names in (("materials", self.materials), ("parts", self.parts)):
            used = getattr(self, f"face_{name}")
            if m and (used.min() < 0 or used.max() >= len(names)):
                raise InputError(f"face_{name}: entries must index {name}, 0..{len(names) - 1}, "
                                 f"got {used.min()}..{used.max()}")

    @classmethod
    def of(cls, vertices, faces, *, material: str = "skin", part: str = "skin") -> Mesh:
        """Return a mesh of one part and one material."""
        zeros = np.zeros(len(faces), dtype=np.int32)
        return cls(np.asarray(vertices), np.asarray(faces).reshape(-1, 3), (material,), zeros, (part,), zeros)

    def with_vertices(self, vertices) -> Mesh:
        """Return the same mesh with other positions, (n, 3)."""
        vertices = np.asarray(vertices, dtype=np.float64)
        if vertices.shape != self.vertices.shape:
            raise InputError(f"vertices: expected shape {self.vertices.shape}, got {vertices.shape}")
        return replace(self, vertices=vertices)

    def part_vertices(self, part: str) -> NDArray[np.int32]:
        """Return the sorted indices of the vertices that the triangles of a part use."""
        if part not in self.parts:
            raise InputError(f"part: expected one of {', '.join(self.parts)}, got {part!r}")
        return np.unique(self.faces[self.face_parts == self.parts.index(part)])


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Return the meshes side by side as one; equal part and material names become one entry.

    Colours of vertices are kept if all meshes have them.
    """
    if not meshes:
        raise InputError("meshes: expected at least one mesh, got none")
    parts = tuple(dict.fromkeys(p for m in meshes for p in m.parts))
    materials = tuple(dict.fromkeys(x for m in meshes for x in m.materials))
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes])
    face_materials = [np.array([materials.index(x) for x in m.materials], int)[m.face_materials]
                      for m in meshes]
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + o for m, o in zip(meshes, offsets, strict=False)]),
        materials,
        np.concatenate(face_materials),
        parts,
        np.concatenate([np.array([parts.index(p) for p in m.parts], int)[m.face_parts] for m in meshes]),
        None if any(m.colours is None for m in meshes) else np.concatenate([m.colours for m in meshes]),
    )
