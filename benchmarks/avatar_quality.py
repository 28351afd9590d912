"""How good the shapes of the shipped avatars are, beside two published methods on the same avatars and landmarks.

    python benchmarks/avatar_quality.py > table.md

Prints the table of docs/avatar-quality.md. Places behind the ears, on the forehead, on the left and the right are taken
on the registered skin, so they are the same places on every face.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from facegen.face.face import load_face
from facegen.fileio.avatar import load_avatar
from facegen.render import render_passes
from facegen.transfer.margins import LIDS, LIPS, Slit, facing_margins
from facegen.transfer.rig import avatar_names, rig
from facegen.transfer.skin import METHODS as SKIN_METHODS
from facegen.transfer.skin import Skin

# The paper's is ours with its energy and its weights, on our registration, lids and pieces.
METHODS = {**{method: {"method": method} for method in SKIN_METHODS}, "paper's weights": {"weights": "paper"}}
ONE_SIDED = ("AU12_L", "AU10_L", "AU20_L", "AU2_L", "AU6_L", "AU15_L")
VIEWS = ((0, 0), (25, 0), (-25, 0))
# Millimetres in the template's shape: beside the midline, above the brows, behind the ears.
BESIDE, ABOVE, BEHIND = 12.0, 15.0, -40.0


def gaps(skin: Skin, slit: Slit, moved: NDArray | float) -> NDArray:
    """Return the distances, mm, of facing places of a slit's edges."""
    return np.linalg.norm(facing_margins(skin, slit)[1].gap(skin.surface.vertices + moved), axis=1)


def eye_seen(path: Path) -> float:
    """Return the share of the eyes that cameras see with the lids shut, of what they see at rest."""
    face = load_face(path)
    eyes = [i + 1 for i, name in enumerate(face.mesh().parts) if name.startswith("eye")]

    def pixels(pose: object) -> int:
        pictures = (render_passes(face, pose, passes=["part"], size=256, view=view)["part"] for view in VIEWS)
        return sum(int(np.isin(picture, eyes).sum()) for picture in pictures)

    return pixels("43E") / pixels({})


def measured(name: str, method: str, folder: Path) -> tuple[str, ...]:
    """Return the cells of a row."""
    rigged = rig(name, folder / f"{name}-{method}.glb", sets=["units", "arkit"], **METHODS[method])
    avatar, frame, skin = load_avatar(rigged.path), rigged.found.frame, rigged.found.skin
    rows = cKDTree(frame.apply(avatar.mesh.vertices)).query(skin.surface.vertices)[1]
    shapes = {shape: frame.apply_vectors(moved[rows]) for shape, moved in avatar.shapes.items()}
    length = {shape: np.linalg.norm(moved, axis=1) for shape, moved in shapes.items()}
    lids = [gaps(skin, slit, shapes[shape]).mean() / gaps(skin, slit, 0.0).mean()
            for slit, shape in zip(LIDS, ("eyeBlinkLeft", "eyeBlinkRight"), strict=True)]
    corners = [skin.landmarks[f"mouth_corner_{side}"] for side in "LR"]
    opening = gaps(skin, LIPS, shapes["jawOpen"]).max() / np.linalg.norm(corners[0] - corners[1])
    rest, opened, both = (gaps(skin, LIPS, moved).mean()
                          for moved in (0.0, shapes["jawOpen"], shapes["jawOpen"] + shapes["mouthClose"]))
    closed = round((both - rest) / (opened - rest), 2) + 0.0         # never -0.00
    x, y, z = skin.registered.T
    leaks = [length[shape][x < -BESIDE].mean() / length[shape][x > BESIDE].mean() for shape in ONE_SIDED]
    drift = max(moved[z < BEHIND].mean() for moved in length.values()) / np.ptp(skin.surface.vertices[:, 1])
    forehead = (y > skin.template.landmarks["brow_mid_L"][1] + ABOVE) & (z > 0)
    blink = length["eyeBlinkLeft"]
    return (f"{lids[0]:.2f}, {lids[1]:.2f}", f"{eye_seen(rigged.path):.3f}", f"{opening:.2f}",
            f"{round(closed, 2) + 0.0:.2f}", f"{np.mean(leaks):.2f} ({max(leaks):.2f})", f"{100 * drift:.1f} %",
            f"{blink[forehead].max() / blink.max():.3f}")


def main() -> None:
    """Print the table."""
    print("| avatar | method | lid gap L, R | eye seen | jaw-open gap / mouth width | mouthClose leaves | "
          "other side: mean (worst) | drift behind the ears | forehead in a blink |")
    print("|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name in avatar_names():
            for method in METHODS:
                print("|", " | ".join((name, method, *measured(name, method, Path(folder)))), "|", flush=True)


if __name__ == "__main__":
    main()
