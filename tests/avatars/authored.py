"""What the tests of every avatar ask of its files."""

import subprocess
import sys
from pathlib import Path

import numpy as np

AVATARS = Path(__file__).parents[2] / "meshes" / "avatars"


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
