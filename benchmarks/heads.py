"""What the renderers are given: one head cut into any number of triangles, in motion, as plain arrays.

The arrays are saved in one file a head, so that a process that draws with a peer needs NumPy and that peer alone.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

import facegen
from facegen.geometry.camera import Camera, frame
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.render.scene import CLAY, Scene

# Frames of the motion that is drawn round and round: neutral to happiness and back.
FRAMES = 8
# Depths between which the head lies, as shares of the camera's distance: OpenGL wants to know.
_NEAR, _FAR = 0.5, 1.5


def save(folder: Path, triangles: int, size: int) -> Path:
    """Write the skin of the face, cut into a number of triangles, and return the file."""
    face = facegen.load_face()
    level = max((d for d in range(4) if _skin_count(face, d) <= triangles), default=0)
    mesh = face.mesh(level)
    rows = mesh.part_vertices("skin")
    skin = mesh.face_parts == mesh.parts.index("skin")
    faces, parents, matrix = refined(np.searchsorted(rows, mesh.faces[skin]), mesh.vertices[rows], triangles)
    materials = mesh.face_materials[skin][parents]
    poses = [matrix @ pose[rows] for pose in _motion(face, level)]
    return _write(folder / f"skin-{triangles}-{size}.npz", poses, faces, mesh.materials, materials, size)


def save_whole(folder: Path, detail: int, size: int) -> Path:
    """Write the whole face with hair, eyes and mouth at a detail, and return the file."""
    face = facegen.load_face()
    mesh = face.mesh(detail)
    return _write(folder / f"face-{detail}-{size}.npz", _motion(face, detail), mesh.faces, mesh.materials,
                  mesh.face_materials, size)


def refined(faces: NDArray, points: NDArray, triangles: int) -> tuple[NDArray, NDArray, sparse.csr_array]:
    """Return faces, the triangle each came from, and the matrix (new, old) of the vertices, cut by longest edges.

    A round halves the long edges that are the longest of all triangles they border; so no triangle is cut twice.
    """
    matrix, parents = sparse.csr_array(sparse.identity(len(points), format="csr")), np.arange(len(faces))
    while len(faces) < triangles:
        position = matrix @ points
        ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
        edges, edge_of = np.unique(ends, axis=0, return_inverse=True)
        edge_of = edge_of.reshape(-1, 3)
        lengths = np.linalg.norm(position[edges[:, 0]] - position[edges[:, 1]], axis=1)
        order = np.argsort(-lengths)
        rank = np.argsort(order)
        longest = edge_of[np.arange(len(faces)), rank[edge_of].argmin(axis=1)]
        borders = np.bincount(edge_of.ravel(), minlength=len(edges))
        # Not much shorter ones than the longest of all: the triangles shall become alike.
        chosen = (np.bincount(longest, minlength=len(edges)) == borders) & (lengths > lengths.max() / 1.4)
        order = order[chosen[order]]
        order = order[np.cumsum(borders[order]) <= max(triangles - len(faces), borders[order[0]])]
        middle = np.full(len(edges), -1)
        middle[order] = len(position) + np.arange(len(order))
        rows = np.flatnonzero(middle[longest] >= 0)
        side = (edge_of[rows] == longest[rows, None]).argmax(axis=1)
        a, b, c = (faces[rows, (side + k) % 3] for k in range(3))
        new = middle[longest[rows]]
        faces = np.concatenate([faces, np.stack([new, b, c], axis=1)])
        faces[rows] = np.stack([a, new, c], axis=1)
        parents = np.concatenate([parents, parents[rows]])
        ends_of = np.repeat(np.arange(len(order)), 2), edges[order].ravel()
        half = sparse.csr_array((np.full(2 * len(order), 0.5), ends_of), shape=(len(order), len(position)))
        matrix = sparse.csr_array(sparse.vstack([matrix, half @ matrix]))
    return _in_order(faces, parents, matrix)


def _in_order(faces: NDArray, parents: NDArray, matrix: sparse.csr_array) -> tuple[NDArray, NDArray, sparse.csr_array]:
    """Return the same with neighbours near each other in memory: scattered vertices would slow every renderer."""
    rows = np.argsort(parents, kind="stable")
    faces, parents = faces[rows], parents[rows]
    used, first = np.unique(faces.ravel(), return_index=True)
    order = used[np.argsort(first)]
    place = np.empty(matrix.shape[0], np.int32)
    place[order] = np.arange(len(order))
    return place[faces], parents, sparse.csr_array(matrix[order])


def _skin_count(face: facegen.Face, detail: int) -> int:
    mesh = face.mesh(detail)
    return int((mesh.face_parts == mesh.parts.index("skin")).sum())


def _motion(face: facegen.Face, detail: int) -> list[NDArray]:
    amounts = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(FRAMES) / FRAMES)
    return [face.pose("happiness", intensity=float(amount), detail=detail) for amount in amounts]


def _write(path: Path, poses: list[NDArray], faces: NDArray, materials: tuple[str, ...], face_materials: NDArray,
           size: int) -> Path:
    camera = frame(poses[0], size=(size, size))
    view, projection = matrices(camera)
    normals = np.stack([vertex_normals(pose, faces) for pose in poses]).astype(np.float32)
    np.savez(path, poses=np.stack(poses), poses32=np.stack(poses).astype(np.float32), normals=normals, faces=faces,
             materials=np.array(materials), face_materials=face_materials, size=size, view=view, projection=projection,
             target=camera.target, distance=camera.distance, colours=_colours(len(poses[0]), faces, materials,
                                                                              face_materials),
             lights=np.array([(*np.divide(lamp.towards, np.linalg.norm(lamp.towards)), *lamp.colour)
                              for lamp in Scene().lights[:3]], np.float32))
    return path


def _colours(count: int, faces: NDArray, materials: tuple[str, ...], face_materials: NDArray) -> NDArray[np.float32]:
    """Return sRGB 0..1 (n, 3): a vertex has the colour of one of its triangles' materials."""
    looks = Scene().materials
    palette = np.array([looks.get(name, CLAY).albedo for name in materials], np.float32) / 255
    colours = np.zeros((count, 3), np.float32)
    colours[faces.ravel()] = np.repeat(palette[face_materials], 3, axis=0)
    return colours


def matrices(camera: Camera) -> tuple[NDArray, NDArray]:
    """Return OpenGL's view and projection (4, 4) of a camera."""
    view = np.eye(4)
    view[:3, :3] = camera.rotation
    view[:3, 3] = -camera.rotation @ camera.target
    view[2, 3] -= camera.distance
    near, far = _NEAR * camera.distance, _FAR * camera.distance
    projection = np.zeros((4, 4))
    projection[0, 0] = 2 * camera.scale * camera.distance / camera.width
    projection[1, 1] = 2 * camera.scale * camera.distance / camera.height
    projection[0, 2] = 1 - 2 * camera.offset[0] / camera.width
    projection[1, 2] = 2 * camera.offset[1] / camera.height - 1
    projection[2, 2:] = -(far + near) / (far - near), -2 * far * near / (far - near)
    projection[3, 2] = -1
    return view, projection


def mesh_of(head) -> Mesh:
    """Return a saved head as facegen's mesh."""
    zeros = np.zeros(len(head["faces"]), np.int32)
    return Mesh(head["poses"][0], head["faces"], tuple(str(name) for name in head["materials"]),
                head["face_materials"], ("head",), zeros)
