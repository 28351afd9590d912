"""Write layouts.yaml: where the points of two common landmark layouts lie on the base face.

    python meshes/akimoto/author_layouts.py

ibug68: placed by what its annotators were told to mark (C. Sagonas and others, "300 faces in-the-wild challenge",
2013). mediapipe478: its model has no written definition, so MediaPipe's own detector (0.10.21) was shown pictures of the
base face in seven views; each point is the median of where it pointed to on the surface, made symmetric. What it
marks as a line - the lids' and the lips' edges - is put on that line, and points that wandered by more than 2 mm over
the views are left out: those slide along the outline.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from facegen.fileio.obj import read_obj

HERE = Path(__file__).parent
NAMES = (HERE / "cage_names.txt").read_text().split()
MESH = read_obj(HERE / "cage.obj").mesh


def vertex(name: str) -> int:
    return NAMES.index(name)


def line(names: list[str], x: float) -> str:
    """Return the place on a line through vertices of the cage where it is so far from the middle, mm."""
    rows = [vertex(name) for name in names]
    across = np.abs(MESH.vertices[rows, 0])
    order = np.argsort(across)
    rows, across = np.array(rows)[order], across[order]
    x = min(max(abs(x), across[0]), across[-1])
    k = min(int(np.searchsorted(across, x, side="right")) - 1, len(rows) - 2)
    share = float((x - across[k]) / (across[k + 1] - across[k]))
    if share < 1e-9 or share > 1 - 1e-9:
        return str(int(rows[k + round(share)]))
    face = next(f for f, corners in enumerate(MESH.faces.tolist()) if {int(rows[k]), int(rows[k + 1])} <= set(corners))
    weights = [0.0, 0.0, 0.0]
    corners = MESH.faces[face].tolist()
    weights[corners.index(int(rows[k + 1]))] = round(share, 3)
    weights[corners.index(int(rows[k]))] = round(1.0 - round(share, 3), 3)
    return f"{{face: {face}, barycentric: [{', '.join(f'{w:g}' for w in weights)}]}}"


def sided(names: list[str], side: str) -> list[str]:
    return [name.replace("_#", f"_{side}") for name in names]


UPPER_LID = [f"lid_margin_{k}_#" for k in range(6)]
LOWER_LID = [f"lid_margin_{k}_#" for k in (0, 9, 8, 7, 6, 5)]
UPPER_LIP = ["lip_border_upper_0", *(f"lip_border_upper_{k}_#" for k in (1, 2, 3)), "lip_seam_4_#"]
LOWER_LIP = ["lip_border_lower_0", *(f"lip_border_lower_{k}_#" for k in (1, 2, 3)), "lip_seam_4_#"]
UPPER_SEAM = ["lip_seam_upper_0", *(f"lip_seam_upper_{k}_#" for k in (1, 2, 3)), "lip_seam_4_#"]
LOWER_SEAM = ["lip_seam_lower_0", *(f"lip_seam_lower_{k}_#" for k in (1, 2, 3)), "lip_seam_4_#"]

# Points of MediaPipe on lines: the subject's right, their left, millimetres from the middle.
LINES = {
    "lids": (2.0, "the edges of the lids: how far eyes are open", [
        (UPPER_LID, [(33, 263, 42.0), (246, 466, 39.4), (161, 388, 37.3), (160, 387, 33.8), (159, 386, 29.3),
                     (158, 385, 25.0), (157, 384, 20.6), (173, 398, 18.0), (133, 362, 16.6)]),
        (LOWER_LID, [(7, 249, 39.3), (163, 390, 36.4), (144, 373, 33.1), (145, 374, 28.9), (153, 380, 24.4),
                     (154, 381, 20.8), (155, 382, 18.0)])]),
    "lips": (1.0, "both edges of both lips", [
        (UPPER_LIP, [(61, 291, 22.4), (185, 409, 20.5), (40, 270, 17.3), (39, 269, 12.8), (37, 267, 6.0)]),
        (LOWER_LIP, [(146, 375, 20.2), (91, 321, 17.4), (181, 405, 12.3), (84, 314, 6.9)]),
        (UPPER_SEAM, [(78, 308, 20.6), (191, 415, 16.8), (80, 310, 14.0), (81, 311, 10.0), (82, 312, 5.0)]),
        (LOWER_SEAM, [(95, 324, 16.8), (88, 318, 13.8), (178, 402, 10.0), (87, 317, 5.3)])]),
}
MIDDLES = {"lips": {0: "lip_border_upper_0", 17: "lip_border_lower_0", 13: "lip_seam_upper_0", 14: "lip_seam_lower_0"}}
# Points of MediaPipe on the skin: the subject's right, their left, the left one's place.
SKIN = {
    "brows": (1.0, "the upper and the lower edge of the brows", {
        (70, 300): (51.1, 12.7, 5.4), (63, 293): (45.2, 17.7, 12.9), (105, 334): (36.4, 19.7, 19.0),
        (66, 296): (25.0, 19.0, 23.8), (107, 336): (11.6, 17.6, 25.6), (46, 276): (47.6, 10.5, 10.4),
        (53, 283): (41.7, 13.8, 16.4), (52, 282): (33.7, 15.8, 20.9), (65, 295): (23.5, 14.8, 23.7),
        (55, 285): (10.7, 10.7, 24.0)}),
    "nose": (1.0, "the bridge, the tip, the wings", {
        (168,): (0, 2.1, 23.2), (6,): (0, -6.5, 24.1), (197,): (0, -13.2, 27.3), (195,): (0, -18.8, 31.5),
        (5,): (0, -25.3, 36.3), (4,): (0, -33.9, 40.8), (1,): (0, -38.3, 40.9), (2,): (0, -43.7, 36.6),
        (98, 327): (14.4, -43.8, 24.7), (97, 326): (6.0, -44.5, 30.0), (64, 294): (16.1, -39.8, 25.4)}),
    "skin": (0.5, "cheeks, chin and forehead, where the detector points to the same place from every side", {
        (151,): (0, 30.3, 24.7), (9,): (0, 16.5, 25.8), (8,): (0, 9.0, 24.5), (18,): (0, -83.5, 24.2),
        (200,): (0, -90.2, 23.7), (199,): (0, -95.8, 23.4), (175,): (0, -102.6, 19.5), (152,): (0, -106.1, 14.9),
        (108, 337): (14.3, 30.1, 23.9), (69, 299): (28.0, 30.8, 20.0), (104, 333): (40.8, 29.3, 12.7),
        (193, 417): (6.3, 0.9, 21.2), (117, 346): (47.6, -18.1, 6.6), (118, 347): (40.2, -20.4, 10.9),
        (119, 348): (29.4, -19.9, 13.7), (100, 329): (21.3, -22.4, 16.8), (101, 330): (30.8, -26.2, 15.1),
        (36, 266): (27.1, -34.1, 17.1), (142, 371): (19.8, -29.7, 18.8), (203, 423): (22.4, -42.5, 19.2),
        (206, 426): (27.4, -47.9, 18.3), (205, 425): (34.4, -41.6, 15.1), (83, 313): (7.1, -82.9, 24.1),
        (201, 421): (9.0, -89.0, 22.3), (208, 428): (11.0, -95.4, 20.7), (171, 396): (11.6, -101.2, 17.7)}),
}


def mediapipe() -> dict[str, tuple[float, str, dict[int, str]]]:
    groups = {}
    for name, (weight, why, lines) in LINES.items():
        points = {}
        for vertices, entries in lines:
            for right, left, x in entries:
                points[right], points[left] = (line(sided(vertices, side), x) for side in "RL")
        points |= {index: str(vertex(at)) for index, at in MIDDLES.get(name, {}).items()}
        groups[name] = weight, why, points
    for name, (weight, why, entries) in SKIN.items():
        points = {}
        for indices, (x, y, z) in entries.items():
            for index, sign in zip(indices, (-1, 1) if len(indices) == 2 else (1,), strict=True):
                points[index] = f"[{sign * x:g}, {y:g}, {z:g}]"
        groups[name] = weight, why, points
    groups["pupils"] = 1.0, "the middles of the irises: where the eyes look", {468: "eye_center_R", 473: "eye_center_L"}
    return groups


def ibug() -> dict[str, tuple[float, str, dict[int, str]]]:
    outline = [(65.0, -2, -40), (65.5, -20, -36), (63.5, -40.6, -38), (59.5, -60, -34), (53.5, -76, -26),
               (44.0, -88.5, -14), (31.0, -98, -2), (16.0, -105.5, 11)]
    sides = {i: f"[{-x:g}, {y:g}, {z:g}]" for i, (x, y, z) in enumerate(outline[:6])}
    sides |= {16 - i: f"[{x:g}, {y:g}, {z:g}]" for i, (x, y, z) in enumerate(outline[:6])}
    chin = {i: f"[{-x:g}, {y:g}, {z:g}]" for i, (x, y, z) in enumerate(outline[6:], 6)}
    chin |= {16 - i: f"[{x:g}, {y:g}, {z:g}]" for i, (x, y, z) in enumerate(outline[6:], 6)} | {8: "[0, -107.5, 14]"}
    # from the outer to the inner end; 17 and 26 are the outer ones
    hair = [("brow_outer",), (42.0, 15.9, 15.5), ("brow_mid",), (21.5, 16.9, 24.6), ("brow_inner",)]
    brows = {}
    for k, at in enumerate(hair):
        for index, side, sign in ((17 + k, "R", -1), (26 - k, "L", 1)):
            brows[index] = f"{at[0]}_{side}" if len(at) == 1 else f"[{sign * at[0]:g}, {at[1]:g}, {at[2]:g}]"
    nose = {27: str(vertex("nasion")), 28: "nose_bridge", 29: str(vertex("dorsum")), 30: "nose_tip",
            31: str(vertex("wing_base_R")), 32: str(vertex("sill_R")), 33: "nose_base", 34: str(vertex("sill_L")),
            35: str(vertex("wing_base_L"))}
    lids = {}
    for side, outer, upper_outer, upper_inner, inner, lower_inner, lower_outer in (
            ("R", 36, 37, 38, 39, 40, 41), ("L", 45, 44, 43, 42, 47, 46)):
        lids[outer], lids[inner] = f"eye_outer_{side}", f"eye_inner_{side}"
        lids[upper_outer], lids[upper_inner] = (line(sided(UPPER_LID, side), x) for x in (33.5, 25.0))
        lids[lower_outer], lids[lower_inner] = (line(sided(LOWER_LID, side), x) for x in (33.5, 25.0))
    lips = {48: "mouth_corner_R", 54: "mouth_corner_L", 51: "mouth_top", 57: "mouth_bottom", 62: "mouth_inner_top",
            66: "mouth_inner_bottom"}
    for side, indices in (("R", (49, 50, 61, 59, 58, 67)), ("L", (53, 52, 63, 55, 56, 65))):
        for index, vertices, x in zip(indices, (UPPER_LIP, UPPER_LIP, UPPER_SEAM, LOWER_LIP, LOWER_LIP, LOWER_SEAM),
                                      (14.0, 6.5, 11.6, 14.0, 6.5, 11.6), strict=True):
            lips[index] = line(sided(vertices, side), x)
    return {"outline": (0.1, "the face's outline: in pictures from the side it is another line of the skin", sides),
            "chin": (0.5, "the lower end of the outline: the jaw", chin),
            "brows": (1.0, "along the middle of the brows", brows),
            "nose": (1.0, "the bridge from between the eyes to the tip, and under the wings", nose),
            "lids": (2.0, "the corners of the eyes and the edges of the lids", lids),
            "lips": (1.0, "the outer and the inner edge of the lips", lips),
            "corners": (0.5, "the inner corners of the mouth, which on this face are the outer ones",
                        {60: "mouth_corner_R", 64: "mouth_corner_L"})}


LAYOUTS = {
    "ibug68": (68, "68 points of 300-W (iBUG, Multi-PIE), as dlib, OpenFace, py-feat and face-alignment give them; 0 is "
                   "at the subject's right ear", ibug()),
    "mediapipe478": (478, "MediaPipe's face mesh with irises, in its own order; those of its points that lie where the "
                          "face moves or keeps its shape, and not where a mesh only fills the space between",
                     mediapipe()),
}


def main() -> None:
    rows = ["# Where the points of landmark layouts lie on the base face: written by author_layouts.py, which says how.",
            "# A point is a landmark, a vertex of cage.obj, a place on one of its triangles, or the skin nearest to a",
            "# place in mm. weight: how much the points of a group count; lids move least and are seen best.",
            "source: own work of the facegen authors, MIT", "layouts:"]
    for name, (count, about, groups) in LAYOUTS.items():
        rows += [f"  {name}:", f"    about: \"{about}\"", f"    count: {count}", "    groups:"]
        for group, (weight, why, points) in groups.items():
            rows += [f"      {group}:", f"        weight: {weight:g}", f"        why: \"{why}\"", "        points:"]
            rows += [f"          {index}: {points[index]}" for index in sorted(points)]
    (HERE / "layouts.yaml").write_text("\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
