"""Read ``face.yaml``: the data of a face, validated, with the meshes it names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.face.attach import Attachment, attach
from facegen.face.deformer import Array, Deformer, Jaw, Lids, Region, region_weights
from facegen.face.folds import Fold
from facegen.face.head import neck_weight
from facegen.face.landmarks import Landmark, read_landmarks
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data
from facegen.fileio.obj import load_obj
from facegen.geometry.fade import smooth_step
from facegen.geometry.mesh import Mesh
from facegen.geometry.subdivision import Subdivision, loop_levels

REQUIRED = ("name", "source", "cage", "centre_O", "measures", "scales", "points", "regions", "jaw", "eyes",
            "lids", "head")
_PULL_DOWN = 0.6        # how far down a point's pull on a part reaches, as a share of its reach
OPTIONAL = ("sheets", "followers", "creases", "corners", "parts", "folds", "lid_follow", "head_half_height",
            "landmarks", "surface", "eye_size", "colours")
CARRIERS = ("skull", "skin", "jaw", "eye", "mouth")
ROLES = ("input", "jaw", "fixed")
SIDES = ("L", "R")
FINEST = 3
"""The subdivision level whose surface all levels sample, and that a file ``surface`` describes."""
EYE_SIZES = (0.2, 5.0)
"""Least and largest size of the eyeballs, times the base face's."""
_BRIGHTEST = 255.0
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
    point_vertices: NDArray[np.int32]       # (k,) the cage's vertex that each point is, -1 for one set apart
    point_parts: tuple[str | None, ...]     # the part that a point belongs to, None for the skin
    point_scale: Array
    scales: Mapping[str, Array]
    regions: tuple[Region, ...]
    eye_centres: Array
    eye_size: float             # of the eyeballs, times the base face's
    lid_rims: tuple[NDArray[np.int32], ...]
    lid_skin: tuple[NDArray[np.int32], ...]
    lid_follow: Array           # (down or up, upper or lower lid): travel per degree of gaze
    head_pivot: Array
    head_weight: Callable[[Array], Array]
    head_half_height: float
    attachments: tuple[Attachment, ...]
    folds: Mapping[str, Fold]
    takes_input: NDArray[np.bool_]
    landmarks: Mapping[str, Landmark]
    colours: Mapping[str, tuple[float, float, float]] | None     # material -> sRGB 0..255, where not the usual ones
    relief: Array | None        # (n, 3) what the surface has beyond the smooth cage, at the finest level
    centre: Array               # (3,) the paper's O


def read_face(path: Path) -> FaceData:
    """Return the face that a ``face.yaml`` describes. TableError or FileError name the file and the key."""
    top = Entry(read_data(path), str(path)).fields(required=REQUIRED, optional=OPTIONAL)
    cage = load_obj(path.parent / top["cage"].text())
    n = len(cage.vertices)

    def index(entry: Entry) -> int:
        return entry.index(n, f"a vertex of {top['cage'].text()}")

    def indices(entry: Entry) -> NDArray[np.int32]:
        return np.array([index(e) for e in entry.each()], np.int32)

    def place(entry: Entry) -> Array:
        return np.array(entry.vector(_FARTHEST))

    measures = {k: e.number(1e-6) for k, e in top["measures"].items()}
    scales = {k: np.array([measures[m.choice(measures, "measure")] for m in _some(e, 3, "three measures")])
              for k, e in top["scales"].items()}
    if "mouth" not in scales:
        raise top["scales"].fail("the key 'mouth' is missing: it scales the jaw's movement")

    jaw_fields = top["jaw"].fields(required=("rule", "hinge", "glide"))
    rule = jaw_fields["rule"].choice(("vertices", "points"), "rule")
    jaw = Jaw(place(jaw_fields["hinge"]), place(jaw_fields["glide"]), rule)
    names: list[str] = []
    takes_input: list[bool] = []
    places, point_scale, jaw_share, point_vertices, aliases = [], [], [], [], {}
    with_parts: dict[str, dict[int, float | None]] = {}     # part -> row of a point -> how far its pull reaches
    for name, entry in top["points"].items():
        fields = entry.fields(required=("role", "scale"), optional=("vertex", "at", "jaw", "paper", "part", "reach"))
        if ("vertex" in fields) == ("at" in fields):
            raise entry.fail("a feature point needs either vertex or at")
        role = fields["role"].choice(ROLES, "role")
        takes_input.append(role == "input" or (role == "jaw" and rule == "vertices"))
        point_vertices.append(index(fields["vertex"]) if "vertex" in fields else -1)
        places.append(place(fields["at"]) if "at" in fields else cage.vertices[point_vertices[-1]])
        point_scale.append(scales[fields["scale"].choice(scales, "scale")])
        jaw_share.append(fields["jaw"].number(0, 1) if "jaw" in fields else 0.0)
        if "paper" in fields and aliases.setdefault(fields["paper"].text(), len(names)) != len(names):
            raise fields["paper"].fail(f"'{fields['paper'].text()}' is given to two feature points")
        reach = fields["reach"].number(1.0, 1e4) if "reach" in fields else None
        if "part" in fields:
            pulls = with_parts.setdefault(fields["part"].text(), {})
            if reach is None and None in pulls.values():
                raise fields["part"].fail(f"'{fields['part'].text()}' is given to two feature points; all but the "
                                          "foremost need reach")
            pulls[len(names)] = reach
        elif reach is not None:
            raise fields["reach"].fail("only the pull on a part has a reach; give part")
        names.append(name)
    at = {name: i for i, name in enumerate(names)}

    regions = []
    sheet_names = dict(top["sheets"].items()) if "sheets" in top else {}
    for entry in _some(top["regions"], None, "one region or more"):
        fields = entry.fields(required=("points",), optional=("sheet", "rigid", "number"))
        corners = [at[e.choice(at, "feature point")] for e in fields["points"].each()]
        if len(set(corners)) != 3:
            raise entry.fail("a region is bounded by exactly three feature points")
        if "number" in fields:          # the paper's, for the reader
            fields["number"].number()
        regions.append(Region((corners[0], corners[1], corners[2]),
                              fields["rigid"].flag() if "rigid" in fields else False,
                              fields["sheet"].choice(sheet_names, "sheet") if "sheet" in fields else None))

    sheets: list[str | None] = [None] * n
    for name, entry in sheet_names.items():
        for i in indices(entry):
            if sheets[i] not in (None, name):
                raise entry.fail(f"vertex {i} is already of the sheet '{sheets[i]}'")
            sheets[i] = name
    followers = {}
    for key, entry in top["followers"].items() if "followers" in top else ():
        followers[index(Entry(_integer(key), entry.source, entry.path))] = {
            index(Entry(_integer(k), e.source, e.path)): e.number(0, 1) for k, e in entry.items()}
        if abs(sum(followers[int(key)].values()) - 1.0) > 1e-6:
            raise entry.wrong("shares that sum to one")
    centre = place(top["centre_O"])
    weights, rigid = region_weights(cage.vertices, np.array(places), regions, centre, sheets, followers)

    by_side = {key: top[key].fields(required=SIDES) for key in ("eyes", "lids")}
    eyes = {side: place(by_side["eyes"][side]) for side in SIDES}
    lids, rims, lid_skin = [], [], []
    for side in SIDES:
        fields = by_side["lids"][side].fields(required=("columns", "movers", "rims", "skin"))
        columns = np.array([[index(v) for v in _some(e, 2, "two vertices [upper, lower]")]
                            for e in _some(fields["columns"], None, "one column or more")])
        movers = [_some(e, 4, "[vertex, column, upper or lower, share]")
                  for e in _some(fields["movers"], None, "one mover or more")]
        lids.append(Lids(eyes[side], columns,
                         np.array([index(m[0]) for m in movers]),
                         np.array([m[1].index(len(columns), "a column of the lid") for m in movers]),
                         np.array([m[2].choice(("upper", "lower"), "lid") == "lower" for m in movers]),
                         np.array([m[3].number(-1, 1) for m in movers])))
        rims.append(indices(fields["rims"]))
        lid_skin.append(indices(fields["skin"]))
    deformer = Deformer(cage.vertices, np.array(places), weights, rigid, np.array(jaw_share), jaw,
                        tuple(lids))

    head = top["head"].fields(required=("pivot", "moves_above", "rests_below"))
    high, low = place(head["moves_above"]), place(head["rests_below"])
    if np.array_equal(high, low):
        raise head["rests_below"].wrong("another place than moves_above")

    def head_weight(vertices: Array) -> Array:
        return neck_weight(vertices, high, low)

    creases = np.empty((0, 2), np.int32)
    if "creases" in top:
        pairs = [_some(e, 2, "two vertices") for e in top["creases"].each()]
        creases = np.array([[index(v) for v in pair] for pair in pairs], np.int32).reshape(-1, 2)
        sides = {frozenset(side) for a, b, c in cage.faces.tolist() for side in ((a, b), (b, c), (c, a))}
        for edge, entry in zip(creases.tolist(), top["creases"].each(), strict=True):
            if frozenset(edge) not in sides:
                raise entry.wrong("two vertices that share an edge of the cage")
    corners = indices(top["corners"]) if "corners" in top else np.empty(0, np.int32)
    relief = _relief(top["surface"], path.parent, cage, creases, corners) if "surface" in top else None
    load = cache(load_obj)      # several parts lie in one file

    @cache
    def surface() -> Subdivision:       # what brows and hair ride on
        return loop_levels(n, cage.faces, creases, 2, corners=corners)[2]

    attachments = tuple(_part(e, path.parent, load, cage, surface, eyes, with_parts, np.array(places))
                        for e in (top["parts"].each() if "parts" in top else ()))
    parts = [a.mesh.parts[0] for a in attachments]
    part_of = {row: part for part, pulls in with_parts.items() for row in pulls}
    for row, part in part_of.items():
        if part not in parts:
            Entry(part, str(path), f"points.{names[row]}.part").choice(parts, "part")
    marks = path.parent / (top["landmarks"].text() if "landmarks" in top else "landmarks.yaml")
    if "landmarks" in top and not marks.is_file():
        raise top["landmarks"].wrong("the path of a file that exists")
    landmarks = read_landmarks(marks, Path(top["cage"].text()).name, n, cage.faces, parts) if marks.exists() else {}
    folds = {}
    for name, entry in top["folds"].items() if "folds" in top else ():
        fields = entry.fields(required=("along", "width", "depth", "ridge", "toward"))
        along = np.array([place(e) for e in fields["along"].each()])
        if len(along) < 2 or not np.diff(along, axis=0).any(axis=1).all():
            raise fields["along"].wrong("two places or more, each other than the one before")
        folds[name] = Fold(along, fields["width"].number(1e-3), fields["depth"].number(),
                           fields["ridge"].number(), place(fields["toward"]))
    follow = np.zeros((2, 2))
    if "lid_follow" in top:
        fields = top["lid_follow"].fields(required=("down", "up"))
        for i, entry in enumerate((fields["down"], fields["up"])):
            expected = "two numbers: the upper and the lower lid's travel per degree of gaze"
            follow[i] = [e.number() for e in _some(entry, 2, expected)]
    return FaceData(
        top["name"].text(), top["source"].text(), deformer, cage.faces, cage.materials, cage.face_materials,
        creases, corners, tuple(names), {**aliases, **at}, np.array(point_vertices),
        tuple(part_of.get(row) for row in range(len(names))), np.array(point_scale), scales, tuple(regions),
        np.array(list(eyes.values())), top["eye_size"].number(*EYE_SIZES) if "eye_size" in top else 1.0,
        tuple(rims), tuple(lid_skin), follow,
        place(head["pivot"]), head_weight,
        top["head_half_height"].number(1e-6) if "head_half_height" in top
        else float(np.ptp(cage.vertices[:, 1]) / 2),
        attachments, folds, np.array(takes_input), landmarks,
        {name: _colour(e) for name, e in top["colours"].items()} if "colours" in top else None, relief, centre)


def _integer(key: str) -> object:
    return int(key) if key.isdecimal() and len(key) < 10 else key


def _some(entry: Entry, count: int | None, expected: str) -> list[Entry]:
    """Return the entries of a list of ``count`` items; None: of at least one."""
    items = entry.each()
    if (not items) if count is None else len(items) != count:
        raise entry.wrong(expected)
    return items


def _colour(entry: Entry) -> tuple[float, float, float]:
    found = entry.vector(_BRIGHTEST)
    if min(found) < 0:
        raise entry.wrong("three numbers from 0 to 255: red, green and blue in sRGB")
    return found


def _relief(entry: Entry, folder: Path, cage: Mesh, creases: NDArray, corners: NDArray) -> Array:
    """Return how far each vertex of a file's surface lies from the smooth cage's, (n, 3)."""
    surface = load_obj(folder / entry.text())
    smooth = loop_levels(len(cage.vertices), cage.faces, creases, FINEST, corners=corners)[-1]
    if surface.vertices.shape[0] != smooth.matrix.shape[0] or not np.array_equal(surface.faces, smooth.faces):
        raise entry.fail(f"{entry.text()} is no surface of this cage: expected the {smooth.matrix.shape[0]} vertices "
                         f"and {len(smooth.faces)} triangles of its subdivision level {FINEST} in their order, got "
                         f"{len(surface.vertices)} and {len(surface.faces)}")
    return surface.vertices - smooth.matrix @ cage.vertices


def _pull(vertices: Array, at: Array, reach: float | None) -> Array:
    """Return how far (n,) a point at ``at`` (3,) pulls along the vertices (n, 3) of its part.

    Without a reach it is the foremost: all before it goes along, and the pull fades backward. With one it fades to both
    ways and, sooner, downward: a tongue rises from the floor of the mouth, which keeps its underside.
    """
    if reach is None:
        return smooth_step((vertices[:, 2] - (at[2] - 55.0)) / 50.0)
    along, down = vertices[:, 2] - at[2], np.maximum(at[1] - vertices[:, 1], 0.0)
    return smooth_step(1.0 - np.hypot(along, down / _PULL_DOWN) / reach)


def _part(entry: Entry, folder: Path, load: Callable[[Path], Mesh], cage: Mesh, surface: Callable[[], Subdivision],
          eyes: Mapping[str, Array], with_parts: Mapping[str, Mapping[int, float | None]], places: Array) -> Attachment:
    """Return one part of a file and what carries it."""
    fields = entry.fields(required=("file", "part", "carried_by"), optional=("eye", "fades"))
    whole = load(folder / fields["file"].text())
    name = fields["part"].choice(whole.parts, f"object of {fields['file'].text()}")
    keep = np.flatnonzero(whole.face_parts == whole.parts.index(name))
    used, faces = np.unique(whole.faces[keep], return_inverse=True)
    mesh = Mesh(whole.vertices[used], faces.reshape(-1, 3), whole.materials, whole.face_materials[keep],
                (name,), np.zeros(len(keep), np.int32))
    carrier = fields["carried_by"].choice(CARRIERS, "carrier")
    points = tuple((row, _pull(mesh.vertices, places[row], reach)[:, None])
                   for row, reach in with_parts.get(name, {}).items())
    if carrier == "skull":
        return Attachment(mesh, points=points)
    if carrier == "jaw":
        return Attachment(mesh, jaw=np.ones((len(used), 1)), points=points)
    if carrier == "mouth":      # a lining between the jaws: its share of the jaw's movement grows downward
        if "fades" not in fields:
            raise entry.fail("a part carried by the mouth needs fades: [top, bottom], heights in mm")
        top, bottom = (e.number() for e in _some(fields["fades"], 2, "two heights [top, bottom]"))
        if top <= bottom:
            raise fields["fades"].wrong("two heights [top, bottom], the top first")
        return Attachment(mesh, jaw=smooth_step((top - mesh.vertices[:, 1]) / (top - bottom))[:, None])
    if carrier == "eye":
        if "eye" not in fields:
            raise entry.fail("a part carried by an eye needs eye: L or R")
        side = fields["eye"].choice(tuple(eyes), "eye")
        return Attachment(mesh, eye=list(eyes).index(side), centre=eyes[side])
    sub = surface()
    return Attachment(mesh, skin=sparse.csr_array(
        attach(mesh.vertices, sub.matrix @ cage.vertices, sub.faces, sub.matrix)))
