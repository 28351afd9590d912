"""A face as if it were somebody's mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from facegen.fileio.avatar import AvatarFile
from facegen.transfer.landmarks import Landmarks


def head_of(face, detail=2, scale=1.0, rotation=None, offset=(0.0, 0.0, 0.0)):
    """A face as a mesh with landmarks, in any axes and units."""
    mesh = face.mesh(detail)
    weights, names, faces, shares = face.landmark_weights(detail), face.landmarks, [], []
    for row in range(len(names)):
        at = slice(*weights.indptr[row:row + 2])
        on = dict(zip(weights.indices[at].tolist(), weights.data[at].tolist(), strict=True))
        on = {vertex: share for vertex, share in on.items() if share > 1e-9}
        faces.append(np.flatnonzero(np.isin(mesh.faces, list(on)).sum(axis=1) == len(on))[0])
        shares.append([on.get(int(corner), 0.0) for corner in mesh.faces[faces[-1]]])
    marks = Landmarks(tuple(names), np.array(faces), mesh.faces[faces].astype(np.int64), np.array(shares))
    turned = scale * mesh.vertices @ (np.eye(3) if rotation is None else np.asarray(rotation)).T + offset
    return AvatarFile(Path("head.obj"), "obj", mesh.with_vertices(turned)), marks
