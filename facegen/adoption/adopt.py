"""The door: a head's mesh and landmarks in, a folder with a parametric face out."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facegen.adoption.base import base_face
from facegen.adoption.checks import check_head
from facegen.adoption.colours import colours_of
from facegen.adoption.data import face_data, landmark_data
from facegen.adoption.own import own_parts
from facegen.adoption.parts import eyes_of, parts_of
from facegen.adoption.residual import Residual, residual_of
from facegen.adoption.shape import shape_of
from facegen.adoption.space import space_between
from facegen.adoption.write import check_folder, save_folder, yaml_text
from facegen.facs.yamlfile import read_data
from facegen.fileio.avatar import AvatarFile, load_avatar
from facegen.fileio.obj import format_obj
from facegen.geometry.mesh import Mesh, merge
from facegen.geometry.operators import Surface
from facegen.transfer.alignment import Similarity, align
from facegen.transfer.apart import Apart, take_apart
from facegen.transfer.landmarks import Landmarks, check_places, load_landmarks
from facegen.transfer.pieces import describe
from facegen.transfer.rig import avatar_files

# Of a face's places those that a whole head is near to, and how far (mm) the farthest may be before one should look.
_REACHED, _FAR = 0.9, 5.0


@dataclass(frozen=True, eq=False)
class Adopted:
    """``path`` of the folder, ``warnings``, ``frame``: from the mesh's axes and units to the face's millimetres,
    ``residual``: how near the face comes to the head, ``pieces``: a row for each piece of the mesh, ``eye_size``: of
    the eyeballs, times the base face's."""

    path: Path
    warnings: tuple[str, ...]
    frame: Similarity
    residual: Residual
    pieces: tuple[dict[str, object], ...]
    eye_size: float


@dataclass(frozen=True, eq=False)
class Made:
    """A face before it is written: ``files``: name -> text. The rest as in `Adopted`."""

    files: Mapping[str, str]
    frame: Similarity
    residual: Residual
    apart: Apart
    warnings: tuple[str, ...]
    eye_size: float


def adopt(head: str | Path, output: str | os.PathLike[str], *, landmarks: str | Path | None = None,
          name: str | None = None, hair: bool = False, pieces: Mapping[str, str] | None = None, force: bool = False
          ) -> Adopted:
    """Make a parametric face out of a human head's mesh and write its folder.

    head: the path of a .obj, .glb, .gltf, .vrm, .ply or .stl file, or the name of a shipped avatar. output: a folder,
    new or empty; with ``force`` one that holds a face is replaced. landmarks: their file (docs/landmarks.md); a shipped
    avatar has its own. name: the face's; the folder's without.
    hair: give a head without hair the base face's. pieces: part, material or number of a component -> kind, as in
    `rig`. Raises InputError and its children; nothing is written then. ::

        facegen.adopt("me.obj", "me", landmarks="me.yaml")
        facegen.load_face("me").pose("happiness")
    """
    folder = check_folder(output, force=force)
    path, marked = avatar_files(head, landmarks, what="head")
    source = load_avatar(path)
    marks = load_landmarks(marked, source.mesh, mesh_name=path.name, digest=source.digest)
    made = make_face(source, marks, name=name or folder.resolve().name, hair=hair, pieces=pieces,
                     origin=f"made of {path.name} by facegen adopt")
    save_folder(folder, made.files)
    return Adopted(folder, made.warnings, made.frame, made.residual, tuple(describe(made.apart.pieces)), made.eye_size)


def make_face(source: AvatarFile, landmarks: Landmarks, *, name: str, origin: str, hair: bool = False,
              pieces: Mapping[str, str] | None = None) -> Made:
    """Return the files of the face that a head and its landmarks make; see `adopt`. origin: what the face's ``source``
    says. Raises InputError."""
    base, mesh = base_face(), source.mesh
    warnings = check_places(landmarks, mesh)
    frame = align(landmarks.points(mesh.vertices), base.landmarks)
    apart = take_apart(mesh, landmarks, frame, explicit=pieces)
    places = apart.places(base.coarse_places)
    check_head(apart, base)
    shape = shape_of(base, apart.surface, places)
    space = space_between(base.cage.vertices, shape.cage)
    eyes = eyes_of(base, shape, space)
    parts, bite = parts_of(base, shape, space, eyes)
    own = own_parts(mesh, apart, {"skin", *parts})
    entries = [entry for entry in base.data["parts"]
               if entry["part"] not in own and (entry["part"] != "hair" or hair)]
    kept = {entry["part"]: parts[entry["part"]] for entry in entries} | own
    entries = [*({**entry, "file": "parts.obj"} for entry in entries), *(
        {"file": "parts.obj", "part": part, "carried_by": "skin"} for part in own)]
    for entry in entries:
        if "fades" in entry:
            entry["fades"] = np.round(space([[0.0, y, 10.0] for y in entry["fades"]])[:, 1], 3).tolist()
    data = face_data(base, shape, space, eyes, bite, name=name, source=origin, parts=entries)
    colours = colours_of(source, apart, own)
    data |= {"colours": colours} if colours else {}
    marks = landmark_data(base, read_data(base.folder / "landmarks.yaml")["landmarks"], space,
                          {part: one.vertices for part, one in kept.items()}, eyes, apart.points)
    skin = Mesh(shape.surface, base.surface.faces, base.cage.materials, base.cage.face_materials[base.parents],
                ("skin",), np.zeros(len(base.surface.faces), np.int32))
    about = (f"{name}: {origin}. Millimetres, +x subject's left, +y up, +z forward; the size is the base face's.\n"
             "docs/faces.md explains the keys. Vertices are counted from 0 in cage.obj, which is the base face's cage.")
    files = {"cage.obj": format_obj(base.cage.with_vertices(shape.cage), comment=about.splitlines()[0]),
             "surface.obj": format_obj(skin, comment="The cage's surface at level 3, with what the cage leaves out."),
             "parts.obj": format_obj(merge(list(kept.values()))), "face.yaml": yaml_text(about, data),
             "landmarks.yaml": yaml_text("Landmarks; docs/landmarks.md lists the names.",
                                         {"source": origin, "mesh": "cage.obj", "landmarks": marks})}
    residual = residual_of(Surface(shape.surface, base.surface.faces), base, apart.surface, shape.partners)
    return Made(files, frame, residual, apart, (*warnings, *apart.skin.notes, *doubts(residual)),
                eyes.size)


def doubts(residual: Residual) -> list[str]:
    """Return what is to be said of a face that does not come near its head."""
    if residual.reached >= _REACHED and residual.largest <= _FAR:
        return []
    return [f"the face does not follow the head everywhere: {100 * (1 - residual.reached):.0f} in 100 of its places "
            f"have none of the head near, the farthest of the others is {residual.largest:.1f} mm away; look at it "
            "(--preview), at the landmarks, and whether the skin has holes"]
