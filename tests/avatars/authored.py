"""What the tests of every avatar ask of its files."""

import subprocess
import sys
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np

from facegen.face.landmarks import REQUIRED
from facegen.transfer.landmarks import check_places, load_landmarks

AVATARS = Path(__file__).parents[2] / "meshes" / "avatars"


def marked_places(name, mesh, *, also=()):
    """Return an avatar's landmarks, name -> place (3,); assert that all required ones and these are set, none
    suspicious."""
    marks = load_landmarks(AVATARS / name / "landmarks.yaml", mesh, mesh_name=f"{name}.obj")
    assert set(REQUIRED) | set(also) <= set(marks.names)
    assert check_places(marks, mesh) == []
    return marks.points(mesh.vertices)


def check_mirrored(points, *, atol):
    """Assert that the required landmarks of the two sides mirror each other."""
    for name in REQUIRED:
        if name.endswith("_L"):
            np.testing.assert_allclose(points[name] * (-1, 1, 1), points[f"{name[:-1]}R"], atol=atol, err_msg=name)


def part(mesh, name):
    """Return the triangles of a part."""
    return mesh.faces[mesh.face_parts == mesh.parts.index(name)]


def check_script(name, folder, *, last_decimal):
    """Assert that an avatar's script writes what ships; another machine's arithmetic may round the last decimal
    otherwise."""
    here = AVATARS / name
    subprocess.run([sys.executable, here / "author.py", folder], check=True)
    assert (folder / f"{name}.mtl").read_text() == (here / f"{name}.mtl").read_text()
    new, old = ((at / f"{name}.obj").read_text().splitlines() for at in (folder, here))
    assert [line for line in new if line[:2] != "v "] == [line for line in old if line[:2] != "v "]
    places = [np.loadtxt([line[2:] for line in lines if line[:2] == "v "]) for lines in (new, old)]
    np.testing.assert_allclose(*places, atol=last_decimal)


def edges(faces):
    """Return directed edge -> how many triangles run along it."""
    return Counter((int(a), int(b)) for face in faces for a, b in pairwise((*face, face[0])))


def crossings(vertices, ours, theirs):
    """Return pairs (edge of ours, triangle of theirs) that cut through each other and share no vertex."""
    sides = np.array(list({tuple(sorted(edge)) for edge in edges(ours)}))
    corners = vertices[theirs]
    low, high = corners.min(axis=1), corners.max(axis=1)
    found = []
    for a, b in sides:
        p, q = vertices[a], vertices[b]
        near = ((low <= np.maximum(p, q)) & (high >= np.minimum(p, q))).all(axis=1)
        near &= ~np.isin(theirs, (a, b)).any(axis=1)
        t = corners[near]
        normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        above, below = (((end - t[:, 0]) * normal).sum(axis=1) for end in (p, q))
        with np.errstate(divide="ignore", invalid="ignore"):
            at = p + (above / (above - below))[:, None] * (q - p)
        around = [(np.cross(t[:, (i + 1) % 3] - t[:, i], at - t[:, i]) * normal).sum(axis=1) > 0 for i in range(3)]
        cut = (above * below < 0) & np.all(around, axis=0)
        found += [((int(a), int(b)), tuple(face)) for face in theirs[near][cut].tolist()]
    return found
