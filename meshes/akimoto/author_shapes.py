"""Print the raw data of shapes in ``tables/vocabularies.yaml`` that no action unit describes.

mouthClose: the lips brought together again while the jaw is wide open. mouthLeft: the mouth shifted along the teeth.
mouthShrugUpper: the upper lip pushed up and out, as by the lower one.
"""

from __future__ import annotations

import numpy as np

from facegen.face.face import load_face
from facegen.facs.tables import load_units

LEAST = 0.12        # mm: smaller movements are left out of the table
MEET = 0.40         # where the lips meet, from the upper lip's place in the open mouth (0) to the lower lip's (1)
# How much of the closed lips' way a point goes instead of its own, by the beginning of its name; the first counts.
FOLLOWS = {"lip_upper_surround": 0.5, "lip_upper": 1.0, "philtrum": 0.4, "nose_base": 0.1,
           "lip_lower_surround": 0.45, "lip_lower": 1.0, "chin_fold": 0.3}
UPPER = {"lip_upper_border": 0.86, "lip_upper_surround": 0.5, "lip_upper": 1.0, "philtrum": 0.4, "nose_base": 0.1}
SHIFT, WIDE, HIGH = 8.0, 54.0, 36.0     # mm: of the mouth to the side, and over which that fades
TILT = 0.12                             # the leading corner rises by this share
CURVE = -0.0165                         # 1 / mm: the row of teeth curves back by this times the square of x
SHRUG = np.array([0.0, 1.2, 3.2])       # mm: the middle of the upper lip
LIP = 21.0                              # mm: half the mouth's width, over which the shrug fades

Vectors = dict[str, np.ndarray]


def main() -> None:
    """Print the three."""
    face = load_face()
    for shape, vectors in (("mouthClose", close(face)), ("mouthLeft", left(face)), ("mouthShrugUpper", shrug(face))):
        print(f"{shape}:")
        scale = dict(zip(face.feature_points, face._data.point_scale, strict=True))
        for name, vector in vectors.items():
            if np.abs(vector).max() >= LEAST:
                print(f"            {name}: [{', '.join(f'{c + 0.0:.4g}' for c in np.round(vector / scale[name], 4))}]")


def close(face) -> Vectors:
    """Return what takes back the opening of unit 27 between the lips."""
    opened = face.controls(load_units().basis["27"])
    deformer, names = face.deformer, face._data.point_names
    moved = opened.vectors + deformer.jaw_share[:, None] * deformer.jaw.movement(deformer.points, opened.jaw)
    at, way = dict(zip(names, deformer.points, strict=True)), dict(zip(names, moved, strict=True))
    columns = ["", "_inner_L", "_side_L", "_outer_L"]
    across = [at[f"lip_upper{c}"][0] for c in columns] + [at["mouth_corner_L"][0]]
    # Where the closed lips go, column by column: between the two lips' ways, and with the corner.
    seam = np.array([(1 - MEET) * way[f"lip_upper{c}"] + MEET * way[f"lip_lower{c}"] for c in columns]
                    + [way["mouth_corner_L"]])
    found = {}
    for name in names:
        share = next((share for stem, share in FOLLOWS.items() if name.startswith(stem)), 0.0)
        x = at[name][0]
        goal = np.array([np.interp(abs(x), across, seam[:, axis]) for axis in range(3)]) * [np.sign(x), 1, 1]
        if share:
            found[name] = share * (goal - way[name])
    return found


def left(face) -> Vectors:
    """Return the mouth's shift to the subject's left."""
    found = {}
    middle = face.feature_points["lip_upper"][1]
    for name, (x, y, _) in face.feature_points.items():
        r = np.hypot(x / WIDE, (y - middle) / HIGH)
        if r < 1.0 and not name.startswith(("nose_tip", "tongue")):
            dx = SHIFT * (1 - r * r) ** 2
            found[name] = np.array([dx, TILT * dx * np.clip(x / LIP, -1, 1), CURVE * ((x + dx) ** 2 - x * x)])
    return found


def shrug(face) -> Vectors:
    """Return the upper lip's push."""
    found = {}
    for name, (x, _, _) in face.feature_points.items():
        share = next((share for stem, share in UPPER.items() if name.startswith(stem)), 0.0)
        found[name] = share * max(0.0, 1 - (x / LIP) ** 2) * SHRUG
    return found


if __name__ == "__main__":
    main()
