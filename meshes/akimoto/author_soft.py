"""Author the parts that follow the skin or line the mouth: brows, a short hair cap, the mouth's lining.

Writes ``soft.obj`` beside this file from ``cage.obj`` and ``face.yaml`` alone (numpy and facegen).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from fit_cage import first_hit
from scipy.interpolate import PchipInterpolator

from facegen.facs.yamlfile import read_data
from facegen.fileio.obj import format_obj, load_obj
from facegen.geometry.mesh import Mesh, merge
from facegen.geometry.normals import vertex_normals
from facegen.geometry.subdivision import loop_levels

HERE = Path(__file__).resolve().parent

# Middle line of the left brow seen from the front (x, y), and its half height there, mm.
BROW = [(10.2, 12.6, 0.7), (12.0, 13.2, 2.1), (14.6, 14.2, 3.0), (20.0, 15.7, 3.4), (27.0, 17.2, 3.2), (34.0, 18.0, 2.7), (40.5, 17.2, 2.1),
        (46.5, 14.7, 1.4), (51.5, 11.2, 0.5)]

# Hairline: angle about the vertical through (0, *, -70), degrees from the front -> height, mm.
HAIRLINE = [(0, 66), (12, 67), (28, 62), (40, 50), (47, 36), (56, 26), (64, 15), (70, 4), (75, 3), (82, 12), (90, 14),
            (101, 8), (107, -14), (118, -40), (140, -56), (180, -62)]
HAIR_THICKNESS = 7.0


def brows(surface, faces) -> Mesh:
    """Two ribbons that lie on the brow ridge, thickest along the middle."""
    knots = np.array(BROW)
    run = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(knots[:, :2], axis=0).T))])
    t = np.linspace(0, run[-1], 19)
    line = np.column_stack([np.interp(t, run, knots[:, k]) for k in range(3)])
    for _ in range(2):                       # round the knots' corners
        line[1:-1] = (line[:-2] + 2 * line[1:-1] + line[2:]) / 4
    along = np.gradient(line[:, :2], axis=0)
    across = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    rows, lift = np.array([-1.0, -0.5, 0.0, 0.5, 1.0]), np.array([0.12, 0.45, 0.6, 0.45, 0.12])
    points = []
    for (x, y, half), a in zip(line, across, strict=True):
        for r, up in zip(rows, lift, strict=True):
            px, py = np.array([x, y]) + a * r * half
            hit = first_hit(np.array([px, py, 200.0]), np.array([0, 0, -1.0]), surface, faces)
            n = np.array([0.35 * px / 50, 0.1, 1.0])
            points.append(hit + up * min(1.0, half / 1.6) * n / np.linalg.norm(n))
    points = np.array(points)
    k = len(rows)
    quads = [(i * k + j, (i + 1) * k + j, (i + 1) * k + j + 1, i * k + j + 1)
             for i in range(len(line) - 1) for j in range(k - 1)]
    tri = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    left = Mesh.of(points, tri, material="brows", part="brows")
    right = Mesh.of(points * [-1, 1, 1], tri[:, ::-1], material="brows", part="brows")
    return merge([left, right])


def hair(surface, faces) -> Mesh:
    """The scalp above the hairline, cut exactly along it and lifted."""
    angles, heights = np.array(HAIRLINE, float).T
    phi = np.degrees(np.arctan2(np.abs(surface[:, 0]), surface[:, 2] + 70.0))
    h = surface[:, 1] - PchipInterpolator(angles, heights)(phi)
    h[np.abs(surface[:, 0]) > 74] = -50.0       # not the ears
    normals = vertex_normals(surface, faces)
    points, lifted, made, out = list(surface), list(normals), {}, []
    height = list(h)

    def cut(i, j):
        key = (min(i, j), max(i, j))
        if key not in made:
            t = h[key[0]] / (h[key[0]] - h[key[1]])
            made[key] = len(points)
            points.append(surface[key[0]] + t * (surface[key[1]] - surface[key[0]]))
            lifted.append(normals[key[0]] + t * (normals[key[1]] - normals[key[0]]))
            height.append(0.0)
        return made[key]

    for face in faces:
        inside = [v for v in face if h[v] > 0]
        if not inside:
            continue
        polygon = []
        for i in range(3):
            a, b = face[i], face[(i + 1) % 3]
            if h[a] > 0:
                polygon.append(a)
            if (h[a] > 0) != (h[b] > 0):
                polygon.append(cut(a, b))
        out += [(polygon[0], polygon[i], polygon[i + 1]) for i in range(1, len(polygon) - 1)]
    used, tri = np.unique(np.array(out), return_inverse=True)
    points, lifted, height = (np.array(a)[used] for a in (points, lifted, height))
    thick = np.where(height > 1e-9, HAIR_THICKNESS * (1.0 - np.exp(-(height + 1.5) / 9.0)), 0.25)
    lifted /= np.linalg.norm(lifted, axis=1, keepdims=True)
    return Mesh.of(points + thick[:, None] * lifted, tri.reshape(-1, 3), material="hair", part="hair")


def mouth() -> Mesh:
    """The lining behind the teeth: an open bag, seen from inside."""
    rings = [(21.0, -65.0, 18.0, 17.0), (-3.0, -63.5, 34.0, 23.5), (-12.0, -63.0, 34.5, 22.0),
             (-26.0, -63.0, 35.0, 20.5), (-38.0, -63.5, 30.0, 17.5), (-48.0, -65.0, 20.0, 13.0), (-54.0, -66.5, 8.0, 6.0)]
    n = 20
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    points = [[w * np.cos(a), y + h * np.sin(a), z] for z, y, w, h in rings for a in angle]
    for i, a in enumerate(angle):            # the rim meets the lips: far forward in the middle, back at the corners
        points[i] = [31.0 * np.cos(a), -66.0 + 17.5 * np.sin(a), 1.0 + 21.0 * np.sin(a) ** 2]
    points.append([0.0, -67.0, -56.0])
    tri = []
    for r in range(len(rings) - 1):
        for i in range(n):
            a, b = r * n + i, r * n + (i + 1) % n
            tri += [(a, b, b + n), (a, b + n, a + n)]
    last = (len(rings) - 1) * n
    tri += [(last + i, last + (i + 1) % n, len(points) - 1) for i in range(n)]
    return Mesh.of(np.array(points), np.array(tri), material="mouth", part="mouth")


def main() -> None:
    """Author and write."""
    cage = load_obj(HERE / "cage.obj")
    data = read_data(HERE / "face.yaml")
    sub = loop_levels(len(cage.vertices), cage.faces, np.array(data["creases"]), 3, corners=data["corners"])
    surface, faces = sub[3].matrix @ cage.vertices, sub[3].faces
    whole = merge([brows(surface, faces), hair(surface, faces), mouth()])
    (HERE / "soft.obj").write_text(format_obj(whole, comment=(
        "Brows, hair cap and mouth lining of facegen's base face: own work of the facegen authors, MIT licence.\n"
        "Written by author_soft.py; millimetres.")))
    print(len(whole.faces), "triangles")


if __name__ == "__main__":
    main()
