"""Brightness per pixel: normals interpolated across the triangle, light computed at the point (Akimoto
1986, 3.2).

All vectors are in camera axes (right, up, to the viewer); all colours are linear light until `to_srgb`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.srgb import to_linear
from facegen.fileio.srgb import to_srgb as encoded
from facegen.geometry.camera import Camera
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import face_normals, vertex_normals
from facegen.render.occlusion import light_shares, visibility
from facegen.render.scene import CLAY, INSIDE, Material, Scene

# Linear brightness above which the tone curve bends, so that highlights keep their colour and never clip
# flat.
SHOULDER = 0.72
# Openness of the darkest cavity: because some light always scatters in, and black has no shape.
DARKEST = 0.05
# Openness of every inner side: dim, so that an open mouth or neck is dark but keeps its colour.
INSIDE_LIGHT = 0.45
# Cavities darker than their openness alone: the bake's grid cannot see folds finer than its cells.
CAVITY = 1.3
# Share of the light that bounces on inside a cavity.
BOUNCE = 0.6
# The catch-light is the mirror image of a round window: full within, gone beyond these cosines of normal
# and half vector (5 and 7.5 degrees, a disc of about two millimetres on a cornea).
WINDOW_FULL, WINDOW_GONE = 0.9962, 0.9914


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh prepared for shading in one view.

    normals: (n or m, 3) float32 in camera axes, a vertex's or (flat) a triangle's. light: (n, 1 + lights)
    float32, the ambient openness and each light's share. planes: (m, 3, 3) float32 weights of the corners
    as functions of pixel offsets from ``origin`` (m, 2). back: (m,) seen from inside. material: (m,) row of
    the tables. colours: (n, 3) float32 linear albedo of the vertices, or None.
    """

    faces: NDArray[np.int32]
    normals: NDArray[np.float32]
    flat: bool
    light: NDArray[np.float32]
    planes: NDArray[np.float32]
    origin: NDArray[np.float64]
    back: NDArray[np.bool_]
    material: NDArray[np.int32]
    albedo: NDArray[np.float32]
    wrap: NDArray[np.float32]
    gloss: NDArray[np.float32]
    colours: NDArray[np.float32] | None = None


def surface(mesh: Mesh, camera: Camera, scene: Scene, *, flat: bool = False, light: NDArray[np.float32] | None = None,
            normals: NDArray | None = None) -> Surface:
    """Return a mesh prepared for shading.

    light: (n, 1 + lights) from `baked_light`; None means that nothing is hidden. normals: (n, 3) of the vertices,
    where they are known already.
    """
    if light is None:
        light = np.ones((len(mesh.vertices), 1 + len(scene.lights)), np.float32)
    if flat:
        normals = face_normals(mesh.vertices, mesh.faces)
    elif normals is None:
        normals = vertex_normals(mesh.vertices, mesh.faces)
    planes, origin, back = _corner_weights(mesh, camera)
    material = np.where(back, len(mesh.materials), mesh.face_materials).astype(np.int32)
    rows = material_rows(mesh, scene)
    return Surface(mesh.faces, (normals @ camera.rotation.T).astype(np.float32), flat, light, planes, origin, back,
                   material, rows[:, :3], rows[:, 3:6], rows[:, 6:], vertex_albedo(mesh))


def baked_light(mesh: Mesh, normals: NDArray, camera: Camera, scene: Scene) -> NDArray[np.float32]:
    """Return what reaches each vertex (n, 1 + lights): the ambient openness, and its share of each light."""
    towards = light_directions(scene) @ camera.rotation
    spreads = np.array([lamp.spread for lamp in scene.lights])
    return light_shares(visibility(mesh), normals, mesh.faces, towards, spreads)


def material_rows(mesh: Mesh, scene: Scene) -> NDArray[np.float32]:
    """Return (k + 1, 10): albedo (linear), wrap, specular, shininess, catch and lift of each of the mesh's materials,
    and of the inside last."""
    looks: list[Material] = [scene.materials.get(name, CLAY) for name in mesh.materials] + [INSIDE]
    return np.array([(*from_srgb(look.albedo), *look.wrap, look.specular, look.shininess, look.catch, look.lift)
                     for look in looks], np.float32)


def vertex_albedo(mesh: Mesh) -> NDArray[np.float32] | None:
    """Return the linear albedo (n, 3) of a mesh's vertices, or None if it leaves that to the materials."""
    return None if mesh.colours is None else to_linear(mesh.colours).astype(np.float32)


def light_directions(scene: Scene) -> NDArray[np.float64]:
    """Return unit vectors (k, 3) to the lights, camera axes."""
    return np.array([unit(lamp.towards) for lamp in scene.lights]).reshape(-1, 3)


def shade(surface: Surface, camera: Camera, scene: Scene, ids: NDArray, x: NDArray, y: NDArray
          ) -> NDArray[np.float32]:
    """Return linear colours (3, k) of the triangles ``ids`` at pixel coordinates x, y, all (k,)."""
    s = surface
    corners = s.faces[ids]
    b = _barycentrics(s, ids, x, y)
    light = sum(b[k, :, None] * s.light[corners[:, k]] for k in range(3)).T
    normal = s.normals[ids].T if s.flat else sum(b[k, :, None] * s.normals[corners[:, k]] for k in range(3)).T
    normal = np.where(s.back[ids], -normal, normal)
    normal /= np.maximum(np.sqrt((normal * normal).sum(axis=0)), np.float32(1e-12))
    viewer = np.stack(camera.rays(x.astype(np.float32), y.astype(np.float32)))

    material = s.material[ids]
    albedo, wrap = s.albedo[material].T, s.wrap[material].T
    specular, shininess, catch, lift = s.gloss[material].T
    lifted = np.flatnonzero(lift)
    light[:, lifted] **= 1 - lift[lifted]
    inside = s.back[ids]
    if s.colours is not None:
        albedo = np.where(inside, albedo, sum(b[k, :, None] * s.colours[corners[:, k]] for k in range(3)).T)

    # Ambient: sky above, ground below; light that bounces in a cavity returns coloured: E = a / (1 - c (1 -
    # a)).
    free = np.float32(DARKEST) + np.float32(1 - DARKEST) * light[0] ** np.float32(CAVITY)
    free = np.where(inside, np.float32(INSIDE_LIGHT), free)
    up = 0.5 + 0.5 * normal[1]
    colour = np.empty((3, len(ids)), np.float32)
    for c in range(3):
        ambient = np.float32(scene.ground[c]) + np.float32(scene.sky[c] - scene.ground[c]) * up
        colour[c] = ambient * free / (1 - np.float32(BOUNCE) * albedo[c] * (1 - free))

    shine = np.zeros((3, len(ids)), np.float32)
    for k, lamp in enumerate(scene.lights):
        towards = unit(lamp.towards).astype(np.float32)
        facing = towards @ normal
        reach = np.where(inside, np.float32(0), light[1 + k])
        half = viewer + towards[:, None]
        half /= np.sqrt((half * half).sum(axis=0))
        lobe = np.exp(-shininess * (1 - (half * normal).sum(axis=0)))
        lobe *= np.clip(facing * 4, 0, 1) * reach * specular * np.float32(lamp.highlight)
        for c in range(3):
            soft = np.maximum((facing + wrap[c]) / (1 + wrap[c]), 0)
            colour[c] += np.float32(lamp.colour[c]) * soft * reach
            shine[c] += np.float32(lamp.colour[c]) * lobe
    shine += _catch_light(normal, viewer, scene, catch)
    return _tone(colour * albedo + shine)


def _catch_light(normal: NDArray, viewer: NDArray, scene: Scene, catch: NDArray) -> NDArray[np.float32]:
    """Return the window mirrored in wet eyes, (k,)."""
    bright = np.zeros_like(catch)
    wet = np.flatnonzero(catch)
    half = viewer[:, wet] + unit(scene.window).astype(np.float32)[:, None]
    half /= np.sqrt((half * half).sum(axis=0))
    cosine = (half * normal[:, wet]).sum(axis=0)
    bright[wet] = catch[wet] * np.clip((cosine - WINDOW_GONE) / (WINDOW_FULL - WINDOW_GONE), 0, 1)
    return bright


def to_srgb(linear: NDArray) -> NDArray[np.uint8]:
    """Return 8-bit sRGB of linear values 0..1, through a table."""
    table = srgb_table()
    return table[(np.clip(linear, 0, 1) * np.float32(len(table) - 1) + np.float32(0.5)).astype(np.intp)]


def from_srgb(colour: tuple[float, float, float]) -> NDArray[np.float32]:
    """Return the linear value of an sRGB colour 0..255, (3,)."""
    return to_linear(colour).astype(np.float32)


def _barycentrics(s: Surface, ids: NDArray, x: NDArray, y: NDArray) -> NDArray[np.float32]:
    """Return perspective-correct weights of the corners (3, k), held inside the triangle."""
    origin = s.origin[ids]
    dx, dy = (x - origin[:, 0]).astype(np.float32), (y - origin[:, 1]).astype(np.float32)
    plane = s.planes[ids]
    b = np.stack([plane[:, k, 0] * dx + plane[:, k, 1] * dy + plane[:, k, 2] for k in range(3)])
    np.maximum(b, 0, out=b)
    b /= np.maximum(b.sum(axis=0), np.float32(1e-20))
    return b


def _corner_weights(mesh: Mesh, camera: Camera) -> tuple[NDArray[np.float32], NDArray, NDArray[np.bool_]]:
    """Return for each triangle the linear functions of the pixel that are proportional to its corner weights.

    With the corners h_i = w_i (x_i, y_i, 1), w the depth (1 if orthographic), the point at pixel p is
    sum b_i h_i ~ (p, 1), so b_i ~ (h_j x h_k) . (p, 1): Olano and Greer, "Triangle scan conversion using 2D
    homogeneous coordinates", 1997. Positions are taken from the first corner, so float32 suffices afterwards.
    """
    points = camera.project(mesh.vertices)[mesh.faces]
    origin = points[:, 0, :2].copy()
    depth = np.ones_like(points[..., 2]) if camera.orthographic else np.maximum(points[..., 2], camera.near)
    h = np.concatenate([(points[..., :2] - origin[:, None]) * depth[..., None], depth[..., None]], axis=-1)
    planes = np.stack([np.cross(h[:, (k + 1) % 3], h[:, (k + 2) % 3]) for k in range(3)], axis=1)
    volume = np.einsum("mi,mi->m", planes[:, 0], h[:, 0])
    # Counter-clockwise seen by the viewer is clockwise in pixels, whose y runs down: a negative volume.
    planes /= np.where(volume == 0, 1.0, volume)[:, None, None]
    return planes.astype(np.float32), origin, volume > 0


def unit(vector: tuple[float, float, float]) -> NDArray[np.float64]:
    """Return the vector at length one."""
    vector = np.asarray(vector, dtype=np.float64)
    return vector / np.sqrt(vector @ vector)


def _tone(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return linear light with a soft shoulder: unchanged up to it, then towards 1 with the same slope."""
    room = np.float32(1 - SHOULDER)
    above = np.maximum(linear - np.float32(SHOULDER), 0)
    return np.minimum(linear, np.float32(SHOULDER)) + above * room / (above + room)


@cache
def srgb_table() -> NDArray[np.uint8]:
    """Return the sRGB bytes of 4096 linear values 0..1."""
    return np.rint(encoded(np.arange(4096) / 4095)).astype(np.uint8)
