"""Small meshes for the renderer's tests."""

from dataclasses import replace

import numpy as np

from facegen.geometry.mesh import Mesh, merge
from facegen.render import Renderer, render


def sphere(material="skin", *, rings=24, radius=1.0, centre=(0, 0, 0), part="skin") -> Mesh:
    """A sphere whose triangulation mirrors itself in x."""
    turns = 2 * rings
    polar = np.pi * np.arange(1, rings) / rings
    around = 2 * np.pi * np.arange(turns) / turns
    ring = np.stack([np.outer(np.sin(polar), np.sin(around)), np.outer(np.cos(polar), np.ones(turns)),
                     np.outer(np.sin(polar), np.cos(around))], axis=-1).reshape(-1, 3)
    vertices = np.concatenate([ring, [[0, 1, 0], [0, -1, 0]]])
    top, bottom = len(vertices) - 2, len(vertices) - 1
    faces = []
    for t in range(turns):
        n = (t + 1) % turns
        faces += [[top, t, n], [bottom, (rings - 2) * turns + n, (rings - 2) * turns + t]]
        for r in range(rings - 2):
            a, b, c, d = r * turns + t, (r + 1) * turns + t, (r + 1) * turns + n, r * turns + n
            faces += [[a, b, c], [a, c, d]] if t < rings else [[a, b, d], [b, c, d]]
    return Mesh.of(vertices * radius + centre, faces, material=material, part=part)


def box(material="skin", *, half=(1, 1, 1), centre=(0, 0, 0), part="box", cells=6) -> Mesh:
    """A box of six sides that share no vertices, each a grid of cells."""
    k = np.linspace(-1, 1, cells + 1)
    u, v = (a.ravel() for a in np.meshgrid(k, k, indexing="ij"))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij"))
    a = i * (cells + 1) + j
    side_faces = np.concatenate([np.stack([a, a + cells + 1, a + cells + 2], 1),
                                 np.stack([a, a + cells + 2, a + 1], 1)])
    sides = []
    for axis in range(3):
        for sign in (1, -1):
            side = np.empty((len(u), 3))
            side[:, axis], side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = sign, u, sign * v
            sides.append(Mesh.of(side * half + centre, side_faces, material=material, part=part))
    return merge(sides)


def shuffled(mesh: Mesh, seed=0) -> Mesh:
    """The same mesh with its faces in another order, each starting at another corner."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(mesh.faces))
    start = rng.integers(0, 3, len(order))[:, None]
    faces = np.take_along_axis(mesh.faces[order], (np.arange(3) + start) % 3, axis=1)
    return replace(mesh, faces=faces, face_materials=mesh.face_materials[order],
                   face_parts=mesh.face_parts[order])


def shadow_change(face, renderer, occlusion):
    """What shadows change in a picture; a renderer that is kept draws it, after another pose."""
    options = {"size": 96, "detail": 1, "view": (20, 0), "occlusion": occlusion, "renderer": renderer}
    drawn = Renderer(face, shadows=True, **options)
    drawn.draw("surprise")
    return drawn.draw("anger").astype(int) - render(face, "anger", **options)
