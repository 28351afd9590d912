"""Build the skin cage and fit its Loop surface to a measured head; writes ``cage.obj`` beside this file.

Inputs: ``--reference HEAD.obj``, a head measured in millimetres in this frame (origin midway between the eye
centres) with the objects ``skin``, ``eye_l``, ``eye_r``; ours was the mean of six young-adult phenotypes of the
CC0 MakeHuman data, 4,791 vertices, the right half of which mirrors the left. Only its *shape* is used, as a
target for closest points; the layout of the cage is that of ``cage_design.py``.

The fit alternates closest points on the target and linear least squares on the control points
(S c = closest points, S the level-2 subdivision matrix), with a fairness term that fades.
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path

import cage_design as design
import numpy as np
import yaml
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay, cKDTree

from facegen.fileio.obj import format_obj
from facegen.geometry.mesh import Mesh
from facegen.geometry.subdivision import loop_levels

HERE = Path(__file__).resolve().parent


# -- target -----------------------------------------------------------------------------------------------------
def read_target(path: Path):
    """Return vertices (n, 3) and the triangles of every object of an OBJ file."""
    vertices, faces, part = [], {}, None
    for line in path.read_text().splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            vertices.append([float(w) for w in words[1:4]])
        elif words[0] == "o":
            part = words[1]
            faces[part] = []
        elif words[0] == "f":
            i = [int(w.split("/")[0]) - 1 for w in words[1:]]
            faces[part] += [[i[0], i[k], i[k + 1]] for k in range(1, len(i) - 1)]
    return np.array(vertices), {k: np.array(v) for k, v in faces.items()}


def first_hit(origin, direction, vertices, faces):
    """Return the point where a ray meets the triangles first (nearest to the origin), or None."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    e1, e2 = b - a, c - a
    h = np.cross(direction, e2)
    det = np.einsum("ij,ij->i", e1, h)
    with np.errstate(divide="ignore", invalid="ignore"):
        inv = 1 / det
        s = origin - a
        u = np.einsum("ij,ij->i", s, h) * inv
        q = np.cross(s, e1)
        v = (q @ direction) * inv
        t = np.einsum("ij,ij->i", e2, q) * inv
        ok = (np.abs(det) > 1e-9) & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 0)
    return origin + t[ok].min() * direction if ok.any() else None


class Surface:
    """Closest points on a triangle mesh, with a test on normals."""

    def __init__(self, vertices, faces):
        self.a, self.b, self.c = (vertices[faces[:, k]] for k in range(3))
        n = np.cross(self.b - self.a, self.c - self.a)
        self.normals = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-12)
        self.tree = cKDTree((self.a + self.b + self.c) / 3)

    def closest(self, points, normals=None, k=24, cosine=0.3):
        """Return (closest points, distances); triangles whose normal differs too much do not count."""
        _, near = self.tree.query(points, k=min(k, len(self.a)))
        q = _closest_on_triangles(points[:, None], self.a[near], self.b[near], self.c[near])
        d = np.linalg.norm(q - points[:, None], axis=2)
        if normals is not None:
            d = np.where(np.einsum("ijk,ik->ij", self.normals[near], normals) > cosine, d, d + 1e3)
        best = d.argmin(1)
        rows = np.arange(len(points))
        return q[rows, best], d[rows, best], self.normals[near[rows, best]]


def _closest_on_triangles(p, a, b, c):
    ab, ac, ap = b - a, c - a, p - a
    dot = lambda x, y: np.einsum("...i,...i", x, y)  # noqa: E731
    d1, d2 = dot(ab, ap), dot(ac, ap)
    aa, bb, cc = dot(ab, ab), dot(ac, ac), dot(ab, ac)
    det = np.maximum(aa * bb - cc * cc, 1e-12)
    v = (bb * d1 - cc * d2) / det
    w = (aa * d2 - cc * d1) / det
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    best = a + v[..., None] * ab + w[..., None] * ac
    dist = np.where(inside, dot(p - best, p - best), np.inf)
    for s0, s1 in ((a, b), (b, c), (c, a)):
        e = s1 - s0
        t = np.clip(dot(p - s0, e) / np.maximum(dot(e, e), 1e-12), 0, 1)
        q = s0 + t[..., None] * e
        dq = dot(p - q, p - q)
        take = dq < dist
        best = np.where(take[..., None], q, best)
        dist = np.where(take, dq, dist)
    return best


# -- layout -----------------------------------------------------------------------------------------------------
def stereographic(points):
    """Project directions from the view centre to the plane, the open neck at infinity."""
    d = points - design.VIEW_CENTRE
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    pole = np.array([0.0, -0.93, -0.18])
    pole /= np.linalg.norm(pole)
    u = np.array([1.0, 0, 0])
    v = np.cross(pole, u)
    return np.stack([d @ u, -(d @ v)], 1) / (1.0001 - d @ pole)[:, None]


def inside(point, polygon):
    """Return whether a 2D point lies inside a polygon (n, 2)."""
    x, y = polygon.T
    x2, y2 = np.roll(x, -1), np.roll(y, -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        hits = ((y > point[1]) != (y2 > point[1])) & (point[0] < (x2 - x) * (point[1] - y) / (y2 - y) + x)
    return hits.sum() % 2 == 1


def triangulate(xy, edges):
    """Return Delaunay triangles (m, 3) of the points in which all ``edges`` (pairs) are present."""
    tri = [tuple(t) for t in Delaunay(xy).simplices]

    def cross(o, a, b):
        return (xy[a][0] - xy[o][0]) * (xy[b][1] - xy[o][1]) - (xy[a][1] - xy[o][1]) * (xy[b][0] - xy[o][0])

    tri = [t if cross(*t) > 0 else (t[0], t[2], t[1]) for t in tri]
    for a, b in edges:
        for _ in range(60):
            owners: dict[tuple, list] = {}
            for t in tri:
                for i in range(3):
                    owners.setdefault(tuple(sorted((t[i], t[(i + 1) % 3]))), []).append(t)
            if tuple(sorted((a, b))) in owners:
                break
            flipped = False
            for (c, d), ts in owners.items():
                if len(ts) != 2 or {a, b} & {c, d} or cross(a, b, c) * cross(a, b, d) >= 0 \
                        or cross(c, d, a) * cross(c, d, b) >= 0:
                    continue
                e, g = (next(v for v in t if v not in (c, d)) for t in ts)
                if cross(e, g, c) * cross(e, g, d) >= 0:
                    continue
                for t in ts:
                    tri.remove(t)
                for t in ((e, g, c), (e, g, d)):
                    tri.append(t if cross(*t) > 0 else (t[0], t[2], t[1]))
                flipped = True
                break
            if not flipped:
                raise SystemExit(f"edge {a}-{b} cannot be recovered")
        else:
            raise SystemExit(f"edge {a}-{b}: too many flips")
    return tri


def build(target, target_faces):
    """Return names, positions, triangles (half, +x) and the material of each triangle."""
    skin = target_faces["skin"]
    names, positions = [], []
    for name, (kind, *xyz) in design.points().items():
        if kind == "front":
            hit = first_hit(np.array([xyz[0] + 1e-4, xyz[1], 200.0]), np.array([0, 0, -1.0]), target, skin)
        elif kind == "side":
            hit = first_hit(np.array([200.0, xyz[0], xyz[1]]), np.array([-1.0, 0, 0]), target, skin)
        else:
            hit = np.array(xyz)
        if hit is None:
            raise SystemExit(f"{name}: no surface there")
        names.append(name)
        positions.append(hit * [0 if name.endswith("_M") else 1, 1, 1])
    positions = np.array(positions, float)
    index = {n: i for i, n in enumerate(names)}
    edges = [(index[a], index[b]) for ring in design.rings() for a, b in pairwise(ring)]
    flat = stereographic(positions)
    middle = [i for i, n in enumerate(names) if n.endswith("_M")]
    flat[middle, 0] = -1e-4 * np.arange(len(middle)) * 0
    tri = triangulate(flat, edges)

    def polygon(ring):
        return [index[n] for n in ring]

    holes = [polygon([f"lid_margin_{i}" for i in range(10)]),
             polygon(["nostril_0", "nostril_1", "nostril_2", "nostril_3"]),
             polygon([f"ear_root_{i}" for i in range(8)]),
             polygon(["lip_seam_lower_0_M", *(f"lip_seam_lower_{i}" for i in (1, 2, 3)), "lip_seam_4",
                      *(f"lip_seam_upper_{i}" for i in (3, 2, 1)), "lip_seam_upper_0_M"])]
    base = polygon(["base_M", "base_1", "base_2", "base_3", "base_back_M"])

    kept = []
    for t in tri:
        c = flat[list(t)].mean(0)
        if any(inside(c, flat[h]) for h in holes) or set(t) <= set(base):
            continue
        if sum(i in middle for i in t) == 3:
            continue
        kept.append(t)
    return names, positions, kept, index


def mirror(names, positions, tri, materials):
    """Return the whole head: names with _L and _R, positions, triangles, materials and the mirror of each point."""
    side = [i for i, n in enumerate(names) if not n.endswith("_M")]
    other = {i: len(names) + k for k, i in enumerate(side)}
    full_names = [n[:-2] if n.endswith("_M") else n + "_L" for n in names] + [names[i] + "_R" for i in side]
    full = np.concatenate([positions, positions[side] * [-1, 1, 1]])
    flipped = [tuple(other.get(i, i) for i in (a, c, b)) for a, b, c in tri]
    return full_names, full, np.array(tri + flipped), materials + materials, other


def strips(names, positions, tri, index):
    """Add what turns inward: lid rims, inner lips, nostrils, ears. Returns materials of all triangles."""
    materials = ["skin"] * len(tri)
    lips = {index[n] for n in names if n.startswith(("lip_seam", "lip_belly", "lip_border"))}
    materials = ["lips" if set(t) <= lips else m for t, m in zip(tri, materials, strict=True)]

    def add(name, xyz):
        index[name] = len(names)
        names.append(name)
        positions.append(np.array(xyz, float))
        return index[name]

    def quad(a, b, c, d, material):
        """Two triangles of the quad a b c d, cut along the shorter diagonal."""
        pa, pb, pc, pd = (np.asarray(positions[i]) for i in (a, b, c, d))
        short = np.linalg.norm(pa - pc) <= np.linalg.norm(pb - pd)
        tri.extend([(a, b, c), (a, c, d)] if short else [(a, b, d), (b, c, d)])
        materials.extend([material] * 2)

    eye = design.EYE_CENTRE
    margin = [index[f"lid_margin_{i}"] for i in range(10)]
    middle = np.mean([positions[i] for i in margin], axis=0)
    rim = []
    for i, m in enumerate(margin):
        out = np.asarray(positions[m]) - middle
        out[2] = 0
        d = np.asarray(positions[m]) - eye + 1.6 * out / np.linalg.norm(out)
        rim.append(add(f"lid_rim_{i}", design.LID_RIM.get(i, eye + 13.4 * d / np.linalg.norm(d))))
    for i in range(10):
        j = (i + 1) % 10
        quad(margin[i], margin[j], rim[j], rim[i], "lips" if i in (0, 9) else "lashes" if i in (1, 2, 3) else "skin")

    def lip_ring(name, offsets):
        """The seam's ring moved by the offsets: upper middle .. corner .. lower middle."""
        seam = [*(f"lip_seam_upper_{i}" + "_M" * (i == 0) for i in range(4)), "lip_seam_4",
                *(f"lip_seam_lower_{i}" + "_M" * (i == 0) for i in (3, 2, 1, 0))]
        ring = []
        for n, xyz in zip(seam, offsets, strict=True):
            if xyz is not None:
                ring.append(add(name + n.removeprefix("lip_seam"), np.asarray(positions[index[n]]) + xyz))
        return [index[n] for n in seam], ring

    seam, inner = lip_ring("lip_inner", [(0, 3.0, -4.6), (0, 3.0, -4.6), (-.3, 2.6, -4.6), (-.6, 1.6, -5.0),
                                         (-1.0, 0, -6.0), (-.6, -1.6, -5.0), (-.3, -2.6, -4.6), (0, -3.0, -4.6),
                                         (0, -3.0, -4.6)])
    for i in range(8):
        quad(seam[i], seam[i + 1], inner[i + 1], inner[i], "lips")
    _, deep = lip_ring("lip_deep", [(0, 11, -5.2), None, (2.0, 10, -7.0), None, (7.5, 0, -17.0), None, (2.0, -9, -7.0),
                                    None, (0, -10, -6.2)])
    for k in range(4):
        a, b, c = inner[2 * k: 2 * k + 3]
        tri.extend([(a, b, deep[k]), (b, deep[k + 1], deep[k]), (b, c, deep[k + 1])])
        materials.extend(["mouth"] * 3)

    nostril = [index[f"nostril_{i}"] for i in range(4)]
    apex = add("nostril_in", np.mean([positions[i] for i in nostril], axis=0) + np.array([0, 11.0, -4.0]))
    for i in range(4):
        tri.append((nostril[i], nostril[(i + 1) % 4], apex))
        materials.append("nostril")

    root = [index[f"ear_root_{i}"] for i in range(8)]
    rim = [add(f"ear_rim_{i}", xyz) for i, xyz in enumerate(design.EAR_RIM)]
    fold = [add(f"ear_fold_{i}", xyz) for i, xyz in enumerate(design.EAR_FOLD)]
    concha = add("ear_concha", design.EAR_CONCHA)
    for i in range(8):
        j = (i + 1) % 8
        quad(root[i], root[j], rim[j], rim[i], "skin")
    for i in range(5):
        quad(rim[i], rim[i + 1], fold[i + 1], fold[i], "skin")
        tri.append((fold[i], fold[i + 1], concha))
        materials.append("skin")
    for t in ((rim[5], rim[6], fold[5]), (rim[6], rim[7], fold[5]), (rim[7], rim[0], fold[0]),
              (rim[7], fold[0], concha), (rim[7], concha, fold[5])):
        tri.append(t)
        materials.append("skin")
    return materials


def orient(positions, tri):
    """Return the triangles wound alike, outward; they must be one connected sheet."""
    tri = [tuple(t) for t in tri]
    by_edge: dict[tuple, list] = {}
    for k, t in enumerate(tri):
        for i in range(3):
            by_edge.setdefault(tuple(sorted((t[i], t[(i + 1) % 3]))), []).append(k)
    if any(len(v) > 2 for v in by_edge.values()):
        raise SystemExit("an edge has more than two triangles: "
                         + str([k for k, v in by_edge.items() if len(v) > 2]))
    done, queue = {0}, [0]
    while queue:
        k = queue.pop()
        t = tri[k]
        for i in range(3):
            a, b = t[i], t[(i + 1) % 3]
            for other in by_edge[tuple(sorted((a, b)))]:
                if other in done:
                    continue
                o = tri[other]
                if any((o[j], o[(j + 1) % 3]) == (a, b) for j in range(3)):
                    tri[other] = (o[0], o[2], o[1])
                done.add(other)
                queue.append(other)
    if len(done) != len(tri):
        raise SystemExit("the cage is not connected")
    a, b, c = (np.asarray(positions)[np.array(tri)[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->", a - design.VIEW_CENTRE, np.cross(b - a, c - a))
    return [t if volume > 0 else (t[0], t[2], t[1]) for t in tri]


# -- fit --------------------------------------------------------------------------------------------------------
INSIDE = ("lid_rim", "lip_inner", "lip_deep", "nostril_in")   # turned inward: follow, are not fitted
RINGS = ("lid_crease", "orbit", "lip_border", "lip_belly", "surround", "brow", "nostril", "wing")
EAR = ("ear_rim", "ear_fold", "ear_concha")


def laplacian(n, faces):
    """Return the uniform graph Laplacian (n, n)."""
    i = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1)
    j = faces[:, [1, 0, 2, 1, 0, 2]].reshape(-1)
    a = sparse.csr_array((np.ones(len(i)), (i, j)), shape=(n, n))
    a.data[:] = 1
    return sparse.csr_array(sparse.identity(n) - sparse.diags_array(1 / a.sum(1)) @ a)


def vertex_normals(vertices, faces):
    """Return area-weighted unit normals."""
    n = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    out = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(out, faces[:, k], n)
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)


def outer_mask(full_names, faces, sub):
    """Return for each vertex of a subdivided mesh: its weight in the fit (0 inside, less on ears and neck)."""
    base = np.array([n.rsplit("_", 1)[0] if n[-2:] in ("_L", "_R") else n for n in full_names])
    inside = np.array([b.startswith(INSIDE) for b in base])
    ear = np.array([b.startswith(EAR) for b in base])
    weight = np.where(inside[faces].any(1), 0.0, np.where(ear[faces].any(1), 0.25, 1.0))
    w = np.full(sub.matrix.shape[0], 0.0)
    np.maximum.at(w, sub.faces.reshape(-1), np.repeat(weight[sub.parent_face], 3))
    touched = np.zeros(len(w), bool)
    touched[sub.faces[weight[sub.parent_face] == 0].reshape(-1)] = True
    return np.where(touched, 0.0, w)


def fit(full_names, full, faces, creases, corners, other, n_half, target, parts, landmarks, rounds=40):
    """Return the control points (n_half, 3) whose level-2 surface lies on the target."""
    sub = loop_levels(len(full), faces, creases, 2, corners=corners)[2]
    surface = Surface(target, parts["skin"])
    weight = outer_mask(full_names, faces, sub)
    middle = np.array([i not in other for i in range(n_half)])
    rows, cols, signs = list(range(n_half)), list(range(n_half)), [1.0] * n_half
    for i, j in other.items():
        rows.append(j)
        cols.append(i)
        signs.append(-1.0)
    shape = (len(full), n_half)
    expand = [sparse.csr_array((np.where((np.array(rows) >= n_half) & (axis == 0), -1.0, 1.0), (rows, cols)), shape)
              for axis in range(3)]
    lap = laplacian(len(full), faces)
    c0 = full[:n_half].copy()
    c = c0.copy()
    lap0 = lap @ full
    inside = np.array([n.rsplit("_", 1)[0].startswith(INSIDE) if n[-2:] in ("_L", "_R") else n.startswith(INSIDE)
                       for n in full_names])
    # every outer control point's place on the surface stays near where the layout put it, ring points more so
    placed = np.flatnonzero(weight[: len(full)] > 0)
    ring = np.array([full_names[i].startswith(RINGS) for i in placed])
    pull = np.concatenate([np.full(len(landmarks), 30.0), np.where(ring, 0.7, 0.12)])
    lm_rows = sparse.diags_array(pull) @ sub.matrix[np.array([i for i, _ in landmarks] + placed.tolist())]
    lm_at = pull[:, None] * np.concatenate([np.array([x for _, x in landmarks]), full[placed]])
    for it in range(rounds):
        fair = max(0.012, 0.5 * 0.8 ** it)
        whole = np.column_stack([expand[a] @ c[:, a] for a in range(3)])
        x = sub.matrix @ whole
        normals = vertex_normals(x, sub.faces)
        q, d, tn = surface.closest(x, normals, cosine=0.2)
        w = weight * np.exp(-((d / 12.0) ** 2)) * (d < 25)
        # distance along the target's normal counts fully, sliding little
        stiff = np.where(inside, 0.6, fair)
        blocks = []
        rhs = []
        for a in range(3):
            s = sparse.diags_array(np.sqrt(w * 0.04)) @ sub.matrix @ expand[a]
            reg = sparse.diags_array(np.sqrt(stiff)) @ lap @ expand[a]
            lm = lm_rows @ expand[a]
            blocks.append([s, reg, lm])
            rhs.append([np.sqrt(w * 0.04) * q[:, a], np.sqrt(stiff) * lap0[:, a], lm_at[:, a]])
        plane = sparse.hstack([sparse.diags_array(np.sqrt(w) * tn[:, a]) @ sub.matrix @ expand[a] for a in range(3)])
        big = sparse.vstack([plane] + [
            sparse.hstack([blocks[a][k] if b == a else sparse.csr_array((blocks[a][k].shape[0], n_half))
                           for b in range(3)]) for a in range(3) for k in range(3)])
        right = np.concatenate([np.sqrt(w) * np.einsum("ij,ij->i", tn, q)]
                               + [rhs[a][k] for a in range(3) for k in range(3)])
        pin = sparse.diags_array(np.concatenate([np.where(middle, 1e6, 0), np.zeros(2 * n_half)]) + 1e-6)
        normal_matrix = (big.T @ big + pin).tocsc()
        c = splu(normal_matrix).solve(big.T @ right + 1e-6 * c.T.reshape(-1)).reshape(3, n_half).T
        if it % 10 == 9:
            good = weight >= 1
            print(it + 1, "rms", np.sqrt((d[good & (d < 30)] ** 2).mean()).round(3), "p99",
                  np.percentile(d[good & (d < 30)], 99).round(2))
    return c


def report(c_full, faces, creases, corners, target, parts):
    """Print the distance from the measured face (outer skin in front of the ears) to the level-2 surface."""
    sub = loop_levels(len(c_full), faces, creases, 2, corners=corners)[2]
    x = sub.matrix @ c_full
    fitted = Surface(x, sub.faces)
    skin = np.unique(parts["skin"])
    normals = vertex_normals(target, parts["skin"])
    blockers = np.concatenate([parts[k] for k in ("skin", "eye_l", "eye_r")])
    seen = []
    for v in skin:      # outermost as seen from the middle of the head: no inside of mouth, nostrils, eye sockets
        ray = target[v] - design.VIEW_CENTRE
        ray /= np.linalg.norm(ray)
        seen.append(target[v, 2] > -52 and target[v, 1] > -112 and abs(target[v, 0]) < 72
                    and first_hit(target[v] + 0.05 * ray, ray, target, blockers) is None)
    v = skin[np.array(seen)]
    _, d, _ = fitted.closest(target[v], normals[v], cosine=0.0)
    d = d[d < 100]
    print("measured face to surface:", len(d), "points, rms", np.sqrt((d**2).mean()).round(3),
          "p99", np.percentile(d, 99).round(2), "max", d.max().round(2))
    return v, d


def write(names, vertices, faces, materials, creases, corners) -> None:
    """Write ``cage.obj`` and ``face.yaml``."""
    at = {n: i for i, n in enumerate(names)}
    kinds = tuple(dict.fromkeys(materials))
    order = np.argsort([kinds.index(m) for m in materials], kind="stable")
    mesh = Mesh(vertices, faces[order], kinds, np.array([kinds.index(m) for m in materials])[order], ("skin",),
                np.zeros(len(faces), int))
    (HERE / "cage.obj").write_text(format_obj(mesh, comment=(
        "The skin cage of facegen's base face: own work of the facegen authors, MIT licence.\n"
        "Layout: cage_design.py; positions: fitted by fit_cage.py; millimetres.")))
    side = lambda n, s: f"{n[:-2]}" if n.endswith("_M") else f"{n}_{s}"  # noqa: E731

    points, place = {}, {}
    for name, (where, role, scale, jaw, paper) in design.FEATURE_POINTS.items():
        for s in "LR":
            full_name = name[:-1] + s if name.endswith("_L") else name
            number = {"F6": "F7", "F8": "F9", "F10": "F11", "F12": "F13", "F14": "F15"}.get(paper, paper) \
                if s == "R" else paper
            points[full_name] = {"vertex": at[side(where, s)], "role": role, "scale": scale,
                                 **({"jaw": jaw} if jaw else {}), **({"paper": number} if number else {})}
            place[full_name] = vertices[at[side(where, s)]]
    points["tongue_tip"] = {"at": [0.0, -69.9, 10.6], "part": "tongue", "role": "input", "scale": "mouth"}
    points["tongue_body"] = {"at": [0.0, -63.5, -14.0], "part": "tongue", "role": "input", "scale": "mouth", "reach": 34}
    points["tongue_back"] = {"at": [0.0, -62.1, -38.0], "part": "tongue", "role": "input", "scale": "mouth", "reach": 34}
    points = dict(sorted(points.items(), key=lambda kv: (kv[0][-2:] in ("_L", "_R"), kv[0][-2:] == "_R")))

    left = [n for n in points if not n.endswith("_R") and n in place]
    xyz = np.array([place[n] for n in left])
    nudge = {"lip_upper": 0.6, "lip_lower": -0.6}
    for i, n in enumerate(left):      # the lips touch: part them for the layout only
        if n in nudge or n.startswith(("lip_upper_inner", "lip_upper_side", "lip_upper_outer")):
            xyz[i, 1] += 0.6
        if n == "lip_lower" or n.startswith(("lip_lower_inner", "lip_lower_side", "lip_lower_outer")):
            xyz[i, 1] -= 0.6
    flat = stereographic(xyz)
    where = {n: i for i, n in enumerate(left)}
    rings = design.point_rings()
    edges = [(where[a], where[b]) for ring in rings for a, b in pairwise(ring)]
    tri = triangulate(flat, edges)
    holes = [[where[n] for n in rings[0][:-1]], [where[n] for n in rings[1] + rings[2][-2::-1]]]

    regions = []
    for t in tri:
        corners_of = [left[i] for i in t]
        area = np.linalg.det(np.column_stack([flat[list(t)], np.ones(3)]))
        if any(inside(flat[list(t)].mean(0), flat[h]) for h in holes) or abs(area) < 1e-7:
            continue
        sheet = next((f"mouth_{p}" for p in ("upper", "lower") if any(n.startswith(f"lip_{p}") for n in corners_of)),
                     None)
        for s in "LR":
            if s == "R" and not any(n.endswith("_L") for n in corners_of):
                continue
            names_of = [n[:-1] + s if n.endswith("_L") else n for n in corners_of]
            regions.append({"points": names_of if s == "L" else names_of[::-1], **({"sheet": sheet} if sheet else {})})

    sheets = {f"mouth_{p}": [i for i, n in enumerate(names) if n.startswith(
        (f"lip_seam_{p}", f"lip_belly_{p}", f"lip_border_{p}", f"lip_inner_{p}"))] for p in ("upper", "lower")}
    follow = {}
    for n, sources in design.followers().items():
        for s in "LR":
            follow[at[side(n, s)]] = {at[side(m, s)]: share for m, share in sources.items()}
    lids = {}
    for s in "LR":
        column = {1: 0, 2: 1, 3: 2, 4: 3, 9: 0, 8: 1, 7: 2, 6: 3}
        movers = []
        for i, col in column.items():
            lower = i > 5
            share = (design.CREASE_SHARE_LOWER if lower else design.CREASE_SHARE_UPPER)[col]
            for ring, part in (("lid_margin", 1.0), ("lid_rim", 1.0), ("lid_crease", share)):
                movers.append([at[f"{ring}_{i}_{s}"], col, "lower" if lower else "upper", part])
        lids[s] = {"columns": [[at[f"lid_margin_{a}_{s}"], at[f"lid_margin_{b}_{s}"]]
                               for a, b in ((1, 9), (2, 8), (3, 7), (4, 6))],
                   "movers": movers, "rims": [at[f"lid_rim_{i}_{s}"] for i in range(10)],
                   "skin": [at[f"lid_crease_{i}_{s}"] for i in range(10)]}
    eye = design.EYE_CENTRE.tolist()
    sub = loop_levels(len(vertices), faces, creases, 2, corners=corners)[2]
    surface = sub.matrix @ vertices
    for fold in design.FOLDS.values():
        fold["along"] = [first_hit(np.array([x, y, 200.0]), np.array([0, 0, -1.0]), surface, sub.faces).round(2).tolist()
                         for x, y, _ in fold["along"]]
    data = {
        "name": "akimoto", "source": "own work of the facegen authors, MIT; written by meshes/akimoto/fit_cage.py",
        "cage": "cage.obj", "centre_O": list(design.CENTRE_O), "measures": design.MEASURES,
        "scales": {k: list(v) for k, v in design.SCALES.items()}, "points": points, "regions": regions,
        "sheets": sheets, "followers": follow, "creases": creases.tolist(), "corners": corners.tolist(),
        "jaw": {"rule": "vertices", "hinge": list(design.JAW_HINGE), "glide": list(design.JAW_GLIDE)},
        "eyes": {"L": eye, "R": [-eye[0], *eye[1:]]}, "lids": lids, "lid_follow": design.LID_FOLLOW,
        "head": design.HEAD, "head_half_height": design.HEAD_HALF_HEIGHT, "parts": design.PARTS,
        "folds": {(n[:-1] + s if n.endswith("_L") else n): (v if s == "L" else design.mirrored_fold(v))
                  for n, v in design.FOLDS.items() for s in ("LR" if n.endswith("_L") else "L")},
    }
    (HERE / "cage_names.txt").write_text("\n".join(names) + "\n")
    about = ["# The base face: feature points, regions and rotations. Millimetres, +x subject's left, +y up, +z forward.",
             "# Vertices are 0-based indices into cage.obj. Written by fit_cage.py; see docs/faces.md for the keys."]
    write_yaml(HERE / "face.yaml", about, data)

    # The paper's own mode: fifteen points, nineteen regions, the jaw rule of section 3.1.
    paper = {n: {**p, "role": design.PAPER_ROLES[p["paper"]], "jaw": float(p["paper"] in ("F4", "F14", "F15"))}
             for n, p in points.items() if "paper" in p}
    folder = HERE.parent / "akimoto-1986"
    folder.mkdir(exist_ok=True)
    parts = [{**p, "file": f"../akimoto/{p['file']}"} for p in data["parts"]]
    about = ["# Akimoto, Mase and Suenaga 1986, section 3.1: 15 feature points, 19 regions, on the cage of `akimoto`.",
             "# Their figure 3 is not in the text: the layout is our reconstruction from what the text says.",
             "# Eyes, lids and head, which the paper only sketches, are those of `akimoto`. Written by fit_cage.py."]
    write_yaml(folder / "face.yaml", about, {
        **data, "name": "akimoto-1986", "cage": "../akimoto/cage.obj",
        "landmarks": "../akimoto/landmarks.yaml", "points": paper,
        "regions": design.paper_regions(), "jaw": {"rule": "points", "hinge": [0.0, *vertices[at["ear_root_7_L"], 1:].tolist()], "glide": [0, 0, 0]},
        "parts": parts, "folds": {}})
    print(len(points), "feature points", len(regions), "regions")


def write_yaml(path: Path, about: list[str], data: dict) -> None:
    """Write a face's data, one thing a line."""
    lines = list(about)
    dump = lambda v: yaml.safe_dump(v, default_flow_style=True, width=10**6, sort_keys=False).strip()  # noqa: E731
    for key, value in data.items():
        if key in ("points", "measures", "scales", "jaw", "eyes", "head", "folds", "lid_follow") and value:
            lines += [f"{key}:"] + [f"  {k}: {dump(v).removesuffix('...').strip()}" for k, v in value.items()]
        elif key in ("regions", "parts"):
            lines += [f"{key}:"] + [f"- {dump(r)}" for r in value]
        elif key == "lids":
            lines += ["lids:"] + [line for s, v in value.items() for line in (
                f"  {s}:", *(f"    {k}: {dump(x)}" for k, x in v.items()))]
        else:
            lines.append(f"{key}: {dump(value).removesuffix('...').strip()}")
    path.write_text("\n".join(lines) + "\n")


def main() -> None:
    """Build, fit, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reference", type=Path, required=True)
    args = parser.parse_args()
    target, parts = read_target(args.reference)
    names, positions, tri, index = build(target, parts)
    positions = list(positions)
    materials = strips(names, positions, tri, index)
    positions = np.array(positions)
    tri = orient(positions, tri)
    full_names, full, faces, full_materials, other = mirror(names, positions, tri, materials)
    print(len(full_names), "points", len(faces), "triangles")
    at = {n: i for i, n in enumerate(full_names)}
    loops = []
    for s in "LR":
        loops.append([f"lid_margin_{i % 10}_{s}" for i in range(11)])
        for part in ("upper", "lower"):
            loops.append([f"lip_seam_{part}_0", *(f"lip_seam_{part}_{i}_{s}" for i in (1, 2, 3)), f"lip_seam_4_{s}"])
    creases = np.array([(at[a], at[b]) for loop in loops for a, b in pairwise(loop)])
    corners = np.array([at[f"{n}_{s}"] for s in "LR" for n in ("lid_margin_0", "lid_margin_5", "lip_seam_4")])
    landmarks = []
    for i, (x, y, z) in enumerate(design.LID_MARGIN):
        landmarks += [(at[f"lid_margin_{i}_L"], (x, y, z)), (at[f"lid_margin_{i}_R"], (-x, y, z))]
    for i in range(5):
        for part in ("upper", "lower"):
            name = f"lip_seam_{part}_{i}" if i < 4 else "lip_seam_4"
            xyz = np.array([design.LIP_X[i], design.LIP_SEAM_Y[i], design.LIP_SEAM_Z[i]])
            for s, sign in (("", 1),) if i == 0 else (("_L", 1), ("_R", -1)):
                landmarks.append((at[name + s], xyz * [sign, 1, 1]))
    landmarks += [(at[n], np.array(x)) for n, x in design.PINNED.items()]
    c = fit(full_names, full, faces, creases, corners, other, len(names), target, parts, landmarks)
    for i in range(4):      # the lips meet exactly
        a, b = (names.index(f"lip_seam_{part}_{i}" + "_M" * (i == 0)) for part in ("upper", "lower"))
        c[a] = c[b] = (c[a] + c[b]) / 2
    c = np.round(c, 3)
    side = list(other)
    c[[i for i in range(len(names)) if i not in other], 0] = 0.0
    full = np.concatenate([c, c[side] * [-1, 1, 1]])
    report(full, faces, creases, corners, target, parts)
    write(full_names, full, faces, full_materials, creases, corners)


if __name__ == "__main__":
    main()
