"""The key light's cast shadows: nose on cheek, brow on eye, chin on neck.

Based on: L. Williams, "Casting curved shadows on curved surfaces", 1978 (depth seen from the light), and W. Reeves,
D. Salesin, R. Cook, "Rendering antialiased shadows with depth maps", 1987 (the share of many taps that is lit).

Computed for each vertex, so that every renderer draws the same. A tap hides a vertex if what the light sees there
stands out of the vertex's own tangent plane: no bias along the light is needed, which would either leave acne or
detach shadows from what casts them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.geometry.camera import Camera
from facegen.geometry.fade import smooth_step
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.render.occlusion import frame_round
from facegen.render.scene import Scene
from facegen.render.shading import light_directions
from facegen.render.zbuffer import prepare, scan

# Texels along a side of the map: half a millimetre on a head.
MAP = 512
# Radius of the soft edge, and how far a surface must stand out of the tangent plane to hide (fully at twice that),
# as shares of the mesh's diagonal: 7 and 1.3 mm on a head. The edge is wider than triangles at detail 2, which
# would show otherwise; a fold shallower than the second is shaded by its slope already.
SOFT_EDGE = 0.018
STANDS_OUT = 0.0033
# A surface that turns away from the light shades itself, softly, because light creeps into skin: shadows fade out
# between these cosines.
_FACING, _AWAY = 0.05, -0.35
# From this cosine on the tangent plane is held towards the light: a surface that turns away is hidden by the body
# behind it, which its own plane leaves below. Else a bright rim would part its shade from the shadow it casts.
_HELD = 0.2
# The darkest that a shadow gets: some of a large light's rays pass any edge.
_DEEPEST = 0.85
_TAPS = 61


def shadow(mesh: Mesh, towards: ArrayLike) -> NDArray[np.float32]:
    """Return how much of a distant light each vertex gets past what stands before it, (n,), 0 hidden .. 1 lit.

    towards: (3,) unit vector to the light, in the mesh's axes.
    """
    n = len(mesh.vertices)
    used = np.unique(mesh.faces)
    if not len(used):
        return np.ones(n, np.float32)
    towards = np.asarray(towards, dtype=np.float64)
    axes = frame_round(towards, np.array([0.0, 1.0, 0.0] if abs(towards[1]) < 0.9 else [0.0, 0.0, 1.0]))
    local = mesh.vertices @ axes.T                                             # across, along, towards the light
    low, high = local[used].min(axis=0), local[used].max(axis=0)
    diagonal = math.sqrt(((high - low) ** 2).sum()) or 1.0
    radius = SOFT_EDGE * diagonal
    texel = (max(high[:2] - low[:2]) + 2 * radius) / (MAP - 2)
    place = (local[:, :2] - (low + high)[:2] / 2) / texel + MAP / 2
    heights = _seen_by_light(place, local[:, 2], mesh.faces)

    normal = vertex_normals(mesh.vertices, mesh.faces) @ axes.T
    facing = normal[:, 2].copy()
    turned = smooth_step((_FACING - facing) / (_FACING - _AWAY))
    normal[:, 2] = np.maximum(facing, _HELD)
    normal /= np.sqrt((normal * normal).sum(axis=1, keepdims=True))
    rows = np.intersect1d(np.flatnonzero(turned < 1), used)
    slope, hidden = normal[rows].T, np.zeros(len(rows))
    x, y = place[rows].T
    # How far what is seen at a tap stands out of the tangent plane, less what may stand out freely.
    base = slope[2] * local[rows, 2] + STANDS_OUT * diagonal
    for across, along in _disc(_TAPS) * (radius / texel):
        column, row = np.floor(x + across), np.floor(y + along)
        # Taken at the texel's centre, where it was seen.
        out = ((column + 0.5 - x) * slope[0] + (row + 0.5 - y) * slope[1]) * texel
        out += heights[row.astype(np.intp), column.astype(np.intp)] * slope[2] - base
        hidden += np.clip(out / (STANDS_OUT * diagonal), 0, 1)
    hidden /= _TAPS
    lit = np.ones(n, np.float32)
    lit[rows] = 1 - _DEEPEST * hidden * (1 - turned[rows])
    return lit


def with_shadows(light: NDArray[np.float32], mesh: Mesh, camera: Camera, scene: Scene) -> NDArray[np.float32]:
    """Return the shares (n, 1 + lights) of ambient and lights with the shadow that the key, the first light, casts.

    Only the key: it makes the picture's shadows; those of fill and rims would cross it as no window's light does.
    """
    if not scene.lights:
        return light
    light = light.copy()
    light[:, 1] *= shadow(mesh, light_directions(scene)[0] @ camera.rotation)
    return light


def _seen_by_light(place: NDArray, height: NDArray, faces: NDArray) -> NDArray[np.float64]:
    """Return the height (MAP, MAP) towards the light of what it sees in each texel; very low where nothing is.

    place: (n, 2) texels. height: (n,).
    """
    low, high = height[faces].min(), height[faces].max()
    span = (high - low) or 1.0
    nearness = 0.01 + 0.98 * (height - low) / span
    triangles = prepare(np.column_stack([place, nearness]), faces, width=MAP, height=MAP, samples=1)
    ids, near = (a[:, 0] for a in scan(triangles))
    return np.where(ids >= 0, low + (near.astype(np.float64) - 0.01) / 0.98 * span, low - 10 * span)


def _disc(count: int) -> NDArray[np.float64]:
    """Return points (count, 2) spread over the unit disc, denser in its middle: a bell, not a plate.

    H. Vogel's spiral, "A better way to construct the sunflower head", 1979, with each point's opposite, so that a
    mirrored scene has the mirrored shadow.
    """
    k = np.arange(count // 2) + 0.5
    distance, turn = (k / (count // 2)) ** 0.7, k * math.pi * (3 - math.sqrt(5))
    half = np.stack([distance * np.cos(turn), distance * np.sin(turn)], axis=1)
    return np.concatenate([half, -half, np.zeros((count % 2, 2))])
