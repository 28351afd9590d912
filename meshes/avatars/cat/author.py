"""Author the cat: a mesh of free triangles with rings round eyes, mouth, ears and nostrils.

    python meshes/avatars/cat/author.py [FOLDER]

writes ``cat.obj``, ``cat.mtl`` and ``landmarks.yaml`` beside this script, or into the folder. Centimetres; +x the cat's
left, +y up, +z forward. The head is modelled in clay (model.py); everything here is about its surface: what runs along
a loop or a line, how dense the triangles are, which colour they have.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "kit"))

import model  # noqa: E402
from chart import Round  # noqa: E402
from clay import Clay, curve  # noqa: E402
from cover import in_polygon  # noqa: E402
from eyes import almond, ellipse, eye_places, eyeball, lid_rings  # noqa: E402
from mouth import arch, gum_and_teeth, lip_rows, slit_at, tongue  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from plan import Plan, neck_loop  # noqa: E402
from saving import both_sides, save_avatar  # noqa: E402
from scipy.spatial import cKDTree  # noqa: E402
from sheet import Sheet, mirror_image  # noqa: E402

from facegen.geometry.mesh import Mesh, merge  # noqa: E402

COLOURS = {
    "fur": (214, 148, 88),
    "fur_light": (242, 234, 222),
    "fur_soft": (230, 194, 158),
    "fur_pale": (228, 174, 120),
    "fur_dark": (172, 104, 56),
    "rim": (66, 44, 38),
    "nose": (214, 132, 126),
    "inner_pink": (226, 178, 164),
    "lips": (112, 72, 66),
    "mouth": (120, 52, 50),
    "nostril": (92, 50, 46),
    "sclera": (222, 214, 190),
    "iris": (146, 176, 84),
    "iris_edge": (104, 132, 58),
    "limbus": (44, 48, 28),
    "pupil": (12, 12, 12),
    "teeth": (246, 240, 224),
    "gums": (196, 110, 108),
    "tongue": (214, 122, 120),
    "whiskers": (248, 246, 240),
}
LID = 28  # vertices round an eye
NECK = 15  # vertices along half of the neck's edge
LIP = 14  # quads along half a lip
GAP = 0.012  # between the lips
DECIMALS = 4
REACH = 9.0  # farther than any place from the head's middle
CANDIDATES = 24000

OPENING = almond(LID, 60, 39, 35, point=0.4, inner_drop=9, lean=0.10)
LID_RINGS = {"offsets": (0.4, 0.2, 0.09), "edge": 0.07, "crest": 1.05, "inside": 1.02, "pocket": 1.4}
LIP_OFFSETS = (0.5, 0.3, 0.15, 0.06)
# The lining's rows: how deep they lie, how much narrower than the lips, how far above and below their seam.
LINING = (
    (0.1, 1.0, 0.008, 0.008),
    (0.2, 0.98, 0.08, 0.1),
    (0.26, 0.96, 0.32, 0.3),
    (0.5, 0.91, 0.55, 0.52),
    (1.1, 0.85, 0.62, 0.66),
    (2.1, 0.8, 0.66, 0.66),
    (3.0, 0.7, 0.5, 0.6),
)
# Colours by their outlines seen from the front, left half: the least z, and points (x, y) that a smooth curve joins.
NOSE = (4.0, ((-0.1, -0.48), (0.42, -0.52), (0.66, -0.7), (0.56, -0.98), (0.3, -1.1), (0.1, -1.32), (-0.1, -1.36)))
STRIPES = (
    (-1.0, ((-0.1, 2.3), (0.2, 2.3), (0.27, 3.1), (0.2, 4.0), (-0.1, 4.1))),
    (-1.0, ((0.68, 2.3), (1.12, 2.2), (1.4, 3.1), (1.36, 3.8), (0.95, 3.9), (0.85, 3.1))),
)
# The white of blaze, muzzle, cheeks and throat: its edge keeps clear of the mouth's corner, which a smile moves.
WHITE = (
    -3.0,
    (
        (-0.1, 1.3),
        (0.09, 1.15),
        (0.2, 0.5),
        (0.34, 0.0),
        (0.62, -0.45),
        (1.1, -0.78),
        (1.75, -0.98),
        (2.45, -1.2),
        (2.92, -1.7),
        (2.92, -2.4),
        (2.5, -3.05),
        (2.1, -3.7),
        (1.95, -5.0),
        (1.9, -9.0),
        (-0.1, -9.0),
    ),
)
SOFT = 0.26  # width of the band between the white and the fur


def smooth(points: tuple) -> NDArray:
    """Return a smooth line (k, 2) through points, from the middle to the middle."""
    return curve(points, 40 * len(points))


def grown(line: NDArray, by: float) -> NDArray:
    """Return a line (k, 2) moved to its left by a distance."""
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return line + by * np.stack([-along[:, 1], along[:, 0]], axis=1)


WHITE_EDGE = smooth(WHITE[1])
# What lies before what: name, least z, outline (k, 2).
PATCHES = (
    ("nose", NOSE[0], np.array(NOSE[1])),
    *(("fur_dark", least, smooth((*points, points[0]))) for least, points in STRIPES),
    ("fur_light", WHITE[0], WHITE_EDGE),
    ("fur_soft", WHITE[0], grown(WHITE_EDGE, SOFT)),
)


def spacing(points: NDArray) -> NDArray:
    """Return the length of edges at points (n, 3): fine round the features, coarse at the back."""
    features = np.array(
        [np.add(model.EYE.centre, [0, 0, 0.8]), model.NOSE_TIP, (1.2, -2.2, 4.2), (0, -2.2, 4.8), (0.5, -1.0, 4.6)]
    )
    reach = np.array([1.5, 0.5, 0.6, 0.5, 0.3])
    away = np.linalg.norm(points[:, None] - features, axis=2) - reach
    size = np.clip(0.24 + 0.16 * np.maximum(away.min(axis=1), 0), 0.24, 0.85)
    beside_white = cKDTree(grown(WHITE_EDGE, SOFT / 2)).query(points[:, :2])[0]
    return np.where(points[:, 2] > WHITE[0], np.minimum(size, 0.28 + 0.5 * beside_white), size)


def nostril_loop(clay: Clay, size: float) -> NDArray:
    t = 2 * np.pi * np.arange(8) / 8
    x, y, z = model.NOSTRIL
    return clay.onto(
        np.stack(
            [x + 0.17 * size * np.cos(t), y + 0.10 * size * np.sin(t) + 0.05 * size * np.cos(t), np.full(8, z)], axis=1
        )
    )


def head(clay: Clay) -> Sheet:
    """Return the skin of the left half."""
    lids = lid_rings(model.EYE, clay, OPENING, **LID_RINGS)
    lips = mouth_rows(clay)
    loops = {
        "eye": lids[0],
        "mouth": lips[0],
        "ear": model.EAR.loop(clay),
        "nostril": nostril_loop(clay, 1.0),
        "neck": neck_loop(clay, *model.NECK_PLANE, NECK),
    }
    plan = Plan(clay, Round(model.CENTRE), REACH, spacing, loops)
    plan.add_middle(-85, 230)
    for _, least, outline in PATCHES:
        plan.add_edge(patch_edge(clay, outline, least))
    vertices, faces = plan.covered(CANDIDATES)
    rows = plan.rows
    sheet = Sheet("skin")
    sheet.row(vertices)
    sheet.triangles(faces, colours(vertices[faces].mean(axis=1)))
    add_lids(sheet, rows["eye"], lids)
    add_mouth(sheet, rows["mouth"], lips)
    model.EAR.add(sheet, rows["ear"], (0.1, 0.24, 0.4, 0.57, 0.74, 0.88), "fur", "inner_pink")
    rings = [nostril_loop(clay, 0.82) - [0, 0, 0.12], nostril_loop(clay, 0.6) - [-0.03, 0, 0.35]]
    last = rows["nostril"]
    for ring in rings:
        ring = sheet.row(ring)
        sheet.band(last, ring, "nostril")
        last = ring
    sheet.cap(last, "nostril")
    return sheet


def patch_edge(clay: Clay, outline: NDArray, least: float) -> NDArray:
    """Return a dense line on the clay along the edge of a colour."""
    corners = np.concatenate([outline, outline[:1]])
    flat = np.concatenate([a + np.linspace(0, 1, 12, endpoint=False)[:, None] * (b - a) for a, b in pairwise(corners)])
    flat = flat[(flat[:, 0] > 0.02) & (clay(np.column_stack([flat, np.full(len(flat), least)])) < -0.1)]
    return clay.shoot(np.column_stack([flat, np.full(len(flat), least)]), np.array([[0.0, 0.0, 1.0]]), 8.0)


def colours(middles: NDArray) -> list[str]:
    """Return the material at places (n, 3) of the left half."""
    names = np.full(len(middles), "fur", dtype=object)
    for name, least, outline in PATCHES[::-1]:
        names[in_polygon(outline, middles[:, :2]) & (middles[:, 2] > least)] = name
    return list(names)


def add_lids(sheet: Sheet, loop: NDArray, rings: list[NDArray]) -> None:
    rows = [loop, *(sheet.row(r) for r in rings[1:])]
    for a, b, name in zip(rows[:-1], rows[1:], ["fur", "fur_pale", "fur_pale", "rim", "rim", "rim", "rim"], strict=True):
        sheet.band(a, b, name)


def mouth_rows(clay: Clay) -> list[NDArray]:
    """Return the rows of the left half of the lips, the outermost first."""
    return lip_rows(slit_at(clay, model.MOUTH_LINE, LIP + 1, model.MOUTH_INSIDE), clay, LIP_OFFSETS, gap=GAP)


def add_mouth(sheet: Sheet, loop: NDArray, rows: list[NDArray]) -> None:
    """Add the lips and the lining: the lips' inner sides touch, then it falls away behind them to hold teeth and
    tongue, and ends at the throat."""
    numbers = [loop, *(sheet.row(r) for r in rows[1:])]
    for outer, inner in pairwise(numbers):
        sheet.band(outer, inner, "lips" if inner is numbers[-1] else "fur_light", closed=False)
    last = numbers[-1]
    for number, row in enumerate(lining_rows(rows[-1])):
        row = sheet.row(row)
        sheet.band(last, row, "lips" if number == 0 else "mouth", closed=False)
        last = row
    back = sheet.row([0.0, *(sheet.at(last)[[0, -1], 1:].mean(axis=0) - [0, 0.4])])[0]
    sheet.triangles([(a, b, back) for a, b in pairwise(last)], "mouth")


def lining_rows(edge: NDArray) -> list[NDArray]:
    """Return the rows of the lining behind the lips' edge (2 LIP + 1, 3)."""
    slit = (edge[: LIP + 1] + edge[LIP:][::-1]) / 2
    share = np.arange(LIP + 1) / LIP
    bow = np.sqrt(1 - share**2)[:, None]
    dip = bow**3  # the jaw's side is near below the corner
    up = np.array([0.0, 1.0, 0.0])
    inward = np.array([0.0, -1.9, 0.5]) - slit
    inward = inward / np.linalg.norm(inward, axis=1, keepdims=True)
    rows = []
    for depth, shrink, high, low in LINING:
        base = slit + depth * np.minimum(1.0, 1.6 - share)[:, None] * inward
        base[:, 0] *= shrink
        row = np.concatenate([(base + high * bow * up)[:LIP], base[LIP:], (base - low * dip * up)[:LIP][::-1]])
        row[[0, -1], 0] = 0.0
        rows.append(row)
    return rows


def whiskers(clay: Clay) -> Sheet:
    sheet = Sheet("whiskers")
    for row in range(3):
        for place in range(2):
            root = clay.onto(np.array([[0.98 + 0.28 * place, -1.42 - 0.26 * row - 0.03 * place, 4.6 - 0.25 * place]]))[
                0
            ]
            away = np.array([1.0, 0.16 - 0.2 * row, 0.12 - 0.22 * place])
            t = np.linspace(0, 1, 7)[:, None]
            spine = root + 4.3 * (1 - 0.12 * row) * (t * away + t**2 * np.array([-0.06, -0.12, -0.2]))
            ring = 2 * np.pi * np.arange(3) / 3
            rings = [
                p + r * np.stack([0 * ring, np.cos(ring), np.sin(ring)], axis=1)
                for p, r in zip(spine, np.linspace(0.03, 0.012, 7), strict=True)
            ]
            rows = sheet.tube(rings, "whiskers")
            sheet.cap(rows[0], "whiskers")
            sheet.cap(rows[-1], "whiskers")
    return sheet


def inner_parts() -> list[Mesh]:
    """Return eyeballs, teeth and tongue."""
    n = LID - 4
    pupil = ellipse(n, 8.5, 31)
    outlines = [0.5 * pupil, pupil, 0.5 * pupil + 0.5 * ellipse(n, 40, 44), ellipse(n, 52, 52), ellipse(n, 58, 58)]
    materials = ["pupil", "pupil", "iris", "iris_edge", "limbus", "sclera"]
    eyes = [
        eyeball(name, model.BALL, outlines, materials, mirror=right)
        for name, right in (("eye_L", False), ("eye_R", True))
    ]
    fang, small = (0.25, 0.25, 0.6), (0.15, 0.13, 0.16)
    upper = [
        (0.5 + s * x, *size)
        for s in (-1, 1)
        for x, size in (
            (0.03, small),
            (0.085, small),
            (0.14, small),
            (0.215, fang),
            (0.33, (0.2, 0.15, 0.22)),
            (0.4, (0.3, 0.16, 0.28)),
        )
    ]
    lower = [
        (0.5 + s * x, *size)
        for s in (-1, 1)
        for x, size in (
            (0.03, small),
            (0.085, small),
            (0.165, (0.23, 0.23, 0.5)),
            (0.3, (0.2, 0.15, 0.22)),
            (0.38, (0.3, 0.16, 0.26)),
        )
    ]
    arch_upper = arch((1.05, -1.72, 2.2), (0.92, -1.72, 3.05), (0.6, -1.7, 3.65), (0, -1.66, 3.9))
    arch_lower = arch((0.92, -2.62, 2.0), (0.82, -2.64, 2.9), (0.5, -2.62, 3.5), (0, -2.58, 3.72))
    return [
        *eyes,
        gum_and_teeth("teeth_upper", arch_upper, (0, -1, 0), 0.19, upper, lean=0.05).mesh(),
        gum_and_teeth("teeth_lower", arch_lower, (0, 1, 0), 0.17, lower, lean=0.1).mesh(),
        tongue(
            "tongue",
            [(0, -2.5, 1.0), (0, -2.2, 1.9), (0, -2.24, 2.7), (0, -2.4, 3.35)],
            [0.5, 0.6, 0.62, 0.6, 0.5, 0.3],
            [0.25, 0.24, 0.2, 0.16, 0.12, 0.07],
        ).mesh(),
    ]


def landmarks(clay: Clay, mesh: Mesh) -> dict[str, int]:
    lids = lid_rings(model.EYE, clay, OPENING, **LID_RINGS)[-4]
    lips = mouth_rows(clay)
    front = lambda x, y: clay.shoot(np.array([x, y, 0.0]), np.array([[0.0, 0.0, 1.0]]), 8.0)[0]  # noqa: E731
    side = lambda y, z: clay.shoot(np.array([0.0, y, z]), np.array([[1.0, 0.0, 0.0]]), 8.0)[0]  # noqa: E731
    m = LIP
    places = {
        "brow_inner_L": front(0.85, 1.95),
        "brow_mid_L": front(1.85, 2.35),
        "brow_outer_L": front(3.0, 1.85),
        **eye_places(lids, model.BALL),
        "nose_tip": front(0.0, -0.72),
        "nose_bridge": front(0.0, 0.6),
        "nose_wing_L": front(0.62, -0.85),
        "nose_base": front(0.0, -1.3),
        "mouth_corner_L": lips[-1][m],
        "mouth_top": lips[-2][0],
        "mouth_inner_top": lips[-1][0],
        "mouth_inner_bottom": lips[-1][-1],
        "mouth_bottom": lips[-2][-1],
        "mouth_upper_L": lips[-2][m // 2],
        "mouth_lower_L": lips[-2][2 * m - m // 2],
        "chin": front(0.0, -3.05),
        "jaw_L": side(-0.9, -0.6),
        "jaw_angle_L": side(-2.3, -0.2),
        "temple_L": side(0.9, 0.6),
        "head_top": clay.shoot(model.CENTRE, np.array([[0.0, 1.0, -0.25]]), 8.0)[0],
        "head_back": clay.shoot(np.array([0, 0.6, 0.0]), np.array([[0.0, 0.0, -1.0]]), 8.0)[0],
        "neck": clay.shoot(np.array([0, -4.2, -2.2]), np.array([[0.0, -0.5, 1.0]]), 6.0)[0],
    }
    return both_sides(mesh, places)


def build() -> tuple[Mesh, dict[str, int]]:
    clay = model.clay()
    left = whiskers(clay).mesh()
    mesh = merge([head(clay).mesh(mirror=True), *inner_parts(), merge([left, mirror_image(left)])])
    return mesh, landmarks(clay, mesh)


if __name__ == "__main__":
    cat, marks = build()
    save_avatar(
        Path(sys.argv[1]) if len(sys.argv) > 1 else HERE,
        "cat",
        cat,
        COLOURS,
        marks,
        about="a cat's head. Centimetres, +x its left, +y up, +z forward.",
        decimals=DECIMALS,
    )
    print(len(cat.vertices), "vertices", len(cat.faces), "triangles")
