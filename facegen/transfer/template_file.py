"""A template from a file: any face with shapes and landmarks, a GLB or a folder of OBJ files.

Lengths of the method are those of a human-sized head in millimetres, so the file's face is brought to that size and
into those axes by its landmarks; what the parametric face knows of its jaw and eyes is measured on the shapes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.blendshapes.recipes import shape_set
from facegen.errors import FileError, InputError, nearest
from facegen.face.avatar_notes import Notes, read_notes
from facegen.face.face import load_face
from facegen.face.landmarks import REQUIRED
from facegen.fileio.avatar import AvatarFile, load_avatar
from facegen.fileio.kept import Kept
from facegen.fileio.shape_folder import load_shape_folder
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.transfer.alignment import align
from facegen.transfer.apart import take_apart
from facegen.transfer.halfway import half_name
from facegen.transfer.landmarks import Landmarks, check_places, load_landmarks, snap
from facegen.transfer.margins import LIDS, LIPS, Margins, facing_margins
from facegen.transfer.measured_motion import measured_gaze, measured_jaw
from facegen.transfer.piece_motion import PieceMotion
from facegen.transfer.same_pieces import TemplatePiece
from facegen.transfer.sides import settled, side_fields
from facegen.transfer.skin import lay_skin
from facegen.transfer.template import Template, TemplateShapes, template_of
from facegen.transfer.tongue import Tongue

LANDMARKS = "landmarks.yaml"
"""The landmarks' file in a folder of OBJ files."""

# Because a file's float32 are off by less than this share of a face.
_ROUNDING = 1e-5


@dataclass(frozen=True, eq=False)
class TemplateFile:
    """A file's face with its ``shapes``' names and ``landmarks``, read and checked; ``sets``: shape -> the vocabulary
    it belongs to, as far as the file notes it."""

    avatar: AvatarFile
    landmarks: Landmarks
    shapes: tuple[str, ...]
    sets: Mapping[str, str]

    def template(self, kept: Kept | None = None) -> Template:
        """Return it as a template. kept: where registrations are kept. Raises InputError for a mesh that cannot be
        used."""
        return _template(self, kept)


def read_template(path: str | Path, *, landmarks: str | Path | None = None,
                  shapes: Sequence[str] | None = None) -> TemplateFile:
    """Return the template in a .glb, .gltf or .vrm file with morph targets, or in a folder of OBJ files.

    landmarks: their file; without, those that facegen noted in the file, or ``landmarks.yaml`` in the folder. shapes:
    the names of those to use, all without. Raises FileError, TableError, or InputError: no shapes, no landmarks, wrong
    ones, unknown names.
    """
    path = Path(path)
    if not path.exists():
        raise FileError(f"template: expected a .glb, .gltf or .vrm file, or a folder of OBJ files, got '{path}', which "
                        "does not exist")
    avatar = load_shape_folder(path) if path.is_dir() else load_avatar(path)
    if not avatar.shapes:
        raise InputError(f"template: {path} has no shapes (morph targets) to transfer; give a rigged .glb, .gltf or "
                         ".vrm file, or a folder with neutral.obj and an OBJ file for each shape")
    halves = {half_name(name) for name in avatar.shapes}        # an avatar's own eyes decide what corrects its lids
    names = tuple(name for name in avatar.shapes if name not in halves) if shapes is None else \
        tuple(dict.fromkeys(shapes))
    if not names:
        raise InputError("shapes: expected one or more names, got none")
    for name in names:
        if name not in avatar.shapes:
            raise InputError(f"shapes: the template {path.name} has no shape {name!r}"
                             f"{nearest(str(name), avatar.shapes)}")
    notes = read_notes(avatar.notes, str(path))
    return TemplateFile(avatar, _landmarks(avatar, path, landmarks), names,
                        {name: kind for name, kind in notes.sets.items() if name in names})


def _landmarks(avatar: AvatarFile, path: Path, given: str | Path | None) -> Landmarks:
    """Return the landmarks of a template: from a file, the folder, or the notes."""
    if given is None and path.is_dir():
        given = path / LANDMARKS
        if not given.is_file():
            raise InputError(f"template: {path} has no {LANDMARKS}; put it there, or give the landmarks' file "
                             "(--template-landmarks)")
    if given is not None:
        return load_landmarks(given, avatar.mesh, mesh_name="" if path.is_dir() else path.name, digest=avatar.digest)
    notes = read_notes(avatar.notes, str(path))
    if not notes.landmarks:
        raise InputError(f"template: {path} carries no landmarks (facegen notes them when it rigs a file); give their "
                         "file (--template-landmarks)")
    missing = [name for name in REQUIRED if name not in notes.landmarks]
    if missing:
        raise InputError(f"template: {path}: the noted landmarks {', '.join(missing)} are missing; give their file "
                         "(--template-landmarks)")
    try:
        found = _noted(notes, avatar.mesh)
        check_places(found, avatar.mesh)
    except InputError as error:
        raise InputError(f"template: {path}: {error}") from None
    return found


def _noted(notes: Notes, mesh: Mesh) -> Landmarks:
    """Return the places of a mesh that notes mean: on the skin, where that is as near as what lies on it."""
    points = (np.array(list(notes.landmarks.values())) - notes.offset) @ notes.rotation / notes.scale
    found = snap(dict(zip(notes.landmarks, points, strict=True)), mesh)
    skin = [mesh.parts.index(part) for part in notes.parts("skin") if part in mesh.parts]
    rows = np.flatnonzero(np.isin(mesh.face_parts, skin))
    if not len(rows):
        return found
    feet = ClosestPoints(Surface(mesh.vertices, mesh.faces[rows]))(points)
    beside = ~np.isin(found.faces, rows) & (feet.distances <= _ROUNDING * np.ptp(points, axis=0).max())
    faces = np.where(beside, rows[feet.faces], found.faces)
    weights = np.where(beside[:, None], feet.weights, found.barycentric)
    return Landmarks(found.names, faces, mesh.faces[faces].astype(np.int64), weights)


def _template(file: TemplateFile, kept: Kept | None) -> Template:
    mesh, landmarks = file.avatar.mesh, file.landmarks
    base = load_face()
    home = base.landmark_points(base.mesh(0).vertices, detail=0)
    frame = align(landmarks.points(mesh.vertices), home)
    parts = take_apart(mesh, landmarks, frame)
    first = np.full(len(parts.vertices), len(mesh.vertices))
    np.minimum.at(first, parts.own, np.arange(len(mesh.vertices)))
    corrects = {name: recipe.minus for name, recipe in shape_set("all").items()
                if recipe.minus in file.avatar.shapes and name in file.shapes}
    names = tuple(dict.fromkeys([*file.shapes, *corrects.values()]))
    every = tuple(dict.fromkeys([*names, *file.avatar.shapes]))        # the jaw is known by the shape that opens it
    motion = np.stack([frame.apply_vectors(file.avatar.shapes[name][first]) for name in every])
    minus = tuple(names.index(corrects[name]) if name in corrects else -1 for name in names)
    # A corrective is told as the pose that it leads to: lips that close over an open jaw do not go through each other.
    for row, other in enumerate(minus):
        if other >= 0:
            motion[row] += motion[other]
    pieces = PieceMotion(parts.pieces, parts.vertices, parts.faces, parts.points)
    hinge, jaw, share = measured_jaw(pieces, motion)
    motion, jaw = motion[:len(names)], jaw[:len(names)]
    own: dict[str, TemplatePiece] = {}
    for kind in dict.fromkeys(piece.kind for piece in pieces.pieces if piece.kind != "skin"):
        rows = pieces.rows(kind)
        of_jaw = np.ones(len(rows)) if kind == "tongue" else share[rows]
        with_jaw = 0.0 if hinge is None else of_jaw[:, None] * hinge.movement(pieces.vertices[rows], jaw)
        own[kind] = TemplatePiece(pieces.surface(kind), motion[:, rows] - with_jaw, of_jaw)
    tongue = Tongue(own["tongue"].surface, own["tongue"].motion, pieces.face) if "tongue" in own else None
    places = parts.places([name for name in landmarks.names if not name.startswith("eye_center")])
    places = settled(parts.surface, places, side_fields(parts.surface, places))
    points = {name: weights @ parts.surface.vertices[rows] for name, (rows, weights) in places.items()}
    shapes = TemplateShapes(motion[:, parts.rows], jaw, measured_gaze(pieces, motion), tongue, own)
    return Template(file.avatar.path.stem, parts.surface, points, places, names, hinge, share[parts.rows], minus,
                    lambda: shapes, _margins(parts.surface, places, kept))


@cache
def _base() -> Template:
    return template_of(load_face(), {name: recipe for name, recipe in shape_set("arkit").items() if name == "jawOpen"})


def _margins(surface: Surface, places: Mapping[str, tuple[NDArray, NDArray]], kept: Kept | None) -> dict[str, Margins]:
    """Return the edges of the skin's slits: as facegen's own face has them, which knows the way between landmarks. A
    cat's upper lip goes down and up between the corner and the middle of its mouth."""
    skin = lay_skin(_base(), surface, places, kept=kept)
    found = {slit.name: facing_margins(skin, slit) for slit in (*LIDS, LIPS)}
    return {name: both[1].on(surface.vertices) for name, both in found.items() if both is not None}
