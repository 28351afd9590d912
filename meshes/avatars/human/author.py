"""Author the avatar "human": the head of an old man. Writes human.obj, human.mtl and landmarks.yaml.

    python meshes/avatars/human/author.py [FOLDER]

The head is a cage of quads in rows and loops (head_cage, eyes, mouth, ears) laid over the general shape of facegen's
own base face, aged (age), subdivided once by Catmull and Clark's rules (quads), wrinkled and dressed (parts).
"""

from __future__ import annotations

import numpy as np
from age import furrow, push_clay
from ears import EARS, add_ear, relief
from eyes import EYES, add_lids, eyeball, press_on_ball
from head_cage import BaseShape, head_cage
from mouth import CONTACT, add_lips, add_nostrils, close_lips
from quads import catmull_clark, vertex_normals

from facegen.geometry.mesh import Mesh, merge


def refined(loops, cage, edge_index, n):
    """Return the fine vertices on a closed loop of keys: its vertices and the points of its edges, in order."""
    i = [cage.index[k] for k in loops]
    out = []
    for a, b in zip(i, i[1:] + i[:1], strict=True):
        out += [a, n + edge_index[min(a, b), max(a, b)]]
    return np.array(out)


def skin():
    base = BaseShape()
    cage = head_cage()
    lips = add_lips(cage, base.project)
    nostrils = add_nostrils(cage)
    reliefs = []
    for ear in EARS:
        reliefs.append(add_ear(cage, ear))
    cage.place = list(push_clay(np.array(cage.place)))
    lids = [add_lids(cage, eye) for eye in EYES]
    places, quads, edges = catmull_clark(np.array(cage.place), np.array(cage.quads))
    n = len(cage.place)
    edge_index = {tuple(e): i for i, e in enumerate(edges.tolist())}
    # ears
    source = np.concatenate([cage.quads])
    return cage, lips, lids, reliefs, nostrils, places, quads, edge_index, n


def build():
    cage, lips, lids, reliefs, nostrils, places, quads, edge_index, n = skin()
    is_ear = np.zeros(len(places), bool)
    quads_cage = np.array(cage.quads)
    for ear, (front, every) in zip(EARS, reliefs, strict=True):
        on = np.zeros(n, bool)
        on[[cage.index[k] for k in front]] = True
        fine = on_fine(on, edge_index, quads_cage, n)
        local = ear.local(places[fine])
        local[:, 2] = relief(local[:, 0], local[:, 1])
        places[fine] = ear.place(*local.T)
    for k in CONTACT:
        loop = refined(lips[k], cage, edge_index, n)
        pair(places, loop)
    normals = vertex_normals(places, quads)
    places = places + normals * (furrow(places, normals) * outside(cage, lips, lids, reliefs, edge_index, n, len(places)))[:, None]
    for eye, rings in zip(EYES, lids, strict=True):
        press_on_ball(places, eye, refined(rings[5], cage, edge_index, n), refined(rings[6], cage, edge_index, n))
    q = quads
    tri = np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]])
    meshes = [Mesh.of(places, tri)]
    for eye in EYES:
        v, f, mats = eyeball(eye)
        t, tm = [], []
        names = tuple(dict.fromkeys(mats))
        for face, m in zip(f, mats):
            for i in range(1, len(face) - 1):
                t.append((face[0], face[i], face[i + 1])); tm.append(names.index(m))
        p = "eye_L" if eye.sign > 0 else "eye_R"
        meshes.append(Mesh(v, t, names, tm, (p,), [0] * len(t)))
    return merge(meshes)


def on_fine(on, edge_index, quads, n):
    edges = np.array(list(edge_index))
    return np.concatenate([on, on[edges].all(axis=1), on[quads].all(axis=1)])


def outside(cage, lips, lids, reliefs, edge_index, n, total):
    """1 on plain skin, 0 on lips, lids' edges and ears."""
    w = np.ones(n)
    for rings in [lips[3:]] + [r[3:] for r in lids]:
        for ring in rings:
            w[[cage.index[k] for k in ring]] = 0
    for _, every in reliefs:
        w[[cage.index[k] for k in every]] = 0
    edges = np.array(list(edge_index))
    return np.concatenate([w, w[edges].mean(axis=1), w[np.array(cage.quads)].mean(axis=1)])


def pair(places, loop):
    """Close a contact loop: it starts at the lower right; vertices with equal q pair up."""
    m = len(loop)
    # spokes start at column -6, row 7: corner right is 2 spokes before the start
    right = (m - 4) % m
    left = (right + m // 2) % m
    lower = [(right + k) % m for k in range(1, m // 2)]
    upper = [(right - k) % m for k in range(1, m // 2)]
    close_lips(places, loop[upper], loop[lower])
