"""What a component is, by where it lies: in an eye, behind the lips, on the face, beside it.

Every length is measured in the avatar's own: an eye's width, the mouth's width, the face's height. Names decide only
between kinds that the place allows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from facegen.errors import InputError
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.operators import Surface
from facegen.transfer.components import Components
from facegen.transfer.enclosure import blocked_share, sample_surface, spacing_for
from facegen.transfer.face_measures import FaceMeasures, Points
from facegen.transfer.piece_names import kind_of_name, row_of_name

Array = NDArray[np.float64]

# Landmarks that only skin carries. Brows may be strips of their own, eye_center is on the ball, head_top on a cap.
_CORE = ("eye_inner", "eye_outer", "eye_upper", "eye_lower", "nose_tip", "nose_bridge", "nose_wing", "mouth_corner",
         "mouth_top", "mouth_inner_top", "mouth_inner_bottom", "mouth_bottom", "chin")
# Cells for looking at the face, as a share of its height: four millimetres on a person.
_CELL = 1 / 27
# The head lies within so many heights of the face; a body's triangles need no samples.
_HEAD = 2.5
# So many vertices of a component speak for it.
_SPEAKERS = 48
# Inside: skin blocks this share of the views to the front. A mouth that stands open shows its front teeth.
_BEHIND = 0.45

# An eye: its middle within so many eye widths of the ball's, its farthest vertex within so many.
_EYE_NEAR, _EYE_SIZE = 0.9, 1.6
# A strip this much longer than wide is a lash or a brow; below this size, in eye widths, a spot may be any shape.
_STRIP, _SPOT = 0.42, 0.5
# Hair of a lash stands this far out of the lids' plane, in eye widths, at its tips and on the mean.
_TIPS, _HAIR = 0.3, 0.12
# A landmark this near to the skin, as a share of the face's height, is on it: a tenth of a millimetre on a person.
_SAME = 1e-3
# Thin: nine tenths of its vertices within this share of the face's height of the skin; touching: a tenth of them.
_THIN, _TOUCHES = 0.09, 0.05
# Within this, it is painted on, an outline or a mask: it follows the face however wide it is.
_TIGHT = 0.03
# Both rows of teeth in one piece: the lip line leaves at least this share of its height on either side.
_ROWS = 0.3
# Wider than the brows by this, it goes round the head.
_ROUND_HEAD = 1.25


def skin_components(parts: Components, points: Points, given: Mapping[int, str]) -> tuple[frozenset[int], dict]:
    """Return which components are skin, and how many landmarks each carries; InputError if none is left."""
    height = FaceMeasures(points).height
    core = np.array([place for name, place in points.items() if name.removesuffix("_L").removesuffix("_R") in _CORE])
    corners = parts.vertices[parts.faces]
    middles = corners.mean(axis=1)
    reach = np.sqrt(((corners - middles[:, None]) ** 2).sum(axis=2).max(axis=1))
    candidates = np.zeros(len(middles), bool)
    for place in core:          # the nearest triangle is among those whose ball comes as near as the nearest middle
        distance = np.sqrt(((middles - place) ** 2).sum(axis=1))
        candidates |= distance - reach <= distance.min()
    owners = parts.of_face[candidates]
    carried = _nearest_component(parts, core, np.flatnonzero(candidates))
    most = max(carried, key=carried.get)
    # What lies as near to a landmark as that skin, such as an eye in its lids, does not carry it.
    rows = np.flatnonzero(candidates)[owners == most]
    beside = ClosestPoints(Surface(parts.vertices, parts.faces[rows]))(core).distances > _SAME * height
    carried = {most: int((~beside).sum())}
    if beside.any():
        for c, count in _nearest_component(parts, core[beside], np.flatnonzero(candidates)).items():
            carried[c] = carried.get(c, 0) + count
    skin = {c for c in carried if c == most or _kind_by_name(parts, c) in ("", "skin", "body")}
    skin = {c for c in skin if given.get(c, "skin") == "skin"} | {c for c, kind in given.items() if kind == "skin"}
    if not skin:
        raise InputError(f"pieces: '{parts.name(most)}' carries the landmarks, so it is the skin; nothing is left to "
                         "be skin if it is something else")
    return frozenset(skin), carried


def _nearest_component(parts: Components, places: Array, rows: NDArray) -> dict[int, int]:
    """Return component -> how many places lie nearest to it, of the triangles in ``rows``."""
    feet = ClosestPoints(Surface(parts.vertices, parts.faces[rows]))(places)
    numbers, counts = np.unique(parts.of_face[rows[feet.faces]], return_counts=True)
    return dict(zip(numbers.tolist(), counts.tolist(), strict=True))


def kinds_by_place(parts: Components, points: Points, skin: frozenset[int],
                   given: Mapping[int, str]) -> dict[int, tuple[str, str]]:
    """Return component -> (kind, reason) for all that are not skin."""
    face = FaceMeasures(points)
    others = [c for c in range(parts.count) if c not in skin]
    found = {c: (given[c], "given") for c in others if c in given}
    rest = [c for c in others if c not in given]
    if not rest:
        return found
    seen = _look(parts, rest, skin, face)
    mouth = []
    for c in rest:
        kind, why = _place(parts, c, seen[c], face)
        if kind == "inside":
            mouth.append(c)
        else:
            found[c] = (kind, why)
    found.update(_mouth_kinds(parts, mouth, face))
    return found


@dataclass(frozen=True, eq=False)
class _Look:
    """A component: some of its ``vertices``, its ``middle``, ``low`` and ``high`` corners of its box, and, for the
    vertices, which share of views to the front and all round the skin ``blocked`` on the mean, and how far from the
    skin a tenth (``touch``) and nine tenths (``thick``) of them lie."""

    vertices: Array
    middle: Array
    low: Array
    high: Array
    blocked: float
    round_blocked: float
    touch: float
    thick: float

    @property
    def reach(self) -> float:
        """The farthest vertex from the middle."""
        return float(np.sqrt(((self.vertices - self.middle) ** 2).sum(axis=1).max()))


def _look(parts: Components, which: list[int], skin: frozenset[int], face: FaceMeasures) -> dict[int, _Look]:
    """Look at components, all at once."""
    cell = _CELL * face.height
    own = np.isin(parts.of_face, list(skin))
    corners = parts.vertices[parts.faces[own]]
    near = ((corners.mean(axis=1) - face.centre) ** 2).sum(axis=1) < (_HEAD * face.height) ** 2
    samples = sample_surface(corners[near], spacing_for(cell))
    if not len(samples):
        samples = corners.reshape(-1, 3)
    speakers = []
    for c in which:
        rows = parts.vertices_of(c)
        speakers.append(rows[np.unique(np.linspace(0, len(rows) - 1, _SPEAKERS).astype(int))])
    places = parts.vertices[np.concatenate(speakers)]
    front, around = blocked_share(places, samples, cell)
    distance = cKDTree(samples, balanced_tree=False, compact_nodes=False).query(places)[0]
    ends = np.cumsum([len(rows) for rows in speakers])[:-1]
    split = (np.split(one, ends) for one in (places, front, around, distance))
    result = {}
    for c, at, blocked, round_blocked, far in zip(which, *split, strict=True):
        every = parts.vertices[parts.vertices_of(c)]
        touch, thick = np.quantile(far, [0.1, 0.9])
        result[c] = _Look(at, every.mean(axis=0), every.min(axis=0), every.max(axis=0), float(blocked.mean()),
                          float(round_blocked.mean()), float(touch), float(thick))
    return result


def _kind_by_name(parts: Components, c: int) -> str:
    return kind_of_name(parts.name(c).replace("|", " "))


def _place(parts: Components, c: int, look: _Look, face: FaceMeasures) -> tuple[str, str]:
    """Return the kind of a component and why; "inside" for what lies behind the lips."""
    said = _kind_by_name(parts, c)
    named = f"named '{parts.name(c)}'"
    side = min("LR", key=lambda s: float(np.linalg.norm(look.middle - face.eye(s))))
    eye = _in_eye(look, face, side)
    mouth = _mouth_distance(look, face)
    if said == "eye" and eye < 2.0:
        return f"eye_{side}", f"{named}, at the {_word(side)} eye"
    if said in ("teeth", "tongue", "mouth") and mouth < 2.0:
        return "inside", named
    if said == "carried" and look.touch < 3 * _TOUCHES * face.height:
        return "carried", f"{named}, on the skin"
    if said in ("skull", "body"):
        return said, named
    if eye < 1.0 and _round(look, face, side):
        return f"eye_{side}", f"round, in the {_word(side)} eye"
    if mouth < 1.0 and look.blocked > _BEHIND:
        return "inside", "behind the lips"
    return _outside(look, face)


def _word(side: str) -> str:
    return {"L": "left", "R": "right"}[side]


def _in_eye(look: _Look, face: FaceMeasures, s: str) -> float:
    """Return how far a component is from being in an eye: below one it is where a ball, a cornea or a spot would be."""
    width = face.eye_width(s)
    if width <= 0:
        return np.inf
    away = look.middle - face.eye(s)
    # Discs and highlights lie in the lids' plane, a ball's middle behind it; a glass lens lies before it.
    depth = float(away @ face.eye_outward(s)) / width
    aside = np.linalg.norm(away - (away @ face.eye_outward(s)) * face.eye_outward(s)) / width
    return max(aside / 0.6, look.reach / (_EYE_SIZE * width), depth / 0.3 if depth > 0 else -depth / _EYE_NEAR)


def _round(look: _Look, face: FaceMeasures, s: str) -> bool:
    """Whether a component is a ball, a shell, a disc or a small spot, rather than hair on a lid."""
    ahead = (look.vertices - face.eye(s)) @ face.eye_outward(s) / face.eye_width(s)
    if ahead.max() > _TIPS and ahead.mean() > _HAIR:
        return False
    if len(look.vertices) < 3:
        return True
    spread = np.linalg.svd(look.vertices - look.vertices.mean(axis=0), compute_uv=False)
    return bool(spread[1] > _STRIP * spread[0] or look.reach < 0.5 * _SPOT * face.eye_width(s))


def _mouth_distance(look: _Look, face: FaceMeasures) -> float:
    """Return how far a component's middle is from being in the mouth: below one it is where teeth would be."""
    width = max(face.mouth_width, 0.25 * face.height)
    away = look.middle - face.lips
    up = float(away @ face.lip_normal)
    forward = np.cross([1.0, 0.0, 0.0], face.lip_normal)
    depth = -float(away @ forward)
    if look.high[0] - look.low[0] > max(face.brows, 1.3 * face.mouth_width):
        return np.inf                               # an outline round the head has its middle there too
    # Behind the lips as far as the jaw is long, up and down as far as nose and chin leave room.
    room = 0.35 * face.height
    return max(abs(away[0]) / (0.75 * width), abs(up) / room, depth / (1.5 * max(width, 0.4 * face.height)),
               -depth / (0.15 * face.height))


def _outside(look: _Look, face: FaceMeasures) -> tuple[str, str]:
    """Return what a component outside is: on the face and carried by it, beside it, or far below."""
    p, height = face.points, face.height
    size = look.high - look.low
    top = (p["brow_mid_L"][1] + p["brow_mid_R"][1]) / 2
    below = p["neck"][1] if "neck" in p else p["chin"][1] - 0.5 * height
    if look.middle[1] < below or size.max() > 6 * height:
        return "body", "below the head" if look.middle[1] < below else "larger than a head"
    if look.round_blocked > 0.9 and look.blocked > 0.9:
        return "skull", "inside the head"
    on_face = abs(look.middle[0]) < 0.6 * face.brows and look.middle[1] < top + 0.12 * height
    narrow = size[0] < _ROUND_HEAD * face.brows
    if on_face and look.thick < _TIGHT * height:
        return "carried", "tight on the skin"
    if on_face and narrow and look.touch < _TOUCHES * height:
        if look.thick < _THIN * height:
            return "carried", "thin, on the skin"
        if look.middle[1] < (top + face.lips[1]) / 2:
            return "carried", "sits on the lower face"
    return "skull", "stands out from the face" if on_face else "beside the face"


def _mouth_kinds(parts: Components, which: list[int], face: FaceMeasures) -> dict[int, tuple[str, str]]:
    """Return component -> (kind, reason) of what lies behind the lips: upper or lower row, tongue or lining."""
    if not which:
        return {}
    places = {c: parts.vertices[parts.vertices_of(c)] for c in which}
    heights = {c: (at - face.lips) @ face.lip_normal for c, at in places.items()}
    boxes = {c: (at.min(axis=0), at.max(axis=0)) for c, at in places.items()}
    result = {}
    for c in which:
        name = parts.name(c).replace("|", " ")
        said, row, h = kind_of_name(name), row_of_name(name), heights[c]
        both = min((h > 0).mean(), (h < 0).mean()) > 0.2
        held = sum(bool((boxes[c][0] <= (low + high) / 2).all() and ((low + high) / 2 <= boxes[c][1]).all())
                   for other, (low, high) in boxes.items() if other != c)
        if said == "tongue" or (said != "teeth" and not row and _is_tongue(places[c], h, face)):
            result[c] = ("tongue", "named" if said == "tongue" else "long and full, below the lip line")
        elif said == "mouth" and not row:
            result[c] = ("mouth", "named")
        elif said != "teeth" and both and (held >= 2 or held == len(which) - 1) and _large(boxes[c], face):
            result[c] = ("mouth", "round what lies behind the lips")
        elif said == "teeth" and both and not row and min(h.max(), -h.min()) > _ROWS * np.ptp(h):
            result[c] = ("mouth", "both rows of teeth in one: the lower half goes with the jaw")
        elif row:
            result[c] = (f"teeth_{row}", f"named '{row}'")
        else:
            upper = float((h.min() + h.max()) / 2) > 0
            result[c] = ("teeth_upper", "behind the lips, above their line") if upper else \
                ("teeth_lower", "behind the lips, below their line")
    return result


def _large(box: tuple[Array, Array], face: FaceMeasures) -> bool:
    return bool((box[1] - box[0])[0] > 0.5 * face.mouth_width)


def _is_tongue(at: Array, heights: Array, face: FaceMeasures) -> bool:
    """Whether a component is one long full body in the middle: a row of teeth is empty there, a tooth is short."""
    x, depth = at[:, 0], -at @ np.cross([1.0, 0.0, 0.0], face.lip_normal)
    half, long = np.ptp(x) / 2, np.ptp(depth)
    if half <= 0 or abs(x.min() + x.max()) / 2 > 0.3 * half or long < 0.3 * face.mouth_width or np.mean(heights) > 0:
        return False
    behind = depth > depth.min() + 0.4 * long
    return bool((np.abs(x[behind]) < 0.4 * half).mean() > 0.1)
