"""From an avatar's file to a file with blendshapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from facegen.blendshapes.recipes import Recipe, shape_sets
from facegen.data import meshes_dir
from facegen.errors import FileError, InputError, nearest
from facegen.face.face import load_face
from facegen.fileio.avatar import AvatarFile, check_output, load_avatar, save_avatar
from facegen.fileio.kept import kept_in
from facegen.transfer.landmarks import check_places, load_landmarks
from facegen.transfer.pieces import describe
from facegen.transfer.template import Template, template_of
from facegen.transfer.transfer import Transferred, transfer

DEFAULT_SETS = ("units", "arkit", "visemes")
"""What an avatar gets unless told otherwise: the units make every expression, the others are what programs ask for."""


@dataclass(frozen=True, eq=False)
class Rigged:
    """``path`` of the file written, ``names`` of its shapes, ``warnings``, and ``found``: how the transfer went."""

    path: Path
    names: tuple[str, ...]
    warnings: tuple[str, ...]
    found: Transferred

    @property
    def pieces(self) -> list[dict[str, object]]:
        """A row for each piece: name, kind, triangles, components, why."""
        return describe(self.found.pieces)


@cache
def _shipped() -> Mapping[str, Path]:
    return {p.parent.name: p for p in sorted((meshes_dir() / "avatars").glob("*/*.obj")) if p.stem == p.parent.name}


def avatar_names() -> tuple[str, ...]:
    """Return the names of the shipped avatars."""
    return tuple(_shipped())


def rig(avatar: str | Path, output: str | Path, *, landmarks: str | Path | None = None,
        sets: Sequence[str] = DEFAULT_SETS, person: str | Path | None = None, method: str = "landmarks",
        opening: float = 1.0, pieces: Mapping[str, str] | None = None, normals: bool = True,
        quantise: bool = False, cache: bool = True) -> Rigged:
    """Give an avatar blendshapes and write it.

    avatar: the path of a .obj, .glb, .gltf, .vrm, .ply or .stl file, or a shipped avatar's name. output: .glb (or
    .gltf, .vrm), .npz, or a folder for a sequence of OBJ files. landmarks: their file; a shipped avatar has its own.
    sets: vocabularies, see `shape_sets`. person: whose habits override expressions. method, opening, pieces: as in
    `transfer`. normals, quantise: as in `save_avatar`. cache: use again how the skin was laid on the template, kept in
    the user's cache folder, if avatar, landmarks and pieces are the same. Raises InputError and its children; nothing
    is written then. ::

        facegen.rig("cat.obj", "cat.glb", landmarks="cat.yaml")
        facegen.load_face("cat.glb").pose("happiness")
    """
    path = _shipped().get(str(avatar), Path(avatar))
    if path.suffix == "" and not path.exists():
        raise FileError(f"avatar: expected a file, or one of {', '.join(_shipped())}, got {str(avatar)!r}"
                        f"{nearest(str(avatar), _shipped())}")
    marks = Path(landmarks) if landmarks is not None else path.with_name("landmarks.yaml") \
        if str(avatar) in _shipped() else None
    if marks is None:
        raise InputError(f"landmarks: expected the file of the avatar's landmarks, got none; write one with the places "
                         f"of eyes, brows, nose, mouth and chin on {path.name} (docs/landmarks.md lists the names)")
    recipes = shape_sets(sets, person)
    source = load_avatar(path)
    check_output(source, output, recipes)
    places = load_landmarks(marks, source.mesh, mesh_name=path.name, digest=source.digest)
    warnings = tuple(check_places(places, source.mesh))
    template = _template(tuple(recipes.items()))
    found = transfer(source.mesh, places, template, method=method, opening=opening, pieces=pieces,
                     kept=kept_in("registrations") if cache else None)
    shapes = {name: found.shapes[name] for name in recipes}
    shapes |= {half_name(name): moved for name, moved in found.halves.items()}
    expressions = {name: {name: 1.0} for name, recipe in recipes.items() if recipe.set == "vrm"}
    notes = _notes(source, places.points(source.mesh.vertices), found, recipes)
    written = save_avatar(source, output, shapes, notes=notes, normals=normals, quantise=quantise,
                          expressions=expressions if _is_vrm(source) else {})
    return Rigged(written, tuple(shapes), warnings + found.warnings, found)


@lru_cache(maxsize=1)         # many avatars with the same shapes; a template is tens of megabytes
def _template(recipes: tuple[tuple[str, Recipe], ...]) -> Template:
    return template_of(load_face(), dict(recipes))


def half_name(shape: str) -> str:
    """Return what the corrective of a shape half way is called in a file."""
    return f"{shape}_half"


def _is_vrm(source: AvatarFile) -> bool:
    return source.path.suffix.lower() == ".vrm"


def _notes(source: AvatarFile, points: Mapping[str, np.ndarray], found: Transferred,
           recipes: Mapping[str, Recipe]) -> dict[str, object]:
    """Return what facegen keeps in the file, to load it as a face: see facegen.face.avatar_notes."""
    kinds: dict[str, str] = {}
    for piece in found.pieces:
        parts = {source.mesh.parts[p] for p in np.unique(source.mesh.face_parts[piece.faces])}
        for part in parts:
            kinds[part] = "skin" if kinds.get(part, piece.kind) != piece.kind else piece.kind
    frame = found.frame
    return {
        "version": 1,
        "frame": {"scale": frame.scale, "rotation": frame.rotation.tolist(), "offset": frame.offset.tolist()},
        "landmarks": {name: at.tolist() for name, at in points.items()},
        **({"neck": points["neck"].tolist()} if "neck" in points else {}),
        "sets": sorted({recipe.set for recipe in recipes.values()}),
        "shapes": {name: {"set": recipe.set} for name, recipe in recipes.items()},
        **({"halves": {name: half_name(name) for name in found.halves}} if found.halves else {}),
        "pieces": kinds,
    }
