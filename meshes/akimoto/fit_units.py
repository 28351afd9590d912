"""Fit deformation data to measured motion, for write_deformations.py.

Inputs: the measured head of ``fit_cage.py`` and how its skin moves in named face units at full strength
(``face_units.npz``: ``names``, ``displacement_mm`` (units, vertices, 3)). For each unit: least squares on the
feature vectors, the subdivided surface against the measured motion of the same places.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from fit_cage import Surface, read_target, vertex_normals
from scipy.optimize import lsq_linear

from facegen.face.face import Controls, Face

LID_POINTS = ("lid_upper", "lid_lower", "eye_inner", "eye_outer")


class Survey:
    """Measured motion carried over to the face's own surface."""

    def __init__(self, face: Face, reference: Path) -> None:
        self.face = face
        d = face._data
        target, parts = read_target(reference / "average_head.obj")
        with np.load(reference / "face_units.npz") as file:
            self.names = [str(n) for n in file["names"]]
            measured = file["displacement_mm"].astype(float)
        level = face._level(2)
        self.matrix = level.matrix
        mesh = level.mesh
        keep = mesh.face_parts == 0
        faces = mesh.faces[keep]
        n = self.matrix.shape[0]
        x = mesh.vertices[:n]
        normals = vertex_normals(x, faces)
        # the outer skin, in front of the ears, above the neck's base
        names = (Path(__file__).parent / "cage_names.txt").read_text().split()
        inward = [i for i, s in enumerate(names) if s.startswith(("lid_rim", "lip_inner", "lip_deep", "nostril_in",
                                                                  "ear_rim", "ear_fold", "ear_concha"))]
        hidden = np.asarray(abs(self.matrix[:, inward]).sum(axis=1)).reshape(-1) > 1e-9
        self.rows = np.flatnonzero(~hidden & (x[:, 2] > -56) & (x[:, 1] > -122))
        x, normals = x[self.rows], normals[self.rows]
        # measured share of the jaw's movement tells the lips apart where they touch
        hinge = face.deformer.jaw
        full = hinge.movement(target, np.array([24.4, 0, 0]))
        jaw_open = measured[self.names.index("jawOpen")]
        share = np.linalg.norm(jaw_open, axis=1) / np.maximum(np.linalg.norm(full, axis=1), 3.0)
        skin = parts["skin"]
        tri_share = share[skin].mean(axis=1)
        mouth = (np.abs(target[skin].mean(1)[:, 0]) < 21.5) & (np.abs(target[skin].mean(1)[:, 1] + 67) < 14)
        sheet = np.array([{"mouth_upper": 1, "mouth_lower": 2}.get(s, 0) for s in _sheets(face)])
        upper = np.asarray(abs(self.matrix[:, sheet == 1]).sum(axis=1)).reshape(-1)[self.rows]
        lower = np.asarray(abs(self.matrix[:, sheet == 2]).sum(axis=1)).reshape(-1)[self.rows]
        foot = np.zeros((len(x), 3), int)
        bary = np.zeros((len(x), 3))
        for side in (0, 1, 2):
            mine = (upper > lower) * 1 + (lower > upper) * 2 == side
            ok = np.ones(len(skin), bool)
            if side == 1:
                ok = ~mouth | (tri_share < 0.5)
            if side == 2:
                ok = ~mouth | (tri_share > 0.4)
            sub = skin[ok]
            s = Surface(target, sub)
            q, _, _ = s.closest(x[mine], normals[mine], cosine=0.2)
            _, near = s.tree.query(q, k=16)
            from fit_cage import _closest_on_triangles
            c = _closest_on_triangles(q[:, None], s.a[near], s.b[near], s.c[near])
            best = near[np.arange(len(q)), np.linalg.norm(c - q[:, None], axis=2).argmin(1)]
            foot[mine] = sub[best]
            a, b, c = (target[sub[best, k]] for k in range(3))
            e1, e2, dq = b - a, c - a, q - a
            g = np.einsum
            g11, g12, g22 = g("ij,ij->i", e1, e1), g("ij,ij->i", e1, e2), g("ij,ij->i", e2, e2)
            r1, r2 = g("ij,ij->i", e1, dq), g("ij,ij->i", e2, dq)
            det = np.maximum(g11 * g22 - g12**2, 1e-12)
            v, w = (g22 * r1 - g12 * r2) / det, (g11 * r2 - g12 * r1) / det
            bb = np.clip(np.stack([1 - v - w, v, w], 1), 0, 1)
            bary[mine] = bb / bb.sum(1, keepdims=True)
        self.measured = {u: np.einsum("nk,nki->ni", bary, measured[i][foot]) for i, u in enumerate(self.names)}
        area = np.zeros(n)
        cross = np.cross(mesh.vertices[faces[:, 1]] - mesh.vertices[faces[:, 0]],
                         mesh.vertices[faces[:, 2]] - mesh.vertices[faces[:, 0]])
        np.add.at(area, faces.reshape(-1), np.repeat(np.linalg.norm(cross, axis=1) / 6, 3))
        self.area = area[self.rows]
        self.x = x
        self.linear = (self.matrix @ face.deformer.weights)[self.rows].toarray()      # surface from points
        self.point_names = d.point_names
        roles_fixed = np.abs(self.linear).sum(0) < 1e-9
        self.free = np.array([i for i, s in enumerate(d.point_names) if not roles_fixed[i] and s not in _fixed(face)])
        self.mirror = np.array([d.point_names.index(_other(s)) for s in d.point_names])
        rim = np.zeros(len(d.point_names))
        for i, s in enumerate(d.point_names):
            rim[i] = s.startswith((*LID_POINTS, "lip_upper", "lip_lower", "mouth_corner"))
        self.weight = self.area * (1 + 4 * np.clip(self.linear @ rim, 0, 1))

    def controls(self, vectors=None, jaw=(0, 0, 0), lids=(0, 0, 0, 0), folds=None) -> Controls:
        """Return the deformer's input in mm and degrees."""
        k = len(self.point_names)
        return Controls(np.zeros((k, 3)) if vectors is None else vectors, np.array(jaw, float), np.array(lids, float),
                        np.zeros(4), np.zeros(4), np.zeros(len(self.face.fold_names)) if folds is None else folds)

    def posed(self, controls: Controls):
        """Return the model's displacement at the survey's places."""
        return self.face.pose_controls(controls, detail=2)[self.rows] - self.x

    def explained(self, measured, predicted) -> float:
        """Return the share of the measured motion that the prediction explains, weighted by area."""
        e = (self.area * ((measured - predicted) ** 2).sum(1)).sum()
        return 1 - e / (self.area * (measured**2).sum(1)).sum()

    def best_scale(self, measured, predicted) -> float:
        """Return the factor on the prediction that explains most."""
        a = self.area[:, None]
        return float((a * measured * predicted).sum() / max((a * predicted**2).sum(), 1e-12))

    def fit(self, measured, *, jaw=(0, 0, 0), lids=(0, 0, 0, 0), sealed=True, symmetric=False, only=None, ridge=2e-3,
            lids_closed=False):
        """Return feature vectors (k, 3), mm: the rest of the motion after jaw and lids."""
        rest = measured - self.posed(self.controls(jaw=jaw, lids=lids))
        free = self.free
        if lids_closed:
            free = np.array([i for i in free if not self.point_names[i].startswith(("lid_upper_inner", "lid_upper_mid",
                             "lid_upper_outer", "lid_lower_inner", "lid_lower_mid", "lid_lower_outer"))])
        a = self.linear[:, free] * np.sqrt(self.weight)[:, None]
        b = rest * np.sqrt(self.weight)[:, None]
        rows = [a, np.sqrt(ridge * self.weight.sum() / len(free)) * np.eye(len(free))]
        rhs = [b, np.zeros((len(free), 3))]
        where = {self.point_names[i]: j for j, i in enumerate(free)}
        if sealed:
            for s in ("lip_{}", *(f"lip_{{}}_{p}_{q}" for p in ("inner", "side", "outer") for q in "LR")):
                r = np.zeros((1, len(free)))
                r[0, where[s.format("upper")]], r[0, where[s.format("lower")]] = 1e4, -1e4
                rows.append(r)
                rhs.append(np.zeros((1, 3)))
        v = np.zeros((len(self.point_names), 3))
        v[free] = np.linalg.lstsq(np.vstack(rows), np.vstack(rhs), rcond=None)[0]
        if symmetric:
            v = (v + v[self.mirror] * [-1, 1, 1]) / 2
        return v

    def jaw_shares(self):
        """Return each point's share of the jaw's movement (k,), fitted to the measured opening."""
        jaw = self.face.deformer.jaw
        move = jaw.movement(self.face.deformer.neutral, np.array([24.4, 0, 0]))
        w = self.face.deformer.weights
        a = np.vstack([(self.matrix @ (w.multiply(move[:, [k]])).tocsr())[self.rows].toarray()[:, self.free]
                       * np.sqrt(self.area)[:, None] for k in range(3)])
        b = np.concatenate([self.measured["jawOpen"][:, k] * np.sqrt(self.area) for k in range(3)])
        prior = self.face.deformer.jaw_share[self.free]
        lam = 8.0
        r = lsq_linear(np.vstack([a, lam * np.eye(len(self.free))]), np.concatenate([b, lam * prior]), (0, 1))
        out = np.zeros(len(self.point_names))
        out[self.free] = r.x
        return (out + out[self.mirror]) / 2


def _other(name: str) -> str:
    return name[:-1] + {"L": "R", "R": "L"}[name[-1]] if name.endswith(("_L", "_R")) else name


def _fixed(face: Face):
    import cage_design
    fixed = {n for n, (_, role, *_r) in cage_design.FEATURE_POINTS.items() if role == "fixed"}
    return fixed | {_other(n) for n in fixed} | {"tongue_tip", "tongue_body", "tongue_back"}


def _sheets(face: Face):
    from facegen.facs.yamlfile import read_data
    data = read_data(Path(__file__).parent / "face.yaml")
    sheets = [None] * len(face.deformer.neutral)
    for name, rows in data["sheets"].items():
        for i in rows:
            sheets[i] = name
    return sheets
