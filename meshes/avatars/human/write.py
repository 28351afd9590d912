"""Write the old man's parts as OBJ and MTL, and his landmarks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from eyes import EYES
from head_cage import NECK_RIM, key
from numpy.typing import NDArray
from parts import BROWS, Part
from scipy.spatial import cKDTree

from facegen.fileio.textfile import whole_file

SOURCE = "own work of the facegen authors, MIT"
PER_CENTIMETRE = 10.0
YAW, ROLL = 6.0, -2.5        # degrees: he looks a little to his left, his head a little to one side
DECIMALS = 4
COLOURS = {  # sRGB 0..255
    "skin": (214, 164, 140), "lips": (176, 108, 100), "nostril": (134, 82, 68), "mouth": (92, 34, 30),
    "cheeks": (146, 76, 70),
    "pupil": (16, 12, 11), "iris": (104, 124, 138), "limbus": (64, 78, 88), "sclera": (226, 219, 210),
    "teeth": (226, 208, 174), "gums": (172, 96, 92), "tongue": (182, 98, 94), "brows_white": (196, 190, 183),
    "brows_grey": (172, 166, 160), "hair_white": (205, 200, 194)}


def to_file(places: NDArray) -> NDArray:
    """Return places (n, 3) in the file's frame: centimetres, origin in the neck's opening, head turned."""
    neck = np.array([0.0, np.mean([p[1] for p in NECK_RIM]), -88.0])
    y, r = np.radians(YAW), np.radians(ROLL)
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(r), -np.sin(r), 0], [np.sin(r), np.cos(r), 0], [0, 0, 1]])
    return (places - neck) @ (about_y @ about_z).T / PER_CENTIMETRE


def write(parts: list[Part], skin, folder: Path) -> None:
    """Write human.obj, human.mtl and landmarks.yaml."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {"human.obj": obj_text(parts), "human.mtl": mtl_text(),
             "landmarks.yaml": landmarks_text(landmarks(parts, skin))}
    for name, text in texts.items():
        with whole_file(folder / name) as draft:
            draft.write_text(text, encoding="utf-8")


def obj_text(parts: list[Part]) -> str:
    """Return the OBJ: quads stay quads, vertices in the order of the parts."""
    lines = ["# facegen, avatar human: the head of an old man, not symmetric. Centimetres, +y up, +z forward.",
             f"# Source: {SOURCE}; written by author.py.", "mtllib human.mtl"]
    first = 1
    for part in parts:
        lines.append(f"o {part.name}")
        lines += [f"v {x:.{DECIMALS}f} {y:.{DECIMALS}f} {z:.{DECIMALS}f}"
                  for x, y, z in np.round(to_file(part.vertices), DECIMALS) + 0.0]
        material = None
        for face, name in zip(part.faces, part.materials, strict=True):
            if name != material:
                lines.append(f"usemtl {name}")
                material = name
            lines.append("f " + " ".join(str(first + i) for i in face))
        first += len(part.vertices)
    return "\n".join(lines) + "\n"


def mtl_text() -> str:
    """Return the materials with their plain colours."""
    lines = [f"# Source: {SOURCE}."]
    for name, colour in COLOURS.items():
        kd = " ".join(f"{c / 255:.4f}" for c in colour)
        lines += [f"newmtl {name}", f"Kd {kd}", "Ks 0.0400 0.0400 0.0400", "Ns 20"]
    return "\n".join(lines) + "\n"


def landmarks(parts: list[Part], skin) -> dict[str, int]:
    """Return name -> vertex of the file."""
    at = skin.cage.index
    tree = cKDTree(skin.places)
    first = dict(zip((p.name for p in parts), np.cumsum([0] + [len(p.vertices) for p in parts]).tolist(), strict=False))

    def nearest(place) -> int:
        return int(tree.query(np.asarray(place, dtype=np.float64))[1])

    out: dict[str, int] = {}
    for sign, side in ((1, "L"), (-1, "R")):
        brow = skin.places[:, :2]
        for name, k in (("inner", 0), ("mid", 3), ("outer", 5)):
            facing = skin.places[:, 2] > -20
            far = np.where(facing, np.linalg.norm(brow - BROWS[sign][k], axis=1), np.inf)
            out[f"brow_{name}_{side}"] = int(far.argmin())
    for eye in EYES:
        side = "L" if eye.sign > 0 else "R"

        def lid(row: int, column: int, sign: int = eye.sign) -> int:
            return at["eye", sign, 5, row, sign * column]

        out |= {f"eye_inner_{side}": lid(19, 3), f"eye_outer_{side}": lid(19, 9),
                f"eye_upper_{side}": lid(21, 6), f"eye_lower_{side}": lid(17, 6),
                f"eye_upper_inner_{side}": lid(21, 3), f"eye_upper_outer_{side}": lid(21, 9),
                f"eye_lower_inner_{side}": lid(17, 3), f"eye_lower_outer_{side}": lid(17, 9),
                f"eye_center_{side}": first[f"eye_{side}"]}
    grid = {"nose_tip": (14, 0), "nose_bridge": (17, 0), "nose_wing_L": (13, 4), "nose_wing_R": (13, -4),
            "nose_base": (11, 0), "chin": (6, 0), "neck": (2, 0), "head_back": (22, 20)}
    out |= {name: at[key(*rc)] for name, rc in grid.items()}
    lips = {"mouth_corner_L": (5, 9, 6), "mouth_corner_R": (5, 9, -6), "mouth_top": (3, 11, 0),
            "mouth_inner_top": (5, 11, 0), "mouth_inner_bottom": (5, 7, 0), "mouth_bottom": (3, 7, 0),
            "mouth_upper_L": (3, 11, 4), "mouth_upper_R": (3, 11, -4), "mouth_lower_L": (3, 7, 4),
            "mouth_lower_R": (3, 7, -4)}
    out |= {name: at["lips", *where] for name, where in lips.items()}
    for sign, side in ((1, "L"), (-1, "R")):
        out[f"jaw_{side}"] = nearest((sign * 66, -17.5, -52))
        out[f"jaw_angle_{side}"] = nearest((sign * 57, -66, -50))
        out[f"temple_{side}"] = nearest((sign * 57, 25, -12))
    out["head_top"] = nearest((0, 112, -72))
    return out


def landmarks_text(places: dict[str, int]) -> str:
    """Return the landmarks file."""
    lines = ["# Landmarks of the old man: 0-based vertices of human.obj. Left and right are his own.",
             f"source: {SOURCE}; written by author.py", "mesh: human.obj", "landmarks:"]
    return "\n".join(lines + [f"  {name}: {i}" for name, i in places.items()]) + "\n"
