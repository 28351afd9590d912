"""How well lids shut on every shipped avatar when another of them is the template.

    python benchmarks/avatar_pairs.py > table.md

Prints the second table of docs/avatar-quality.md.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from avatar_quality import eye_seen, gaps
from scipy.spatial import cKDTree

from facegen.fileio.avatar import load_avatar
from facegen.transfer.margins import LIDS
from facegen.transfer.rig import avatar_names, rig

BLINKS = ("AU43_L", "AU43_R")


def measured(name: str, template: Path, folder: Path) -> str:
    """Return the cell of an avatar."""
    rigged = rig(name, folder / f"{template.stem}-{name}.glb", template=template, shapes=BLINKS)
    avatar, frame, skin = load_avatar(rigged.path), rigged.found.frame, rigged.found.skin
    rows = cKDTree(frame.apply(avatar.mesh.vertices)).query(skin.surface.vertices)[1]
    left = [gaps(skin, slit, frame.apply_vectors(avatar.shapes[shape][rows])).mean() / gaps(skin, slit, 0.0).mean()
            for slit, shape in zip(LIDS, BLINKS, strict=True)]
    return f"{left[0]:.2f}, {left[1]:.2f}; {eye_seen(rigged.path):.3f}"


def main() -> None:
    """Print the table."""
    names = avatar_names()
    print(f"| template | {' | '.join(names)} |")
    print("|---|" + "---|" * len(names))
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            template = rig(name, Path(folder) / f"{name}.glb", sets=["units"], shapes=BLINKS).path
            print(f"| {name} |", " | ".join(measured(other, template, Path(folder)) for other in names), "|",
                  flush=True)


if __name__ == "__main__":
    main()
