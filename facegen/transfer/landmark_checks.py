"""What can be wrong with landmarks on a mesh, found from the places alone and said in words.

Every rule has to let a horse and a cat pass, so the rules are about order, sides and mirrors more than about
distances; the average face only tells what is no face at all. While places are still being set only some are there:
each rule then asks what can be asked of those.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.transfer.alignment import align
from facegen.transfer.landmark_surface import coincidences, on_pieces, touching

Array = NDArray[np.float64]

# Of the landmarks' spread, what no similarity explains: people 0.02, a horse 0.3, places at random 0.8 and more.
_NO_FACE, _HARDLY_A_FACE = 0.75, 0.55
# How far a place may be from its partner's mirror image, and a middle one from the middle, in distances between the
# eyes. An asymmetric person reaches 0.15.
_ODD_MIRROR, _WRONG_MIRROR = 0.35, 0.6
_ODD_MIDDLE, _WRONG_MIDDLE = 0.2, 0.5
# How far from the average face's place, in its millimetres, and how many times the usual misfit of this face.
_FAR, _FAR_TIMES = 45.0, 5.0
# So many places tell whether they form a face at all: fewer fit a face however they lie.
_TELLING = 12
# Below this the two diagonals of an eye say nothing about which way it is turned.
_CLEAR = 0.2


@cache
def average_face() -> dict[str, Array]:
    """Return name -> place (3,), mm, of the base face's landmarks."""
    from facegen.face.face import load_face

    face = load_face()
    return face.landmark_points(face.mesh(0).vertices, detail=0)


def place_faults(names: Sequence[str], corners: NDArray, weights: Array, mesh: Mesh) -> tuple[list[str], list[str]]:
    """Return (errors, warnings) about landmarks on a mesh, all of a face's or some. Rules that build on others stop
    where those fail."""
    vertices = mesh.vertices
    p = dict(zip(names, np.einsum("kc,kci->ki", weights, vertices[corners]), strict=True))
    errors, warnings = coincidences(p, corners, weights, mesh)
    errors += on_pieces(names, corners, weights, mesh)
    errors += [] if errors else touching(p, corners, weights, mesh)
    if errors:
        return errors, warnings
    for rule in (_shape, _sides, _order):
        more_errors, more_warnings = rule(p, mesh)
        warnings += more_warnings
        if more_errors:
            return more_errors, warnings
    errors, more_warnings = _positions(p)
    return errors, warnings + more_warnings


# -- the whole set -------------------------------------------------------------------------------------------------
def _shape(p: dict[str, Array], mesh: Mesh) -> tuple[list[str], list[str]]:
    """Whether the places form a face at all: how much of them a similarity, mirrored or not, leaves unexplained."""
    left = min(_unexplained(p, mirror) for mirror in (1.0, -1.0))
    if left > _NO_FACE:
        return ["they do not form a face: the landmarks were made for another mesh, or their vertices are numbered "
                "otherwise there (counted from 0, in the file's own order)"], []
    if left > _HARDLY_A_FACE:
        return [], ["the landmarks form an unusual face; look at a picture of the result"]
    return [], []


def _unexplained(p: dict[str, Array], mirror: float) -> float:
    """Return the Procrustes distance (0 to 1) to the average face, by proper rotations of its (mirrored) image."""
    from facegen.face.landmarks import REQUIRED

    names = [name for name in p if name in REQUIRED]
    if len(names) < _TELLING:
        return 0.0
    x = np.array([p[name] for name in names])
    y = np.array([average_face()[name] for name in names]) * [mirror, 1.0, 1.0]
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    u, s, vt = np.linalg.svd(x.T @ y)
    s[2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return float(1.0 - s.sum() ** 2 / ((x**2).sum() * (y**2).sum()))


@dataclass(frozen=True)
class _Frame:
    """The face's own axes: ``x`` from right to left, ``y`` up, ``z`` out; ``middle`` (3,) and ``unit``, the distance
    between the eyes."""

    x: Array
    y: Array
    z: Array
    middle: Array
    unit: float

    def at(self, place: Array) -> Array:
        """Return a place in the face's axes and units."""
        return np.array([self.x, self.y, self.z]) @ (place - self.middle) / self.unit


_EYE = ("eye_inner", "eye_outer", "eye_upper", "eye_lower")


def _pairs(p: dict[str, Array]) -> list[str]:
    return [name[:-2] for name in p if name.endswith("_L") and f"{name[:-2]}_R" in p]


def _frame(p: dict[str, Array]) -> _Frame | None:
    """Return the axes that most pairs agree on: a swapped one changes nothing. None where too few places are known."""
    pairs = [name for name in _pairs(p) if name.startswith(("eye", "brow", "nose", "mouth"))]
    eyes = [name for name in pairs if name in _EYE] or [name for name in pairs if name.startswith(("eye", "brow"))]
    below = _below(p)
    if not eyes or below is None:
        return None
    across = np.array([p[f"{name}_L"] - p[f"{name}_R"] for name in pairs])
    x = np.linalg.svd(across, full_matrices=False)[2][0]
    x = x if np.sign(across @ x).sum() > 0 or (np.sign(across @ x).sum() == 0 and (across @ x).sum() > 0) else -x
    middle = np.median([(p[f"{name}_L"] + p[f"{name}_R"]) / 2 for name in pairs], axis=0)
    left, right = (np.mean([p[f"{name}_{s}"] for name in eyes], axis=0) for s in "LR")
    y = (left + right) / 2 - below
    y = y - x * (x @ y)
    unit = float(np.linalg.norm(left - right))
    y = y / max(np.linalg.norm(y), 1e-300)
    return _Frame(x, y, np.cross(x, y), middle, max(unit, 1e-300))


def _below(p: dict[str, Array]) -> Array | None:
    """Return a place in the middle below the eyes: of the lips, or what else is known."""
    lips = [name for name in ("mouth_top", "mouth_bottom") if name in p]
    lips += ["mouth_corner_L", "mouth_corner_R"] if "mouth_corner" in _pairs(p) else []
    lips = lips or [name for name in ("mouth_inner_top", "mouth_inner_bottom", "chin", "nose_tip") if name in p][:1]
    return np.mean([p[name] for name in lips], axis=0) if lips else None


def _eye(p: dict[str, Array], s: str) -> Array:
    return (p[f"eye_inner_{s}"] + p[f"eye_outer_{s}"] + p[f"eye_upper_{s}"] + p[f"eye_lower_{s}"]) / 4


def _sides(p: dict[str, Array], mesh: Mesh) -> tuple[list[str], list[str]]:
    """Left and right: pairs against the others, and the whole set against the way the face looks."""
    frame = _frame(p)
    if frame is None:
        return [], []
    against = [name for name in _pairs(p) if (p[f"{name}_L"] - p[f"{name}_R"]) @ frame.x < 0]
    if against:
        listed = ", ".join(f"'{name}_L' and '{name}_R'" for name in against)
        return [f"{listed} are swapped: _L is the subject's own left, on the right of a picture of the face"], []
    # Three witnesses of which way is out: the nose, the skin's normals, and where the head's bulk is.
    rim = [p[name] for s in "LR" for name in (f"eye_outer_{s}", f"mouth_corner_{s}") if name in p]
    nose = float(frame.at(p["nose_tip"])[2] - np.mean([frame.at(one)[2] for one in rim])) \
        if rim and "nose_tip" in p and _below(p) is not p["nose_tip"] else 0.0
    core = np.array([place for name, place in p.items() if name.startswith(("eye", "brow", "nose", "mouth", "chin"))])
    centre, reach = core.mean(axis=0), 1.5 * np.linalg.norm(np.ptp(core, axis=0))
    used = mesh.vertices[np.unique(mesh.faces)]
    near = used[((used - centre) ** 2).sum(axis=1) < reach**2]
    bulk = float((centre - near.mean(axis=0)) @ frame.z / frame.unit) if len(near) else 0.0
    outward = float(np.mean(_normals_at(core, mesh) @ frame.z))
    votes = [np.sign(v) if abs(v) > least else 0.0 for v, least in ((nose, 0.05), (bulk, 0.05), (outward, 0.1))]
    if sum(votes) < 0:
        return ["left and right are swapped in all landmarks (or the mesh is mirrored): the face would look backwards; "
                "_L is the subject's own left, on the right of a picture of the face"], []
    if votes[0] < 0:
        return ["'nose_tip' lies behind the eyes and the corners of the mouth; set it on the tip of the nose"], []
    return [], []


def _normals_at(places: Array, mesh: Mesh) -> Array:
    """Return the normals (k, 3) of the vertices nearest to places."""
    from scipy.spatial import cKDTree

    used = np.unique(mesh.faces)
    return vertex_normals(mesh.vertices, mesh.faces)[used[cKDTree(mesh.vertices[used]).query(places)[1]]]


# -- one part at a time --------------------------------------------------------------------------------------------
def _order(p: dict[str, Array], mesh: Mesh) -> tuple[list[str], list[str]]:
    frame = _frame(p)
    errors, warnings = [], []
    whole = [s for s in "LR" if all(f"{name}_{s}" in p for name in _EYE)]
    for s in whole if frame is not None else ():
        errors += _eye_order(p, s, frame)
    more_errors, more_warnings = _mouth_order(p)
    return errors + more_errors, warnings + more_warnings


def _eye_order(p: dict[str, Array], s: str, frame: _Frame) -> list[str]:
    """Corners, lids and brow of one eye. From outside, inner -> outer -> upper runs one way round in each eye."""
    inner, outer, upper, lower = (p[f"eye_{name}_{s}"] for name in ("inner", "outer", "upper", "lower"))
    side = 1.0 if s == "L" else -1.0
    both = all(f"{name}_{one}" in p for name in _EYE for one in "LR")
    between = (_eye(p, "L") + _eye(p, "R")) / 2 if both else frame.middle
    outward = _eye(p, s) - between + frame.unit * frame.z
    turn = side * np.cross(outer - inner, upper - lower)
    size = np.linalg.norm(outer - inner) * np.linalg.norm(upper - lower) * np.linalg.norm(outward)
    turned = float(turn @ outward) / size if size > 0 else 0.0
    across = side * float((outer - inner) @ frame.x) / max(float(np.linalg.norm(outer - inner)), 1e-300)
    if turned < -_CLEAR and across < 0:
        return [f"'eye_inner_{s}' and 'eye_outer_{s}' are swapped: the inner corner is the one beside the nose"]
    if turned < -_CLEAR:
        return [f"'eye_upper_{s}' lies below 'eye_lower_{s}'; swap them"]
    if across < -0.5 and turned > _CLEAR:
        return [f"'eye_inner_{s}' and 'eye_outer_{s}', and 'eye_upper_{s}' and 'eye_lower_{s}', are swapped"]
    errors = []
    width = max(float(np.linalg.norm(outer - inner)), 1e-300)
    up = upper - lower
    # A closed or painted eye has no height: up is then at right angles to its corners.
    up = up if np.linalg.norm(up) > 0.02 * width else np.cross(outward, (outer - inner) * side)
    up = up - (outer - inner) * (up @ (outer - inner)) / width**2
    up = up / max(np.linalg.norm(up), 1e-300)
    heights = {name: float((p[f"brow_{name}_{s}"] - _eye(p, s)) @ up) / width for name in ("inner", "mid", "outer")
               if f"brow_{name}_{s}" in p}
    if heights and (heights.get("mid", 0.0) < 0 or min(heights.values()) < -0.75):
        low = min(heights, key=heights.get)
        errors.append(f"'brow_{low}_{s}' lies below 'eye_upper_{s}'; brows lie above the eye, on the side of its upper "
                      "lid")
    ends = {"inner", "outer"} <= heights.keys()
    along = float((p[f"brow_outer_{s}"] - p[f"brow_inner_{s}"]) @ frame.x) if ends else 0.0
    if side * along < -0.3 * width:
        errors.append(f"'brow_inner_{s}' and 'brow_outer_{s}' are swapped: the inner end is the one beside the nose")
    return errors


def _mouth_order(p: dict[str, Array]) -> tuple[list[str], list[str]]:
    """Nose, upper lip, lower lip and chin, in this order along the way from nose to chin."""
    known = [name for name in ("mouth_top", "mouth_bottom", "mouth_corner_L", "mouth_corner_R") if name in p]
    if not known or "nose_tip" not in p or "chin" not in p:
        return [], []
    lips = np.mean([p[name] for name in known], axis=0)
    nose, chin = p["nose_tip"] - lips, p["chin"] - lips
    length = max(float(np.linalg.norm(p["nose_tip"] - p["chin"])), 1e-300)
    if float(nose @ chin) > 0.6 * np.linalg.norm(nose) * np.linalg.norm(chin):
        return ["'nose_tip' and 'chin' lie on the same side of the mouth; the chin is below the lower lip"], []
    down = (p["chin"] - p["nose_tip"]) / length
    order = ("mouth_top", "mouth_inner_top", "mouth_inner_bottom", "mouth_bottom")
    others = tuple(f"{name}_{s}" for name in ("nose_wing", "mouth_corner") for s in "LR")
    along = {name: float((p[name] - p["nose_tip"]) @ down) / length for name in (*order, *others) if name in p}
    order = tuple(name for name in order if name in p)
    errors, warnings = [], []

    def under(high: str, low: str, by: float = 0.0) -> bool:
        return high in along and low in along and along[high] > along[low] + by

    if under("mouth_top", "mouth_bottom"):
        errors.append("'mouth_top' lies under 'mouth_bottom'; swap them: top is the upper lip's outer edge")
    elif under("mouth_inner_top", "mouth_inner_bottom", 0.02):
        errors.append("'mouth_inner_top' lies under 'mouth_inner_bottom'; swap them")
    else:
        for above, below in pairwise(order):
            if along[above] > along[below] + 0.15:
                errors.append(f"'{above}' lies below '{below}'")
            elif along[above] > along[below] + 0.05:
                warnings.append(f"'{above}' lies below '{below}'; is that meant?")
    if along.get("mouth_bottom", 0.0) > 1.1:
        errors.append("'chin' lies above 'mouth_bottom'; the chin is below the lower lip")
    if "nose_bridge" in p and np.linalg.norm(nose) > 1.1 * np.linalg.norm(p["nose_bridge"] - lips):
        errors.append("'nose_tip' lies farther from the mouth than 'nose_bridge'; swap them")
    errors += [f"'nose_wing_{s}' lies below 'mouth_corner_{s}'" for s in "LR"
               if under(f"nose_wing_{s}", f"mouth_corner_{s}", 0.1)]
    return errors, warnings


def _positions(p: dict[str, Array]) -> tuple[list[str], list[str]]:
    """Single places that slipped: against their partner's mirror image, and against the average face."""
    errors, warnings = [], []
    frame = _frame(p)
    average = average_face()
    if frame is None or len(p.keys() & set(average)) < _TELLING:
        misfit = {}
    else:
        found = align(p, average)
        misfit = {name: float(np.linalg.norm(found.apply(p[name]) - average[name])) for name in p if name in average}
    if frame is None:
        return errors, warnings
    usual = float(np.median(list(misfit.values()))) if misfit else 0.0
    for name in _pairs(p):
        left, right = frame.at(p[f"{name}_L"]), frame.at(p[f"{name}_R"])
        odd = float(np.linalg.norm(left * [-1, 1, 1] - right))
        worse = max((f"{name}_L", f"{name}_R"), key=lambda one: misfit.get(one, 0.0))
        other = f"{name}_{'R' if worse.endswith('L') else 'L'}"
        if odd > _WRONG_MIRROR:
            errors.append(f"'{worse}' is on the wrong part of the face: far from the mirror image of '{other}'")
        elif odd > _ODD_MIRROR:
            warnings.append(f"'{worse}' is far from the mirror image of '{other}'; is that meant?")
    for name, place in p.items():
        if name.endswith(("_L", "_R")):
            continue
        off = abs(float(frame.at(place)[0]))
        if off > _WRONG_MIDDLE:
            errors.append(f"'{name}' is on the wrong part of the face: it belongs between left and right")
        elif off > _ODD_MIDDLE:
            warnings.append(f"'{name}' is beside the middle of the face; is that meant?")
    told = " ".join(errors + warnings)
    warnings += [f"'{name}' is far from where most faces have it; is that meant?" for name, off in misfit.items()
                 if off > max(_FAR, _FAR_TIMES * usual) and f"'{name}'" not in told]
    return errors, warnings
