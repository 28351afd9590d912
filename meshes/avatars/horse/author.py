"""Author the horse: free triangles on a long head, with rings round eyes, mouth, ears and nostrils.

    python meshes/avatars/horse/author.py [FOLDER]

writes ``horse.obj``, ``horse.mtl`` and ``landmarks.yaml`` beside this script, or into the folder. Millimetres; +x the
horse's left, +y up, +z forward. The head is modelled in clay (model.py) with its face along z, and hung when written.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "kit"))

import model  # noqa: E402
from clay import Clay, curve, rotation  # noqa: E402
from eyes import almond, ellipse, eye_places, eyeball, lid_rings  # noqa: E402
from hair import forelock, mane  # noqa: E402
from muzzle import EDGE, LIP, add_mouth, add_nostril, inner_parts, lips, nostril_loop  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from plan import Plan, neck_loop  # noqa: E402
from saving import both_sides, save_avatar  # noqa: E402
from scipy.interpolate import PchipInterpolator  # noqa: E402
from sheet import Sheet  # noqa: E402

from facegen.geometry.mesh import Mesh, merge  # noqa: E402

MILLIMETRES = 50.0  # in a unit of the model
COLOURS = {
    "coat": (158, 90, 48),
    "coat_dark": (104, 62, 42),
    "blaze": (244, 236, 224),
    "muzzle": (206, 166, 134),
    "muzzle_dark": (128, 92, 80),
    "rim": (58, 38, 34),
    "ear_inside": (206, 170, 140),
    "lips": (140, 98, 88),
    "mouth": (132, 62, 58),
    "nostril": (70, 42, 40),
    "sclera": (206, 190, 170),
    "iris": (104, 62, 34),
    "limbus": (34, 22, 18),
    "pupil": (12, 10, 10),
    "teeth": (238, 228, 200),
    "gums": (202, 122, 116),
    "tongue": (212, 128, 124),
    "mane": (232, 206, 154),
    "mane_dark": (212, 180, 124),
}
LID = 28  # vertices round an eye
NECK = 17  # vertices along half of the neck's edge
DECIMALS = 3
CANDIDATES = 16000

OPENING = almond(LID, 53, 40, 33, point=0.35, inner_drop=6, lean=0.10)
LID_RINGS = {"offsets": (0.38, 0.22, 0.1), "edge": 0.045, "crest": 1.05, "inside": 1.02, "pocket": 1.4}
# The white of the face, seen square to it: half of its outline, (x, z).
BLAZE = ((0.0, 2.2), (0.3, 2.6), (0.55, 3.2), (0.5, 3.9), (0.4, 5.0), (0.36, 7.0), (0.42, 8.6), (0.44, 9.5), (0.38, 9.9),
         (0.2, 10.25), (0.0, 10.35))
# Where the muzzle pales, in steps too small to be seen each: z at these heights where they begin and end, and how many.
HEIGHTS = (-3.0, -1.6, -0.6, 0.4, 1.4)
MUZZLE, STEPS = ((6.5, 6.6, 7.1, 8.0, 8.5), (7.6, 7.7, 8.2, 9.1, 9.6)), 5
COLOURS |= {f"muzzle_{k}": tuple(round(a + (b - a) * k / STEPS) for a, b in zip(COLOURS["coat"], COLOURS["muzzle"],
                                                                             strict=True)) for k in range(1, STEPS)}


def spacing(points: NDArray) -> NDArray:
    """Return the length of edges at points (n, 3): fine round the features, coarse at the back."""
    features = np.array([model.EYE.on_ball(np.zeros((1, 2)))[0], model.NOSTRIL, (1.0, -1.2, 9.4), (0, -1.2, 10.9)])
    reach = np.array([1.1, 0.8, 0.7, 0.7])
    away = np.linalg.norm(points[:, None] - features, axis=2) - reach
    coarse = np.clip(0.19 + 0.17 * np.maximum(away.min(axis=1), 0), 0.19, 0.72)
    x, y, z = points.T
    coarse = np.where((x < 0.9) & (y > 0) & (z > 2) & (z < 9.9), np.minimum(coarse, 0.38), coarse)
    return np.where((z > paling(y, 1) - 0.3) & (z < paling(y, STEPS) + 0.3), np.minimum(coarse, 0.25), coarse)


def on_top(clay: Clay, flat: NDArray) -> NDArray:
    """Return the places on the face's upper side at (n, 2): x and z."""
    start = np.column_stack([flat[:, 0], np.full(len(flat), -0.4), flat[:, 1]])
    return clay.shoot(start, np.array([[0.0, 1.0, 0.0]]), 5.0)


def colours(middles: NDArray) -> list[str]:
    """Return the material at places (n, 3) of the left half."""
    _, y, z = middles.T
    names = np.full(len(middles), "coat", dtype=object)
    for k in range(1, STEPS + 1):
        names[z > paling(y, k)] = f"muzzle_{k}" if k < STEPS else "muzzle"
    names[in_blaze(middles)] = "blaze"
    return list(names)


def in_blaze(points: NDArray) -> NDArray[np.bool_]:
    """Return which points (n, 3) of the left half lie in the white of the face."""
    x, y, z = points.T
    outline = np.array(BLAZE)
    return (x < np.interp(z, outline[:, 1], outline[:, 0], left=0.0, right=0.0)) & (y > -0.3)


def paling(heights: NDArray, k: int) -> NDArray:
    """Return z at heights (n,) where the muzzle's k-th step begins."""
    first, last = (PchipInterpolator(HEIGHTS, edge)(np.clip(heights, HEIGHTS[0], HEIGHTS[-1])) for edge in MUZZLE)
    return first + (last - first) * (k - 1) / (STEPS - 1)


def muzzle_edge(clay: Clay, k: int) -> NDArray:
    """Return a dense line (n, 3) round the left half of the muzzle, from above to below, where its k-th step begins."""
    turn = np.linspace(0.02, np.pi - 0.02, 150)
    ways = np.stack([np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    at = np.tile([0.0, -0.4, 8.8], (len(turn), 1))
    for _ in range(3):
        places = clay.shoot(at, ways, 5.0)
        at[:, 2] = paling(places[:, 1], k)
    return clay.shoot(at, ways, 5.0)


def head(clay: Clay) -> Sheet:
    """Return the skin of the left half."""
    lids = lid_rings(model.EYE, clay, OPENING, **LID_RINGS)
    mouth = lips(clay)
    loops = {"eye": lids[0], "mouth": mouth[0], "ear": model.EAR.loop(clay), "nostril": nostril_loop(clay),
             "neck": neck_loop(clay, *model.NECK_PLANE, NECK)}
    plan = Plan(clay, model.CHART, model.REACH, spacing, loops)
    plan.add_points(on_top(clay, np.array([BLAZE[-1]])))
    plan.add_middle(-90, 270)
    plan.add_edge(on_top(clay, curve(np.array(BLAZE), 300)))
    for k in range(1, STEPS + 1):
        line = muzzle_edge(clay, k)
        plan.add_edge(line[~in_blaze(line)])
    vertices, faces = plan.covered(CANDIDATES)
    sheet = Sheet("skin")
    sheet.row(vertices)
    sheet.triangles(faces, colours(vertices[faces].mean(axis=1)))
    last = plan.rows["eye"]
    for ring, name in zip(lids[1:], ["coat", "coat", "coat_dark", "rim", "rim", "rim", "rim"], strict=True):
        ring = sheet.row(ring)
        sheet.band(last, ring, name)
        last = ring
    add_mouth(sheet, plan.rows["mouth"], mouth)
    model.EAR.add(sheet, plan.rows["ear"], (0.06, 0.15, 0.27, 0.41, 0.56, 0.71, 0.85, 0.95), "coat", "ear_inside")
    add_nostril(sheet, plan.rows["nostril"])
    return sheet


def eyes() -> list[Mesh]:
    """Return the eyeballs: a dark iris over all that is seen, the pupil level."""
    n = LID - 4
    pupil = ellipse(n, 26, 13)
    outlines = [0.5 * pupil, pupil, 0.5 * pupil + 0.5 * ellipse(n, 50, 46), ellipse(n, 50, 46), ellipse(n, 56, 52)]
    materials = ["pupil", "pupil", "iris", "iris", "limbus", "sclera"]
    return [eyeball(name, model.BALL, outlines, materials, mirror=right)
            for name, right in (("eye_L", False), ("eye_R", True))]


def landmarks(clay: Clay) -> dict[str, NDArray]:
    """Return name -> place (3,) on the left half."""
    lids = lid_rings(model.EYE, clay, OPENING, **LID_RINGS)[-4]
    rows = lips(clay)
    border, edge = rows[0], rows[EDGE]
    m = LIP
    on = lambda *place: clay.onto(np.array([place]))[0]  # noqa: E731
    return {
        "brow_inner_L": on(1.12, 1.45, 4.55),
        "brow_mid_L": on(1.5, 1.6, 3.7),
        "brow_outer_L": on(1.75, 1.4, 2.8),
        **eye_places(lids, model.BALL),
        "nose_tip": on(0.0, 0.5, 11.0),
        "nose_bridge": on(0.0, 1.7, 5.2),
        "nose_wing_L": on(1.4, -0.1, 10.3),
        "nose_base": on(0.0, 0.0, 11.3),
        "mouth_corner_L": edge[m],
        "mouth_top": border[0],
        "mouth_inner_top": edge[0],
        "mouth_inner_bottom": edge[-1],
        "mouth_bottom": border[-1],
        "mouth_upper_L": border[m // 2],
        "mouth_lower_L": border[2 * m - m // 2],
        "chin": on(0.0, -2.5, 9.6),
        "jaw_L": on(1.9, -0.3, 1.5),
        "jaw_angle_L": on(1.4, -3.2, 1.6),
        "temple_L": on(1.7, 1.2, 1.9),
        "head_top": on(0.0, 1.6, -1.0),
    }


def hung(mesh: Mesh) -> Mesh:
    """Return the mesh in millimetres, with its head hanging."""
    return replace(mesh, vertices=MILLIMETRES * mesh.vertices @ rotation((1, 0, 0), model.HANGING).T)


def build() -> tuple[Mesh, dict[str, int]]:
    """Return the horse and its landmarks' vertices."""
    clay = model.clay()
    crest = np.array([clay.onto(np.array([p]))[0] for p in model.CREST])
    mesh = merge([head(clay).mesh(mirror=True), *eyes(), *inner_parts(), forelock(clay), mane(clay, crest)])
    return hung(mesh), both_sides(mesh, landmarks(clay))


if __name__ == "__main__":
    horse, marks = build()
    save_avatar(
        Path(sys.argv[1]) if len(sys.argv) > 1 else HERE,
        "horse",
        horse,
        COLOURS,
        marks,
        about="a horse's head. Millimetres, +x its left, +y up, +z forward.",
        decimals=DECIMALS,
    )
    print(len(horse.vertices), "vertices", len(horse.faces), "triangles")
