"""Landmarks of a person, a cat and a horse, set by hand, and meshes to hang them on."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from facegen.face.landmarks import REQUIRED
from facegen.geometry.mesh import Mesh
from facegen.transfer.landmark_checks import average_face
from facegen.transfer.landmarks import Landmarks


def average() -> dict[str, np.ndarray]:
    return {name: place.copy() for name, place in average_face().items() if name in REQUIRED}


def person() -> dict[str, np.ndarray]:
    """The average face, a little asymmetric."""
    rng = np.random.default_rng(4)
    return {name: place * [1.05, 0.95, 1.1] + rng.normal(scale=1.2, size=3) for name, place in average().items()}


def _mirrored(half: dict[str, tuple], middle: dict[str, tuple]) -> dict[str, np.ndarray]:
    points = {name: np.array(place, float) for name, place in middle.items()}
    for name, place in half.items():
        points[f"{name}_L"] = np.array(place, float)
        points[f"{name}_R"] = np.array(place, float) * [-1, 1, 1]
    return points


def cat() -> dict[str, np.ndarray]:
    """Centimetres."""
    return _mirrored({
        "eye_inner": (1.3, 0.0, 1.0), "eye_outer": (3.0, 0.6, 0.2), "eye_upper": (2.1, 1.0, 1.0),
        "eye_lower": (2.2, -0.5, 0.9), "brow_inner": (1.2, 1.6, 1.0), "brow_mid": (2.1, 2.0, 0.6),
        "brow_outer": (3.1, 1.7, -0.2), "nose_wing": (0.5, -1.4, 2.1), "mouth_corner": (1.3, -2.6, 1.2),
    }, {
        "nose_bridge": (0, 0.0, 1.5), "nose_tip": (0, -1.2, 2.4), "mouth_top": (0, -2.0, 2.2),
        "mouth_inner_top": (0, -2.3, 2.0), "mouth_inner_bottom": (0, -2.4, 1.9), "mouth_bottom": (0, -2.8, 1.7),
        "chin": (0, -3.3, 1.4),
    })


def horse() -> dict[str, np.ndarray]:
    """Centimetres: x aside, then forward along the muzzle, then up from it; the head hangs by 45 degrees."""
    flat = _mirrored({
        "eye_inner": (8.2, 2.2, -0.3), "eye_outer": (9.6, -2.0, 0.3), "eye_upper": (9.0, 0.2, 1.3),
        "eye_lower": (9.7, 0.0, -1.2), "brow_inner": (7.2, 2.4, 2.4), "brow_mid": (7.8, 0.0, 3.0),
        "brow_outer": (8.2, -2.4, 2.6), "nose_wing": (4.2, 33.0, -0.5), "mouth_corner": (4.4, 26.0, -7.0),
    }, {
        "nose_bridge": (0, 8.0, 4.5), "nose_tip": (0, 37.0, 0.0), "mouth_top": (0, 37.0, -4.0),
        "mouth_inner_top": (0, 36.2, -5.5), "mouth_inner_bottom": (0, 35.8, -5.9), "mouth_bottom": (0, 34.5, -7.8),
        "chin": (0, 30.0, -10.0),
    })
    c = np.sqrt(0.5)
    return {name: np.array([x, c * (up - ahead), c * (up + ahead)]) for name, (x, ahead, up) in flat.items()}


def hung(points: dict[str, np.ndarray]) -> tuple[Landmarks, Mesh]:
    """The landmarks as vertices of a mesh: the hull of them and of the head behind them."""
    places = np.array(list(points.values()))
    core = places.mean(axis=0)
    size = np.ptp(places, axis=0).max()
    up = points["brow_mid_L"] + points["brow_mid_R"] - points["mouth_corner_L"] - points["mouth_corner_R"]
    out = np.cross(points["eye_outer_L"] - points["eye_outer_R"], up)
    back = core - size * out / np.linalg.norm(out)
    ring = np.random.default_rng(2).normal(size=(30, 3))
    behind = back + 0.45 * size * ring / np.linalg.norm(ring, axis=1, keepdims=True)
    vertices = np.concatenate([places, behind])
    hull = ConvexHull(vertices)
    faces = hull.simplices.copy()
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    corners = np.repeat(np.arange(len(points))[:, None], 3, axis=1)
    weights = np.tile([1.0, 0.0, 0.0], (len(points), 1))
    return Landmarks(tuple(points), np.zeros(len(points), int), corners, weights), Mesh.of(vertices, faces)
