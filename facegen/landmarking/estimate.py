"""Where a head's landmarks are, in the base face's frame: from the face that was laid on it, or from known places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from facegen.errors import InputError
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface
from facegen.landmarking.confidence import A_FACE
from facegen.landmarking.far import OTHERS, SKULL, skull_ends
from facegen.landmarking.features import eye_opening, lip_line, nose_tip
from facegen.landmarking.fit import BENT, Laid, lay, likeness
from facegen.landmarking.following import CLICK, follow_kinds, follow_laid, partner
from facegen.landmarking.model import FaceModel
from facegen.landmarking.recognise import MIDDLE
from facegen.landmarking.seeing import off, seen_on
from facegen.landmarking.skin import Head, Skin
from facegen.landmarking.symmetry import Plane, follow
from facegen.transfer.alignment import Similarity, align

Array = NDArray[np.float64]

# The head's plane of symmetry is that of what lies within so many millimetres of the face's middle.
_HEAD = 90.0
# So many samples tell it.
_SAMPLES, _FEWEST = 1500, 20
# A known place's mirror image is this near to its partner, mm of the base face; a place of a laid face to the one that
# is meant.
_MIRRORED_OFF, _LAID_OFF = 3.0, 3.0
# What no front of a face tells.
_BEHIND_FACE = ("jaw", "head", "neck")
# On a person's face eyeballs and brows say where lids and brows are if those were laid farther beside them than this,
# mm: a child's eyes are lower in the face. Nearer, what was laid is as good.
_BESIDE = {"eye_": 4.0, "brow_": 7.0}


@dataclass(frozen=True, eq=False)
class Estimate:
    """``frame``: from the base face's frame to the mesh's. ``places``: name -> (3,) in the first, mm; ``seen``: which
    the mesh shows; ``off``: name -> how far it may be, mm, each way; ``normals``: name -> (3,) of the skin where it is
    known. ``plane``: between left and right, of the mesh. ``laid``: the face that it comes from, and how ``alike``."""

    frame: Similarity
    places: Mapping[str, Array]
    seen: frozenset[str]
    off: Mapping[str, float]
    plane: Plane
    normals: Mapping[str, Array]
    laid: Laid | None = None
    alike: float = 0.0

    @property
    def on_mesh(self) -> dict[str, Array]:
        """Name -> place (3,) in the mesh's axes and units."""
        return dict(zip(self.places, self.frame.apply(np.array(list(self.places.values()))), strict=True))


def of_face(head: Head, skin: Skin, model: FaceModel, laid: Laid, alike: float, sure: bool) -> Estimate:
    """Return where the landmarks of a laid face are. sure: that it is one; then it is laid again with what is seen."""
    plane, seen = plane_of(head, laid.frame), {}
    if sure:
        search = skin.search
        seen = _seen(head, skin, plane, model, laid, alike)
        hold = {name: laid.frame.apply(place) for name, place in seen.items() if name in model.names}
        laid = lay(model, search, laid.frame, hold, BENT[-4:], laid.vertices)
        seen = _seen(head, skin, plane, model, laid, alike)
        alike = max(alike, likeness(model, laid, search))
    places = {**_points(model, laid), **seen}
    normals = dict(zip(model.names, model.placing @ vertex_normals(laid.vertices, model.surface.faces), strict=True))
    far, deviation = follow_kinds(model.rest, {name: (place, _LAID_OFF) for name, place in places.items()
                                               if name in model.rest})
    places = {**far, **places}
    deviation |= {name: off(name) for name in seen}
    return _with_skull(head, Estimate(laid.frame, places, frozenset(seen), deviation, plane, normals, laid, alike))


def beside_known(found: Estimate, model: FaceModel, known: Mapping[str, Array]) -> Estimate:
    """Return the landmarks of a laid face, moved beside known places (3,) of the mesh."""
    back = found.frame.inverse()
    own = {name: back.apply(place) for name, place in known.items() if name in found.places}
    return replace(found, places=follow_laid(found.places, model.rest, found.seen, own))


def of_known(head: Head, model: FaceModel, known: Mapping[str, Array]) -> Estimate | None:
    """Return where the landmarks are by known places (3,) of the mesh alone; None if those fix no face."""
    common = {name: known[name] for name in model.rest if name in known}
    try:
        frame = align({name: model.rest[name] for name in common}, common)
    except InputError:                          # on one line: they fix no place
        return None
    back, plane = frame.inverse(), plane_of(head, frame)
    own = {partner(name): (back.apply(plane.mirror(place)), _MIRRORED_OFF) for name, place in common.items()}
    own |= {name: (back.apply(place), CLICK) for name, place in common.items()}
    places, _ = follow_kinds(model.rest, own)
    seen = seen_on(head, plane, {name: frame.apply(place) for name, place in places.items()}, known)
    seen = {name: back.apply(place) for name, place in seen.items()}
    own |= {name: (place, off(name)) for name, place in seen.items() if not name.startswith("eye_center")}
    places, deviation = follow_kinds(model.rest, own)
    places |= seen
    deviation |= {name: off(name) for name in seen}
    return Estimate(frame, places, frozenset(seen), _less_sure_behind(deviation), plane, {})


def _with_skull(head: Head, found: Estimate) -> Estimate:
    """Return the estimate of a laid face with the skull's ends where the mesh has them. By clicks alone a horse's head
    lies askew in the frame, so that its top is elsewhere."""
    eyes = (found.places["eye_center_L"] + found.places["eye_center_R"]) / 2
    ends = skull_ends(head, found.plane, found.frame, eyes)
    return replace(found, places={**found.places, **ends}, seen=found.seen | ends.keys(),
                   off={**_less_sure_behind(found.off), **dict.fromkeys(ends, SKULL)})


def _less_sure_behind(off: Mapping[str, float]) -> dict[str, float]:
    """Return how far places may be, mm, where those behind the face were told by its front alone."""
    return {name: max(one, OTHERS) if name.startswith(_BEHIND_FACE) else one for name, one in off.items()}


def _points(model: FaceModel, laid: Laid) -> dict[str, Array]:
    """Return name -> place (3,) of a laid face's landmarks, in the base face's frame, mm."""
    return dict(zip(model.names, model.placing @ laid.vertices, strict=True))


def _seen(head: Head, skin: Skin, plane: Plane, model: FaceModel, laid: Laid, alike: float
          ) -> dict[str, Array]:
    """Return what is seen of a laid face's lids, lips and nose, name -> place (3,) in the base face's frame."""
    frame, back = laid.frame, laid.frame.inverse()
    points = _points(model, laid)
    found = seen_on(head, plane, {name: frame.apply(place) for name, place in points.items()}, {})
    found = {name: back.apply(place) for name, place in found.items() if not name.startswith("eye_inner")}
    for part, s in product(_BESIDE, "LR") if alike >= A_FACE else ():
        own = [name for name in found if name.startswith(part) and name.endswith(s) and name in points]
        if own and np.linalg.norm(np.mean([found[name] - points[name] for name in own], axis=0)[:2]) < _BESIDE[part]:
            found = {name: place for name, place in found.items() if name not in own}
    near = {**points, **{name: place for name, place in found.items() if name.startswith("eye_")}}
    front = Surface(back.apply(head.mesh.vertices), skin.surface.faces)
    return found | lip_line(front, near) | nose_tip(front, near) | eye_opening(front, near, "L") \
        | eye_opening(front, near, "R")


def plane_of(head: Head, frame: Similarity) -> Plane:
    """Return the plane between left and right of the head in a frame."""
    normal, middle = frame.rotation[:, 0], frame.apply(MIDDLE)
    vertices = head.mesh.vertices
    near = ((vertices - middle) ** 2).sum(axis=1) < (_HEAD * frame.scale) ** 2
    samples = vertices[near & head.used]
    plane = Plane(normal, float(normal @ frame.offset), np.inf)
    if len(samples) > _FEWEST:
        some = samples[np.unique(np.linspace(0, len(samples) - 1, _SAMPLES).astype(int))]
        plane = follow(cKDTree(samples), some, plane, frame.scale * _HEAD, 8)
    return plane
