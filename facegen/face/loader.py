"""Read ``face.yaml``: the data of a face, validated, with the meshes it names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.errors import TableError, nearest
from facegen.face.attach import Attachment, attach
from facegen.face.deformer import Array, Deformer, Jaw, Lids, Region, region_weights
from facegen.face.folds import Fold
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data
from facegen.fileio.obj import load_obj
from facegen.geometry.mesh import Mesh
from facegen.geometry.subdivision import loop_levels

REQUIRED = ("name", "source", "cage", "centre_O", "measures", "scales", "points", "regions", "jaw", "eyes", "lids",
            "head")
OPTIONAL = ("sheets", "followers", "creases", "corners", "parts", "folds", "lid_follow", "head_half_height")
CARRIERS = ("skull", "skin", "jaw", "eye", "mouth")
ROLES = ("input", "jaw", "fixed")
_FARTHEST = 1e6     # mm: no face is larger


@dataclass(frozen=True, eq=False)
class FaceData:
    """A face as loaded; arrays in millimetres."""

    name: str
    source: str
    deformer: Deformer
    faces: NDArray[np.int32]
    materials: tuple[str, ...]
    face_materials: NDArray[np.int32]
    creases: NDArray[np.int32]
    corners: NDArray[np.int32]
    point_names: tuple[str, ...]
    point_index: Mapping[str, int]
    point_scale: Array
    scales: Mapping[str, Array]
    regions: tuple[Region, ...]
    eye_centres: Array
    lid_rims: tuple[NDArray[np.int32], ...]
    lid_skin: tuple[NDArray[np.int32], ...]
    lid_follow: Array           # (down or up, upper or lower lid): travel per degree of gaze
    head_pivot: Array
    head_weight: Callable[[Array], Array]
    head_half_height: float
    attachments: tuple[Attachment, ...]
    folds: Mapping[str, Fold]
    takes_input: NDArray[np.bool_]


def read_face(path: Path) -> FaceData:
    """Return the face that a ``face.yaml`` describes. TableError or FileError name the file and the key."""
    top = Entry(read_data(path), str(path)).fields(required=REQUIRED, optional=OPTIONAL)
    cage = load_obj(path.parent / top["cage"].text())
    n = len(cage.vertices)

    def index(entry: Entry) -> int:
        value = entry.number(0, n - 1)
        if value != int(value):
            raise entry.wrong(f"a vertex of {top['cage'].text()}, 0..{n - 1}")
        return int(value)

    def indices(entry: Entry) -> list[int]:
        return [index(e) for e in entry.each()]

    measures = {k: e.number(1e-6) for k, e in top["measures"].items()}
    scales = {k: np.array([measures[m.choice(measures, "measure")] for m in e.each()])
              for k, e in top["scales"].items()}

    jaw_fields = top["jaw"].fields(required=("rule", "hinge", "glide"))
    rule = jaw_fields["rule"].choice(("vertices", "points"), "rule")
    jaw = Jaw(np.array(jaw_fields["hinge"].vector(_FARTHEST)), np.array(jaw_fields["glide"].vector(_FARTHEST)), rule)
    names: list[str] = []
    takes_input: list[bool] = []
    places, point_scale, jaw_share, aliases, with_parts = [], [], [], {}, {}
    for name, entry in top["points"].items():
        fields = entry.fields(required=("role", "scale"), optional=("vertex", "at", "jaw", "paper", "part"))
        if ("vertex" in fields) == ("at" in fields):
            raise entry.fail("a feature point needs either vertex or at")
        role = fields["role"].choice(ROLES, "role")
        takes_input.append(role == "input" or (role == "jaw" and rule == "vertices"))
        places.append(cage.vertices[index(fields["vertex"])] if "vertex" in fields
                      else np.array(fields["at"].vector(_FARTHEST)))
        point_scale.append(scales[fields["scale"].choice(scales, "scale")])
        jaw_share.append(fields["jaw"].number(0, 1) if "jaw" in fields else 0.0)
        if "paper" in fields:
            aliases[fields["paper"].text()] = len(names)
        if "part" in fields:
            with_parts[fields["part"].text()] = len(names)
        names.append(name)
    at = {name: i for i, name in enumerate(names)}

    regions = []
    for entry in top["regions"].each():
        fields = entry.fields(required=("points",), optional=("sheet", "rigid", "number"))
        corners = [at[e.choice(at, "feature point")] for e in fields["points"].each()]
        if len(set(corners)) != 3:
            raise entry.fail("a region is bounded by exactly three feature points")
        regions.append(Region((corners[0], corners[1], corners[2]), fields["rigid"].flag() if "rigid" in fields else False,
                              fields["sheet"].text() if "sheet" in fields else None))

    sheets: list[str | None] = [None] * n
    for name, entry in top["sheets"].items() if "sheets" in top else ():
        for i in indices(entry):
            sheets[i] = name
    followers = {}
    for key, entry in top["followers"].items() if "followers" in top else ():
        followers[index(Entry(_integer(key), entry.source, entry.path))] = {
            index(Entry(_integer(k), e.source, e.path)): e.number(0, 1) for k, e in entry.items()}
    weights, rigid = region_weights(cage.vertices, np.array(places), regions, np.array(top["centre_O"].vector(_FARTHEST)), sheets,
                                    followers)

    eyes = {k: np.array(e.vector(_FARTHEST)) for k, e in top["eyes"].fields(required=("L", "R")).items()}
    lids, rims, lid_skin = [], [], []
    for side, entry in top["lids"].fields(required=("L", "R")).items():
        fields = entry.fields(required=("columns", "movers", "rims", "skin"))
        movers = [e.each() for e in fields["movers"].each()]
        columns = np.array([indices(e) for e in fields["columns"].each()])
        lids.append(Lids(eyes[side], columns,
                         np.array([index(m[0]) for m in movers]),
                         np.array([int(m[1].number(0, len(columns) - 1)) for m in movers]),
                         np.array([m[2].choice(("upper", "lower"), "lid") == "lower" for m in movers]),
                         np.array([m[3].number(-1, 1) for m in movers])))
        rims.append(np.array(indices(fields["rims"])))
        lid_skin.append(np.array(indices(fields["skin"])))
    deformer = Deformer(cage.vertices, np.array(places), weights, rigid, np.array(jaw_share), jaw, tuple(lids))

    head = top["head"].fields(required=("pivot", "moves_above", "rests_below"))
    high, low = np.array(head["moves_above"].vector(_FARTHEST)), np.array(head["rests_below"].vector(_FARTHEST))

    def head_weight(vertices: Array) -> Array:
        t = np.clip((vertices - low) @ (high - low) / ((high - low) @ (high - low)), 0.0, 1.0)
        return (t * t * (3.0 - 2.0 * t))[:, None]

    creases = np.array([indices(e) for e in top["creases"].each()], np.int32).reshape(-1, 2) \
        if "creases" in top else np.empty((0, 2), np.int32)
    corners = np.array(indices(top["corners"]), np.int32) if "corners" in top else np.empty(0, np.int32)
    attachments = tuple(_part(e, path.parent, cage, creases, corners, eyes, with_parts, np.array(places))
                        for e in (top["parts"].each() if "parts" in top else ()))
    folds = {}
    for name, entry in top["folds"].items() if "folds" in top else ():
        fields = entry.fields(required=("along", "width", "depth", "ridge", "toward"))
        folds[name] = Fold(np.array([e.vector(_FARTHEST) for e in fields["along"].each()]), fields["width"].number(1e-3),
                           fields["depth"].number(), fields["ridge"].number(), np.array(fields["toward"].vector(_FARTHEST)))
    follow = np.zeros((2, 2))
    if "lid_follow" in top:
        fields = top["lid_follow"].fields(required=("down", "up"))
        for i, entry in enumerate((fields["down"], fields["up"])):
            pair = [e.number() for e in entry.each()]
            if len(pair) != 2:
                raise entry.wrong("two numbers: the upper and the lower lid's travel per degree of gaze")
            follow[i] = pair
    return FaceData(
        top["name"].text(), top["source"].text(), deformer, cage.faces, cage.materials, cage.face_materials, creases,
        corners, tuple(names), {**aliases, **at}, np.array(point_scale), scales, tuple(regions),
        np.array(list(eyes.values())), tuple(rims), tuple(lid_skin), follow,
        np.array(head["pivot"].vector(_FARTHEST)), head_weight,
        top["head_half_height"].number(1e-6) if "head_half_height" in top else float(np.ptp(cage.vertices[:, 1]) / 2),
        attachments, folds, np.array(takes_input))


def _integer(key: str) -> object:
    return int(key) if key.isdigit() else key


def _part(entry: Entry, folder: Path, cage: Mesh, creases, corners, eyes: Mapping[str, Array],
          with_parts: Mapping[str, int], places: Array) -> Attachment:
    """Return one part of a file and what carries it."""
    fields = entry.fields(required=("file", "part", "carried_by"), optional=("eye", "fades"))
    whole = load_obj(folder / fields["file"].text())
    name = fields["part"].text()
    if name not in whole.parts:
        raise fields["part"].fail(f"{fields['file'].text()} has no object {name!r}{nearest(name, whole.parts)}")
    keep = np.flatnonzero(whole.face_parts == whole.parts.index(name))
    used, faces = np.unique(whole.faces[keep], return_inverse=True)
    mesh = Mesh(whole.vertices[used], faces.reshape(-1, 3), whole.materials, whole.face_materials[keep], (name,),
                np.zeros(len(keep), np.int32))
    carrier = fields["carried_by"].choice(CARRIERS, "carrier")
    points: tuple = ()
    if name in with_parts:      # a feature point of this part: its pull fades backward from it
        row = with_parts[name]
        t = np.clip((mesh.vertices[:, 2] - (places[row, 2] - 55.0)) / 50.0, 0.0, 1.0)
        points = ((row, (t * t * (3 - 2 * t))[:, None]),)
    if carrier == "skull":
        return Attachment(mesh, points=points)
    if carrier == "jaw":
        return Attachment(mesh, jaw=np.ones((len(used), 1)), points=points)
    if carrier == "mouth":      # a lining between the jaws: its share of the jaw's movement grows downward
        if "fades" not in fields:
            raise entry.fail("a part carried by the mouth needs fades: [top, bottom], heights in mm")
        top, bottom = (e.number() for e in fields["fades"].each())
        t = np.clip((top - mesh.vertices[:, 1]) / (top - bottom), 0.0, 1.0)
        return Attachment(mesh, jaw=(t * t * (3 - 2 * t))[:, None])
    if carrier == "eye":
        if "eye" not in fields:
            raise TableError(f"{entry.source}: {entry.path}: a part carried by an eye needs eye: L or R")
        side = fields["eye"].choice(tuple(eyes), "eye")
        return Attachment(mesh, eye=list(eyes).index(side), centre=eyes[side])
    sub = loop_levels(len(cage.vertices), cage.faces, creases, 2, corners=corners)[2]
    return Attachment(mesh, skin=sparse.csr_array(
        attach(mesh.vertices, sub.matrix @ cage.vertices, sub.faces, sub.matrix)))
