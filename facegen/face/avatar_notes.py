"""What facegen wrote into an avatar's file when it rigged it: where the face is, and which shape is which."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from facegen.blendshapes.recipes import SETS
from facegen.face.landmarks import NAMES
from facegen.facs.validate import Entry

Array = NDArray[np.float64]

METRE = 1000.0      # glTF measures in metres, facegen in millimetres
_FARTHEST = 1e9     # of any number in a file's own units
_TURNED = 1e-3      # how far a rotation's rows may be from unit length and right angles: files round


@dataclass(frozen=True, eq=False)
class Notes:
    """The way from the file's axes and units to millimetres with +x the subject's left, +y up and +z forward, and what
    else is known.

    ``scale``, ``rotation`` (3, 3), ``offset`` (3,): y = scale * rotation @ x + offset. ``framed``: whether the file
    says so, or that of glTF is assumed. ``landmarks``: name -> place (3,) in millimetres. ``neck``: where the head
    turns, millimetres, or None. ``sets``: shape -> the set it belongs to. ``pieces``: part -> what it is ("skin",
    "eye_L", "body" ...), as far as noted. ``halves``: shape -> the shape that corrects it half way.
    """

    scale: float = METRE
    rotation: Array = field(default_factory=lambda: np.eye(3))
    offset: Array = field(default_factory=lambda: np.zeros(3))
    framed: bool = False
    landmarks: Mapping[str, Array] = field(default_factory=dict)
    neck: Array | None = None
    sets: Mapping[str, str] = field(default_factory=dict)
    pieces: Mapping[str, str] = field(default_factory=dict)
    halves: Mapping[str, str] = field(default_factory=dict)

    def parts(self, *kinds: str) -> tuple[str, ...]:
        """Return the parts whose kind begins with one of these."""
        return tuple(part for part, kind in self.pieces.items() if kind.startswith(kinds))

    def apply(self, points: Array) -> Array:
        """Return places (..., 3) of the file in millimetres."""
        return self.vectors(points) + self.offset

    def vectors(self, vectors: Array) -> Array:
        """Return movements (..., 3) of the file in millimetres."""
        return self.scale * (np.asarray(vectors, np.float64) @ self.rotation.T)


def read_notes(notes: Mapping, source: str, *, backward: bool = False) -> Notes:
    """Return the notes of a file, checked; none: what glTF says of axes and units. TableError names the file and key.

    backward: whether such files look to -z where nothing else is noted. Keys that a later facegen may add are passed
    over.
    """
    ahead = np.diag([-1.0, 1.0, -1.0]) if backward else np.eye(3)
    if not notes:
        return Notes(rotation=ahead)
    top = dict(Entry(notes, source, "facegen").items())
    scale, rotation, offset, framed = METRE, ahead, np.zeros(3), "frame" in top
    if framed:
        frame = top["frame"].fields(required=("scale", "rotation", "offset"))
        scale, rotation = frame["scale"].number(1e-12, _FARTHEST), _rotation(frame["rotation"])
        offset = np.array(frame["offset"].vector(_FARTHEST))

    def place(entry: Entry) -> Array:
        return scale * (rotation @ np.array(entry.vector(_FARTHEST))) + offset

    landmarks = {name: place(entry) for name, entry in top["landmarks"].items()} if "landmarks" in top else {}
    sets = {}
    for shape, entry in top["shapes"].items() if "shapes" in top else ():
        known = dict(entry.items())
        if "set" in known and known["set"].value in SETS:
            sets[shape] = known["set"].value

    def words(key: str) -> dict[str, str]:
        return {name: entry.value for name, entry in top[key].items() if isinstance(entry.value, str)} \
            if key in top else {}

    return Notes(scale, rotation, offset, framed, {name: landmarks[name] for name in NAMES if name in landmarks},
                 place(top["neck"]) if "neck" in top and top["neck"].value is not None else None, sets,
                 words("pieces"), words("halves"))


def _rotation(entry: Entry) -> Array:
    rows = entry.each()
    if len(rows) != 3:
        raise entry.wrong("three rows of three numbers")
    matrix = np.array([row.vector(1.0 + _TURNED) for row in rows])
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > _TURNED or np.linalg.det(matrix) < 0.0:
        raise entry.wrong("a rotation: rows of length one, at right angles, that do not mirror")
    return matrix
