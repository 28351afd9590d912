"""The authored layout of the skin cage: named control points on one half of a head, rings, strips.

Run by ``fit_cage.py``. Positions are millimetres in the face's frame (+x subject's left, +y up, +z forward,
origin midway between the eye centres), drawn by hand for an average adult; the fit then moves them. A point is
``f(x, y)``: seen from the front, depth free; ``s(y, z)``: seen from the side; or ``p(x, y, z)``.
"""

from __future__ import annotations

import numpy as np

EYE_CENTRE = np.array([28.9, 0.0, 0.0])
VIEW_CENTRE = np.array([0.0, -20.0, -65.0])   # the layout is triangulated as seen from here


def f(x, y):
    return ("front", x, y)


def s(y, z):
    return ("side", y, z)


def p(x, y, z):
    return ("point", x, y, z)


# Eye, ring of ten: inner corner, four along the upper lid, outer corner, four back along the lower lid.
LID_MARGIN = [(16.6, -3.4, 11.6), (20.7, .0, 14.3), (26.2, 1.8, 15.8), (32.0, 2.2, 15.6), (37.6, 1.1, 13.2),
              (42.0, -1.1, 8.9), (37.6, -4.0, 11.6), (32.0, -5.1, 14.2), (26.2, -5.2, 14.6), (20.7, -4.6, 13.7)]
LID_RIM = {0: (20.6, -2.6, 10.2), 5: (38.8, -1.3, 9.8)}      # the corners' floor dips into the eyeball
LID_CREASE = [(13.6, -3.6), (18.2, 3.6), (24.8, 6.6), (33.2, 6.9), (41.0, 4.4), (46.0, -1.6), (40.8, -7.6),
              (33.0, -9.4), (25.0, -9.5), (17.8, -7.6)]
ORBIT = [(10.8, -3.6), (15.2, 9.4), (24.2, 13.0), (35.0, 13.0), (45.0, 8.6), (51.0, -1.5), (45.5, -12.0),
         (34.6, -15.4), (23.6, -15.8), (14.8, -11.6)]

# Mouth, columns from the middle to the corner.
LIP_X = [0.0, 5.6, 11.6, 17.4, 22.4]
LIP_SEAM_Y = [-66.9, -66.6, -66.6, -66.9, -67.4]
LIP_SEAM_Z = [28.8, 28.4, 26.6, 24.0, 20.6]
LIP_BORDER_UPPER = [(0, -59.9), (5.4, -59.2), (11.4, -60.4), (17.8, -63.6)]
LIP_BORDER_LOWER = [(0, -77.2), (6.0, -76.9), (12.3, -75.2), (18.2, -71.7)]
LIP_BELLY_LOWER = [(0, -72.6), (5.8, -72.5), (12.0, -71.6), (18.0, -69.8)]
SURROUND_UPPER = [(0, -52.6), (6.0, -51.8), (13.6, -53.0), (21.8, -56.6)]
SURROUND_LOWER = [(0, -84.6), (7.6, -84.6), (15.4, -83.0), (23.2, -78.2)]


def points() -> dict[str, tuple]:
    """Return name -> place for the subject's left half and the middle line (names ending in ``_M``)."""
    out: dict[str, tuple] = {}
    for i in range(10):
        x, y, z = LID_MARGIN[i]
        out[f"lid_margin_{i}"] = p(x, y, z)
        out[f"lid_crease_{i}"] = f(*LID_CREASE[i])
        out[f"orbit_{i}"] = f(*ORBIT[i])
    for i in range(4):
        tag = "_M" if i == 0 else ""
        out[f"lip_seam_upper_{i}{tag}"] = f(LIP_X[i], LIP_SEAM_Y[i] + 1.0)
        out[f"lip_seam_lower_{i}{tag}"] = f(LIP_X[i], LIP_SEAM_Y[i] - 1.0)
        out[f"lip_belly_lower_{i}{tag}"] = f(*LIP_BELLY_LOWER[i])
        out[f"lip_border_upper_{i}{tag}"] = f(*LIP_BORDER_UPPER[i])
        out[f"lip_border_lower_{i}{tag}"] = f(*LIP_BORDER_LOWER[i])
        out[f"surround_upper_{i}{tag}"] = f(*SURROUND_UPPER[i])
        out[f"surround_lower_{i}{tag}"] = f(*SURROUND_LOWER[i])
    out["lip_seam_4"] = f(LIP_X[4], LIP_SEAM_Y[4])
    out["lip_border_4"] = f(23.7, -67.5)
    out["surround_4"] = f(29.0, -67.4)

    out |= {  # nose
        "nasion_M": f(0, 3.0), "bridge_M": f(0, -10.0), "dorsum_M": f(0, -23.0), "nose_tip_M": p(0, -35.5, 41.6),
        "columella_M": p(0, -44.4, 36.5), "nose_base_M": p(0, -48.0, 31.2),
        "nose_root": f(6.6, -1.0), "nose_side": f(9.4, -13.0), "nose_flank": f(12.6, -24.5),
        "tip_side": f(7.2, -34.0), "wing_top": f(13.6, -31.5), "wing": p(17.6, -38.6, 21.5),
        "wing_base": p(16.6, -44.6, 20.5), "sill": p(8.8, -46.6, 26.6),
        "nostril_0": p(5.0, -42.6, 35.0), "nostril_1": p(10.8, -40.6, 31.5), "nostril_2": p(14.0, -43.0, 25.4),
        "nostril_3": p(7.4, -44.8, 29.4),
        # brow and forehead
        "glabella_M": f(0, 15.0), "brow_0": f(9.4, 15.6), "brow_1": f(20.6, 19.4), "brow_2": f(33.6, 21.4),
        "brow_3": f(46.2, 17.6), "brow_4": f(55.0, 9.0),
        "forehead_M": f(0, 33.0), "forehead_1": f(15.0, 33.5), "forehead_2": f(30.5, 34.0), "forehead_3": f(46.0, 31.0),
        "upper_forehead_M": f(0, 52.0), "upper_forehead_1": f(25.0, 52.0), "upper_forehead_2": f(45.0, 48.0),
        "hairline_M": f(0, 74.0), "hairline_1": f(29.0, 72.0),
        # temple and side
        "temple_0": s(25.0, -14.0), "temple_1": s(5.0, -16.0), "temple_2": s(40.0, -36.0), "side_0": s(14.0, -44.0),
        "malar_0": f(58.5, -9.5), "side_1": s(-16.0, -34.0),
        # cheek
        "cheek_0": f(19.5, -27.5), "cheek_1": f(31.0, -27.5), "cheek_2": f(43.0, -25.0), "cheek_3": f(54.5, -22.5),
        "fold_0": f(22.8, -38.5), "fold_1": f(28.4, -50.5), "fold_2": f(35.6, -62.0), "fold_3": f(36.0, -74.0),
        "mid_cheek_0": f(38.5, -41.5), "mid_cheek_1": f(51.5, -39.5), "mid_cheek_2": s(-38.0, -36.0),
        "low_cheek_0": f(47.0, -58.0), "low_cheek_1": s(-60.0, -26.0),
        # chin and jaw
        "chin_M": f(0, -95.0), "chin_1": f(11.5, -94.5), "chin_2": f(22.5, -90.5), "jaw_0": f(31.5, -87.0),
        "chin_low_M": p(0, -106.0, 16.0), "chin_low_1": p(13.5, -105.0, 11.0), "jaw_1": p(26.0, -99.0, 1.0),
        "jaw_2": p(42.5, -82.0, -8.0), "jaw_3": s(-70.0, -36.0), "jaw_4": p(41.0, -92.0, -19.0),
        "jaw_angle": s(-62.0, -52.0),
        "under_M": p(0, -109.5, -6.0), "under_1": p(20.0, -106.0, -12.0),
        # neck
        "throat_M": p(0, -113.5, -31.0), "throat_1": p(23.0, -108.5, -35.0), "throat_2": p(42.0, -93.0, -46.0),
        "neck_M": p(0, -130.0, -39.0), "neck_1": p(27.0, -127.0, -47.0), "neck_2": p(47.0, -112.0, -68.0),
        "neck_3": p(52.0, -92.0, -92.0), "neck_back_M": p(0, -92.0, -134.0),
        "base_M": p(0, -145.0, -43.0), "base_1": p(32.0, -142.0, -52.0), "base_2": p(56.0, -138.0, -84.0),
        "base_3": p(42.0, -136.0, -122.0), "base_back_M": p(0, -134.0, -140.0),
        # skull
        "crown_M": p(0, 96.0, -22.0), "skull_0": s(62.0, -34.0),
        "top_M": p(0, 105.8, -68.0), "top_1": p(40.0, 96.0, -72.0), "skull_1": s(60.0, -80.0), "skull_2": s(22.0, -84.0),
        "rear_top_M": p(0, 88.0, -134.0), "rear_top_1": p(38.0, 80.0, -128.0),
        "rear_M": p(0, 38.0, -165.5), "rear_1": p(38.0, 32.0, -154.0),
        "nape_M": p(0, -28.0, -152.0), "nape_1": p(34.0, -28.0, -142.0), "skull_5": s(-50.0, -104.0),

        # ear root on the head
        "ear_root_0": s(4.0, -60.0), "ear_root_1": p(70.0, 6.0, -74.0), "ear_root_2": p(71.0, -6.0, -84.0),
        "ear_root_3": p(68.0, -22.0, -84.0), "ear_root_4": p(63.0, -38.0, -78.0), "ear_root_5": p(62.0, -50.0, -67.0),
        "ear_root_6": s(-38.0, -55.0), "ear_root_7": s(-18.0, -56.0),
    }
    return out


EAR_RIM = [(72.5, -3.0, -62.5), (77.5, 5.5, -73.0), (83.0, -1.0, -85.0), (83.5, -16.0, -89.5), (80.0, -33.0, -83.0),
           (75.0, -48.0, -69.5), (69.0, -43.0, -61.0), (70.5, -22.0, -62.0)]
EAR_FOLD = [(73.5, -7.0, -65.0), (75.5, -2.0, -73.5), (79.0, -6.0, -82.0), (79.0, -18.0, -84.5), (76.0, -31.0, -78.5),
            (72.5, -38.0, -69.0)]
EAR_CONCHA = (69.5, -19.0, -71.0)

# Points of the surface that the fit must meet (name without side -> place).
PINNED: dict[str, tuple[float, float, float]] = {
    "nose_tip": (0.0, -36.0, 41.6), "nose_base": (0.0, -48.1, 31.25), "chin": (0.0, -94.4, 23.9),
    "lip_border_upper_0": (0.0, -59.6, 35.1),
}


# Rings whose edges must be in the mesh, in order (closed rings repeat the first).
def rings() -> list[list[str]]:
    """Return the edge loops that the triangulation must keep."""
    def ring(name):
        return [f"{name}_{i % 10}" for i in range(11)]

    def row(name, n=4):
        return [f"{name}_0_M", *(f"{name}_{i}" for i in range(1, n))]

    return [ring("lid_margin"), ring("lid_crease"), ring("orbit"),
            [*row("lip_seam_upper"), "lip_seam_4"], [*row("lip_seam_lower"), "lip_seam_4"],
            [*row("lip_belly_lower"), "lip_seam_4"],
            [*row("lip_border_upper"), "lip_border_4"], [*row("lip_border_lower"), "lip_border_4"],
            [*row("surround_upper"), "surround_4"], [*row("surround_lower"), "surround_4"],
            ["nostril_0", "nostril_1", "nostril_2", "nostril_3", "nostril_0"],
            ["wing_top", "wing", "wing_base"], ["nose_side", "nose_flank", "wing_top"],
            [f"ear_root_{i % 8}" for i in range(9)],
            ["brow_0", "brow_1", "brow_2", "brow_3", "brow_4"], ["glabella_M", "brow_0"],
            ["wing_base", "fold_0"], ["fold_0", "fold_1", "fold_2", "fold_3"],
            ["lip_seam_4", "lip_border_4", "surround_4"],
            ["base_M", "base_1", "base_2", "base_3", "base_back_M"]]


# -- feature points ----------------------------------------------------------------------------------------------
# name -> (control point it sits on, role, scale group, share of the jaw's turn, number in the 1986 paper or None).
# Roles: input (its vector is data), jaw (turns with the jaw), fixed (never moves).
FEATURE_POINTS: dict[str, tuple[str, str, str, float, str | None]] = {
    # middle line
    "hairline": ("hairline_M", "fixed", "upper", 0, None),
    "forehead_upper": ("upper_forehead_M", "input", "upper", 0, None),
    "forehead": ("forehead_M", "input", "upper", 0, None),
    "glabella": ("glabella_M", "input", "upper", 0, None),
    "nasion": ("nasion_M", "input", "upper", 0, None),
    "nose_bridge": ("bridge_M", "input", "middle", 0, None),
    "nose_tip": ("nose_tip_M", "input", "middle", 0.04, None),
    "nose_base": ("nose_base_M", "input", "middle", 0, "F1"),
    "philtrum": ("surround_upper_0_M", "input", "mouth", 0, None),
    "lip_upper_border": ("lip_border_upper_0_M", "input", "mouth", 0, None),
    "lip_upper": ("lip_seam_upper_0_M", "input", "mouth", 0, "F2"),
    "lip_lower": ("lip_seam_lower_0_M", "input", "mouth", 1, "F3"),
    "lip_lower_border": ("lip_border_lower_0_M", "input", "mouth", 1, None),
    "chin_fold": ("surround_lower_0_M", "input", "mouth", 1, None),
    "chin": ("chin_M", "jaw", "mouth", 1, "F4"),
    "chin_bottom": ("chin_low_M", "jaw", "mouth", 1, None),
    "submental": ("under_M", "jaw", "mouth", 1, None),
    "throat": ("throat_M", "input", "mouth", 0.33, None),
    "neck": ("neck_M", "fixed", "mouth", 0, "F5"),
    "neck_base": ("base_M", "fixed", "mouth", 0, None),
    # one side; the other mirrors it
    "hairline_L": ("hairline_1", "fixed", "upper", 0, None),
    "forehead_upper_L": ("upper_forehead_1", "input", "upper", 0, None),
    "forehead_side_L": ("upper_forehead_2", "input", "upper", 0, None),
    "forehead_inner_L": ("forehead_1", "input", "upper", 0, None),
    "forehead_mid_L": ("forehead_2", "input", "upper", 0, None),
    "forehead_outer_L": ("forehead_3", "input", "upper", 0, None),
    "brow_inner_L": ("brow_0", "input", "upper", 0, None),
    "brow_inner_mid_L": ("brow_1", "input", "upper", 0, None),
    "brow_mid_L": ("brow_2", "input", "upper", 0, None),
    "brow_outer_L": ("brow_3", "input", "upper", 0, None),
    "brow_tail_L": ("brow_4", "input", "upper", 0, None),
    "temple_L": ("temple_0", "fixed", "upper", 0, None),
    "temple_low_L": ("temple_1", "input", "upper", 0, None),
    "nose_root_L": ("nose_root", "input", "middle", 0, None),
    "orbit_inner_L": ("orbit_0", "input", "middle", 0, None),
    "orbit_upper_inner_L": ("orbit_1", "input", "upper", 0, None),
    "orbit_upper_mid_L": ("orbit_2", "input", "upper", 0, None),
    "orbit_upper_outer_L": ("orbit_3", "input", "upper", 0, None),
    "orbit_outer_upper_L": ("orbit_4", "input", "upper", 0, None),
    "orbit_outer_L": ("orbit_5", "input", "upper", 0, None),
    "orbit_lower_outer_L": ("orbit_6", "input", "middle", 0, None),
    "orbit_lower_mid_L": ("orbit_7", "input", "middle", 0, None),
    "orbit_lower_L": ("orbit_8", "input", "middle", 0, None),
    "orbit_lower_inner_L": ("orbit_9", "input", "middle", 0, None),
    "lid_upper_crease_inner_L": ("lid_crease_2", "input", "upper", 0, None),
    "lid_upper_crease_outer_L": ("lid_crease_3", "input", "upper", 0, None),
    "lid_lower_crease_outer_L": ("lid_crease_7", "input", "middle", 0, None),
    "lid_lower_crease_inner_L": ("lid_crease_8", "input", "middle", 0, None),
    "eye_inner_L": ("lid_margin_0", "input", "lid", 0, None),
    "lid_upper_inner_L": ("lid_margin_1", "input", "lid", 0, None),
    "lid_upper_mid_L": ("lid_margin_2", "input", "lid", 0, None),
    "lid_upper_outer_mid_L": ("lid_margin_3", "input", "lid", 0, None),
    "lid_upper_outer_L": ("lid_margin_4", "input", "lid", 0, None),
    "eye_outer_L": ("lid_margin_5", "input", "lid", 0, None),
    "lid_lower_outer_L": ("lid_margin_6", "input", "lid", 0, None),
    "lid_lower_outer_mid_L": ("lid_margin_7", "input", "lid", 0, None),
    "lid_lower_mid_L": ("lid_margin_8", "input", "lid", 0, None),
    "lid_lower_inner_L": ("lid_margin_9", "input", "lid", 0, None),
    "nose_side_L": ("nose_side", "input", "middle", 0, None),
    "nose_flank_L": ("nose_flank", "input", "middle", 0, None),
    "nose_wing_top_L": ("wing_top", "input", "middle", 0, None),
    "nose_wing_L": ("wing", "input", "middle", 0.05, "F6"),
    "nose_wing_base_L": ("wing_base", "input", "middle", 0, None),
    "malar_L": ("malar_0", "input", "middle", 0, None),
    "cheek_inner_L": ("cheek_0", "input", "middle", 0, None),
    "cheek_mid_L": ("cheek_1", "input", "middle", 0, None),
    "cheek_L": ("cheek_2", "input", "middle", 0, "F10"),
    "cheek_outer_L": ("cheek_3", "input", "middle", 0, None),
    "cheek_side_L": ("side_1", "input", "middle", 0, None),
    "nasolabial_upper_L": ("fold_0", "input", "middle", 0.1, None),
    "nasolabial_L": ("fold_1", "input", "mouth", 0.45, None),
    "modiolus_L": ("fold_2", "input", "mouth", 0.55, None),
    "marionette_L": ("fold_3", "input", "mouth", 0.45, None),
    "buccal_upper_L": ("mid_cheek_0", "input", "middle", 0.15, None),
    "buccal_outer_L": ("mid_cheek_1", "input", "middle", 0.3, None),
    "masseter_upper_L": ("mid_cheek_2", "input", "middle", 0.12, None),
    "buccal_lower_L": ("low_cheek_0", "input", "mouth", 0.42, None),
    "masseter_L": ("low_cheek_1", "input", "mouth", 0.6, None),
    "philtrum_L": ("surround_upper_1", "input", "mouth", 0.05, None),
    "lip_upper_surround_L": ("surround_upper_2", "input", "mouth", 0.18, None),
    "lip_upper_surround_outer_L": ("surround_upper_3", "input", "mouth", 0.35, None),
    "mouth_surround_L": ("surround_4", "input", "mouth", 0.49, None),
    "lip_lower_surround_outer_L": ("surround_lower_3", "input", "mouth", 0.62, None),
    "lip_lower_surround_L": ("surround_lower_2", "input", "mouth", 0.88, None),
    "lip_upper_border_inner_L": ("lip_border_upper_1", "input", "mouth", 0.1, None),
    "lip_upper_border_side_L": ("lip_border_upper_2", "input", "mouth", 0.18, None),
    "lip_upper_border_outer_L": ("lip_border_upper_3", "input", "mouth", 0.28, None),
    "lip_lower_border_outer_L": ("lip_border_lower_3", "input", "mouth", 0.62, None),
    "lip_lower_border_side_L": ("lip_border_lower_2", "input", "mouth", 0.95, None),
    "lip_upper_inner_L": ("lip_seam_upper_1", "input", "mouth", 0.04, None),
    "lip_upper_side_L": ("lip_seam_upper_2", "input", "mouth", 0.16, None),
    "lip_upper_outer_L": ("lip_seam_upper_3", "input", "mouth", 0.25, None),
    "mouth_corner_L": ("lip_seam_4", "input", "mouth", 0.45, "F8"),
    "lip_lower_outer_L": ("lip_seam_lower_3", "input", "mouth", 0.72, None),
    "lip_lower_side_L": ("lip_seam_lower_2", "input", "mouth", 0.97, None),
    "lip_lower_inner_L": ("lip_seam_lower_1", "input", "mouth", 1, None),
    "chin_inner_L": ("chin_1", "jaw", "mouth", 1, None),
    "chin_side_L": ("chin_2", "jaw", "mouth", 0.87, None),
    "chin_bottom_L": ("chin_low_1", "jaw", "mouth", 1, None),
    "jaw_side_L": ("jaw_0", "jaw", "mouth", 0.83, None),
    "jaw_edge_L": ("jaw_1", "jaw", "mouth", 1, None),
    "jaw_body_L": ("jaw_2", "jaw", "mouth", 0.95, None),
    "jaw_back_L": ("jaw_3", "jaw", "mouth", 0.75, None),
    "jaw_under_L": ("jaw_4", "jaw", "mouth", 0.92, "F14"),
    "jaw_angle_L": ("jaw_angle", "jaw", "mouth", 0.42, None),
    "submental_L": ("under_1", "jaw", "mouth", 1, None),
    "throat_L": ("throat_1", "input", "mouth", 0.42, None),
    "neck_side_L": ("throat_2", "input", "mouth", 0.13, None),
    "neck_L": ("neck_1", "fixed", "mouth", 0, None),
    "neck_back_L": ("neck_2", "fixed", "mouth", 0, None),
    "jaw_joint_L": ("ear_root_7", "fixed", "mouth", 0, "F12"),
    "ear_lower_L": ("ear_root_6", "fixed", "mouth", 0, None),
    "ear_upper_L": ("ear_root_0", "fixed", "upper", 0, None),
}


def point_rings() -> list[list[str]]:
    """Return the edge loops of feature points that the regions must keep (subject's left half)."""
    lids = ["eye_inner_L", "lid_upper_inner_L", "lid_upper_mid_L", "lid_upper_outer_mid_L", "lid_upper_outer_L",
            "eye_outer_L", "lid_lower_outer_L", "lid_lower_outer_mid_L", "lid_lower_mid_L", "lid_lower_inner_L",
            "eye_inner_L"]
    rings = [lids]
    for part in ("upper", "lower"):
        rings.append([f"lip_{part}", f"lip_{part}_inner_L", f"lip_{part}_side_L", f"lip_{part}_outer_L",
                      "mouth_corner_L"])
    rings.append(["lip_upper_border", "lip_upper_border_inner_L", "lip_upper_border_side_L",
                  "lip_upper_border_outer_L", "mouth_surround_L"])
    rings.append(["lip_lower_border", "lip_lower_border_side_L", "lip_lower_border_outer_L", "mouth_surround_L"])
    rings.append(["mouth_corner_L", "mouth_surround_L"])
    rings.append(["glabella", "brow_inner_L", "brow_inner_mid_L", "brow_mid_L", "brow_outer_L", "brow_tail_L"])
    rings.append(["neck_base", "neck_L", "neck_back_L", "ear_lower_L", "jaw_joint_L", "ear_upper_L", "temple_L",
                  "hairline_L", "hairline"])
    return rings


# Vertices that turn inward take the weights of these (no ray from O orders them).
def followers() -> dict[str, dict[str, float]]:
    """Return control point -> control points it follows with shares (left half and middle line)."""
    out: dict[str, dict[str, float]] = {f"lid_rim_{i}": {f"lid_margin_{i}": 1.0} for i in range(10)}
    for part in ("upper", "lower"):
        for i in range(4):
            out[f"lip_inner_{part}_{i}" + "_M" * (i == 0)] = {f"lip_seam_{part}_{i}" + "_M" * (i == 0): 1.0}
        out[f"lip_deep_{part}_0_M"] = {f"lip_seam_{part}_0_M": 0.5, f"surround_{part}_0_M": 0.5}
        out[f"lip_deep_{part}_2"] = {f"lip_seam_{part}_2": 0.5, f"surround_{part}_2": 0.5}
    out["lip_inner_4"] = {"lip_seam_4": 1.0}
    out["lip_deep_4"] = {"lip_seam_4": 0.5, "fold_2": 0.5}
    out["nostril_in"] = {"nostril_1": 0.6, "tip_side": 0.4}
    return out


# How far the skin behind a lid's margin goes with it.
# Upper lid from the inner to the outer corner, lower lid likewise.
CREASE_SHARE_UPPER, CREASE_SHARE_LOWER = (0.50, 0.62, 0.84, 0.68), (0.60, 0.90, 0.95, 0.75)

JAW_HINGE = (0.0, -32.0, -62.0)
JAW_GLIDE = (0.0, 0.119, 0.340)      # mm per degree: 2.9 and 8.3 mm at 24.4 degrees, as measured on the teeth
CENTRE_O = (0.0, -25.0, -60.0)
MEASURES = {"eye_separation": 57.8, "eye_nose": 48.2, "mouth_nose": 18.8, "mouth_width": 44.8, "eye_opening": 7.9}
SCALES = {"upper": ("eye_separation", "eye_nose", "eye_nose"), "middle": ("eye_separation", "eye_nose", "eye_nose"),
          "lid": ("eye_separation", "eye_opening", "eye_opening"),
          "mouth": ("mouth_width", "mouth_nose", "mouth_width")}
# Lid travel (upper, lower) per degree of gaze: the upper lid goes down with it, the lower comes up with it.
LID_FOLLOW = {"down": [0.0190, -0.0020], "up": [-0.0085, 0.0120]}
HEAD = {"pivot": [0.0, -70.0, -75.0], "moves_above": [0.0, -84.0, -70.0], "rests_below": [0.0, -138.0, -80.0]}
HEAD_HALF_HEIGHT = 107.0             # crown to chin is two units of the 1986 paper
PARTS = [
    {"file": "parts.obj", "part": "eye_L", "carried_by": "eye", "eye": "L"},
    {"file": "parts.obj", "part": "eye_R", "carried_by": "eye", "eye": "R"},
    {"file": "parts.obj", "part": "teeth_upper", "carried_by": "skull"},
    {"file": "parts.obj", "part": "teeth_lower", "carried_by": "jaw"},
    {"file": "parts.obj", "part": "tongue", "carried_by": "jaw"},
    {"file": "soft.obj", "part": "mouth", "carried_by": "mouth", "fades": [-52.0, -80.0]},
    {"file": "soft.obj", "part": "brows", "carried_by": "skin"},
    {"file": "soft.obj", "part": "hair", "carried_by": "skin"},
]

# Corrective folds: the valley's curve (dropped onto the surface from the front), half width, depth, ridge height (mm), the side the ridge lies on.
FOLDS = {
    "nasolabial_L": {"along": [[18.2, -37.0, 22.0], [20.2, -45.0, 20.0], [23.6, -54.0, 17.0], [28.6, -63.5, 12.0],
                               [32.6, -74.0, 8.0], [34.0, -86.0, 6.0]], "width": 2.8, "depth": 1.15, "ridge": 1.2,
                     "toward": [1, 0.5, 0]},
    "crows_feet_L": {"along": [[46.5, -2.0, 7.0], [51.0, -3.5, 2.0], [55.5, -6.5, -4.0]], "width": 1.1, "depth": 0.7,
                     "ridge": 0.35, "toward": [0, -1, 0]},
    "under_eye_L": {"along": [[16.0, -9.0, 14.0], [23.0, -13.0, 15.5], [31.0, -14.0, 15.0], [40.0, -11.5, 11.5],
                              [46.0, -7.0, 7.5]], "width": 1.9, "depth": 0.9, "ridge": 0.8, "toward": [0, 1, 0]},
    "forehead_low_L": {"along": [[-3.0, 30.0, 25.5], [10.0, 31.0, 25.0], [24.0, 33.0, 22.0], [40.0, 33.0, 14.0]],
                       "width": 2.0, "depth": 0.8, "ridge": 0.6, "toward": [0, 1, 0]},
    "forehead_high_L": {"along": [[-3.0, 40.0, 23.5], [10.0, 41.0, 23.0], [24.0, 42.5, 20.0], [38.0, 42.0, 13.0]],
                        "width": 2.0, "depth": 0.8, "ridge": 0.6, "toward": [0, 1, 0]},
    "frown_L": {"along": [[4.6, 7.0, 24.5], [5.4, 14.0, 26.0], [5.0, 23.0, 26.0]], "width": 1.5, "depth": 1.1,
                "ridge": 0.8, "toward": [1, 0, 0]},
    "nose_root": {"along": [[-8.0, 2.5, 20.0], [0.0, 3.5, 23.5], [8.0, 2.5, 20.0]], "width": 1.6, "depth": 1.0,
                  "ridge": 0.7, "toward": [0, 1, 0]},
    "chin": {"along": [[-13.0, -84.0, 20.5], [0.0, -82.5, 24.5], [13.0, -84.0, 20.5]], "width": 2.6, "depth": 1.3,
             "ridge": 1.1, "toward": [0, -1, 0]},
}


def mirrored_fold(fold: dict) -> dict:
    """Return a fold on the other side."""
    flip = lambda v: [-v[0], *v[1:]]  # noqa: E731
    return {**fold, "along": [flip(v) for v in fold["along"]], "toward": flip(fold["toward"])}


# -- the paper's own points and regions -----------------------------------------------------------------------------
PAPER_ROLES = {**{f"F{i}": "fixed" for i in range(1, 16)}, **{f"F{i}": "input" for i in (2, 3, 8, 9)},
               **{f"F{i}": "jaw" for i in (4, 14, 15)}}


def paper_regions() -> list[dict]:
    """Return our reconstruction of regions 1 to 19; 6 is the paper's example, 1, 16 and 17 turn with the jaw."""
    pairs = [(2, ("nose_base", "lip_upper", "mouth_corner_L"), "mouth_upper", False),
             (4, ("nose_base", "mouth_corner_L", "nose_wing_L"), "mouth_upper", False),
             (6, ("lip_lower", "chin", "mouth_corner_L"), "mouth_lower", False),
             (8, ("nose_wing_L", "mouth_corner_L", "cheek_L"), None, False),
             (10, ("cheek_L", "mouth_corner_L", "jaw_joint_L"), None, False),
             (12, ("mouth_corner_L", "chin", "jaw_joint_L"), None, False),
             (14, ("jaw_joint_L", "jaw_under_L", "neck"), None, False),
             (16, ("chin", "jaw_under_L", "jaw_joint_L"), None, True)]
    out = [{"number": 1, "points": ["chin", "jaw_under_L", "jaw_under_R"], "rigid": True}]
    for number, points, sheet, rigid in pairs:
        for k in (0, 1):
            names = [n[:-1] + "R" if k and n.endswith("_L") else n for n in points]
            out.append({"number": number + k, "points": names[::-1] if k else names,
                        **({"sheet": sheet} if sheet else {}), **({"rigid": True} if rigid else {})})
    out.append({"number": 18, "points": ["jaw_under_L", "jaw_under_R", "neck"]})
    out.append({"number": 19, "points": ["nose_base", "nose_wing_L", "nose_wing_R"]})
    return out
