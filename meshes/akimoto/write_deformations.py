"""Write ``tables/deformations.yaml``: what each action unit moves, in face-relative numbers.

Inputs: ``--reference DIR`` with the measured head and units that ``fit_units.py`` describes. Units with a measured
counterpart start from its least-squares fit; the others are drawn by hand from published displacements of
landmarks. Amplitudes, lids, jaw and folds are ours, tuned by looking. ``--report`` prints the share of measured
motion that the shipped face explains instead.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from fit_units import Survey, _other

from facegen.face.face import load_face

ROOT = Path(__file__).resolve().parents[2]
LEAST = 0.12        # mm: smaller movements are left out of the table

HEADER = '''# What each action unit moves at intensity E. The keys are those of raw deformation data:
#   points  feature point: [x, y, z]; +x the subject's left, +y up, +z forward, in fractions of the face's own distances
#   jaw     open (degrees), side (+ left), forward
#   lids    upper_L, lower_L ...: share of the open eye that the lid travels; 1 closes it alone, negative opens it wider
#   eyes    yaw_L ... (+ to the left), pitch_L ... (+ up), degrees        head  yaw (+ left), pitch (+ up), roll (+ left), forward
#   folds   corrective fold: amount
# Units with sides (12, L30, L46): the LEFT half, midline points with the left half's share; the right is the mirror image.
# Units without sides (17, T23): the left (_L) and the midline in full; x is 0 on the midline.
# Asymmetric units (51, 61): everything as written. `same_as` (with `scale`) and `mirror_of` refer to another unit.
# Written by meshes/akimoto/write_deformations.py; edit that file, or this one by hand.
source: "starting values: least squares on the motion of a measured head (CC0 MakeHuman face units), landmark medians over public rigs; tuned by the facegen authors"
units: face
deformations:
'''



def both(name: str, factor: float) -> dict[str, float]:
    """Return a fit of both sides at once. Because measured one-sided units take the other side along, the mouth's by up
    to a third, units of the mouth's sides are the halves of both."""
    return {f"{name}Left": factor, f"{name}Right": factor}


# unit -> how it is made. fit: {measured unit: factor}; half: split a bilateral measurement into the left half;
# sealed: the lips stay together; jaw (degrees or mm), lids (upper, lower), folds; by_hand: point -> vector, mm;
# reach: mm over which a hand-drawn movement fades; axes: factor on x, y, z.
UNITS: dict[str, dict] = {
    "1": {"fit": {"browInnerUp": 1.1}, "half": True, "folds": {"forehead_low_L": 0.7, "forehead_high_L": 0.5}},
    "2": {"fit": {"browOuterUpLeft": 0.72}, "folds": {"forehead_low_L": 0.5, "forehead_high_L": 0.6}},
    "4": {"fit": {"browDownLeft": 1.0}, "folds": {"frown_L": 1.0}},
    "5": {"fit": {"eyeWideLeft": 1.0}, "lids": (-0.45, 0.0), "margin": False},
    "6": {"fit": {"cheekSquintLeft": 1.0}, "lids": (0.0, 0.13), "margin": False,
          "folds": {"crows_feet_L": 1.0, "under_eye_L": 0.8}},
    "7": {"fit": {"eyeSquintLeft": 1.0}, "lids": (0.04, 0.43), "margin": False, "folds": {"under_eye_L": 0.4}},
    "9": {"fit": both("noseSneer", 0.90), "half": True, "folds": {"nose_root": 0.5, "nasolabial_L": 0.5}},
    "10": {"fit": both("mouthUpperUp", 1.0), "half": True, "open": True, "folds": {"nasolabial_L": 0.7}},
    "11": {"by_hand": {"nasolabial_upper_L": (1.0, 2.4, 1.6), "nose_wing_L": (0.5, 0.9, 0), "nose_wing_base_L": (.5, 1, 0),
                       "cheek_inner_L": (0.4, 1.6, 1.2), "nasolabial_L": (1.0, 1.8, 0.6), "mouth_corner_L": (1.0, 1.5, 0),
                       "lip_upper_surround_outer_L": (0.9, 1.6, 0.1), "lip_lower_outer_L": (0.8, 1.1, 0),
                       "lip_upper_outer_L": (0.8, 1.1, 0)}, "reach": 7.0, "folds": {"nasolabial_L": 1.0}},
    "12": {"fit": both("mouthSmile", 0.95), "half": True, "folds": {"nasolabial_L": 0.8, "crows_feet_L": 0.25}},
    "13": {"by_hand": {"mouth_corner_L": (2.0, 5.1, -1.3), "lip_upper_border_side_L": (0.8, -0.6, -0.3),
                       "lip_lower_border_side_L": (1.4, 1.1, -1.2), "lip_upper_border_outer_L": (1.6, 2.0, -0.6),
                       "lip_lower_border_outer_L": (2.0, 3.4, -1.4), "lip_upper_outer_L": (1.7, 3.4, -1.0),
                       "lip_lower_outer_L": (1.7, 3.4, -1.0), "lip_upper_side_L": (0.8, 0.9, -0.4),
                       "lip_lower_side_L": (0.8, 0.9, -0.4), "lip_upper_inner_L": (0.3, 0, -0.1),
                       "lip_lower_inner_L": (0.3, 0, -0.1), "lip_upper": (0, 0, 0), "lip_lower": (0, 0, 0), "nose_wing_L": (0, -0.6, 0.2), "mouth_surround_L": (2.2, 4.9, -0.5),
                       "modiolus_L": (2.0, 4.2, 1.4), "buccal_upper_L": (1.2, 2.2, 2.6), "nasolabial_L": (1.2, 2.2, 1.6),
                       "buccal_lower_L": (1.0, 1.4, 0.6)}, "reach": 8.0, "folds": {"nasolabial_L": 0.6}},
    "14": {"fit": both("mouthDimple", 0.92), "half": True, "axes": (0.85, 1, 1), "folds": {"nasolabial_L": 0.25}},
    "15": {"fit": {"mouthFrownLeft": 1.05}},
    "16": {"fit": both("mouthLowerDown", 1.55), "half": True, "open": True},
    "17": {"fit": {"mouthShrugLower": 1.1}, "folds": {"chin": 1.0}},
    "18": {"fit": {"mouthPucker": 1.0}},
    "19": {"by_hand": {"tongue_tip": (0, -1.0, 46.0), "lip_lower": (0, -2.2, 0.6), "lip_lower_border": (0, -2.0, 0.8),
                       "lip_lower_inner_L": (0, -2.1, 0.6), "lip_lower_side_L": (0, -1.4, 0.3),
                       "lip_upper": (0, 1.4, 0.4), "lip_upper_inner_L": (0, 1.3, 0.4), "lip_upper_side_L": (0, 0.8, 0.2),
                       "lip_lower_border_side_L": (0, -1.2, 0.4)},
           "reach": 4.0, "jaw": {"open": 11.0}},
    "20": {"fit": both("mouthStretch", 1.2), "half": True},
    "21": {"by_hand": {"throat_L": (4.5, -1.0, 3.5), "neck_side_L": (3.0, -1.5, 2.5), "throat": (0, -0.5, -1.5),
                       "jaw_under_L": (1.2, -1.6, 0.4), "jaw_body_L": (0.8, -1.6, 0), "mouth_corner_L": (1.2, -1.6, -0.6),
                       "lip_lower_outer_L": (0.8, -0.9, -0.3), "lip_upper_outer_L": (0.8, -0.9, -0.3),
                       "mouth_surround_L": (1.2, -1.8, -0.5), "marionette_L": (1.0, -2.0, -0.3)}, "reach": 9.0},
    "T22": {"fit": {"mouthFunnel": 1.0}, "open": True, "lip": "upper"},
    "B22": {"fit": {"mouthFunnel": 1.0}, "open": True, "lip": "lower"},
    "T23": {"by_hand": {"lip_upper_border": (0, -4.9, -3.0), "lip_upper_border_inner_L": (0, -4.4, -3.2),
                        "lip_upper_border_side_L": (-0.3, -3.4, -3.9), "lip_upper_border_outer_L": (-0.6, -1.8, -2.2),
                        "lip_upper": (0, -0.8, -2.6), "lip_upper_inner_L": (0, -0.8, -2.6), "lip_upper_side_L": (-.2, -.7, -2.2),
                        "lip_upper_outer_L": (-0.5, -0.4, -1.2), "lip_lower": (0, -0.8, -2.6), "lip_lower_inner_L": (0, -0.8, -2.6),
                        "lip_lower_side_L": (-.2, -.7, -2.2), "lip_lower_outer_L": (-0.5, -0.4, -1.2),
                        "mouth_corner_L": (-0.9, 0.1, 0.2), "philtrum": (0, -1.0, -0.4), "philtrum_L": (0, -1.0, -0.4)},
            "reach": 5.0},
    "B23": {"by_hand": {"lip_lower_border": (0, 2.9, -0.7), "lip_lower_border_side_L": (-0.2, 3.3, 1.2),
                        "lip_lower_border_outer_L": (-0.6, 1.8, 0.3), "lip_lower": (0, 0.4, -1.0),
                        "lip_lower_inner_L": (0, 0.4, -1.0), "lip_lower_side_L": (-0.2, 0.4, -0.8),
                        "lip_lower_outer_L": (-0.5, 0.2, -0.4), "lip_upper": (0, 0.4, -1.0), "lip_upper_inner_L": (0, 0.4, -1.0),
                        "lip_upper_side_L": (-0.2, 0.4, -0.8), "lip_upper_outer_L": (-0.5, 0.2, -0.4),
                        "mouth_corner_L": (-0.7, 0.3, 0.1), "chin_fold": (0, 1.2, 0.6)}, "reach": 5.0,
            "folds": {"chin": 0.25}},
    "24": {"fit": {"mouthPressLeft": 1.0, "mouthPressRight": 1.0}, "axes": (0.35, 0.75, 1)},
    "25": {"by_hand": {"lip_upper": (0, 5.6, 0.2), "lip_upper_inner_L": (0.1, 5.4, 0.2), "lip_upper_side_L": (0.3, 3.9, 0),
                       "lip_upper_outer_L": (0.3, 1.5, 0), "lip_upper_border": (0, 4.4, 0.2),
                       "lip_upper_border_inner_L": (0.1, 4.4, 0.2), "lip_upper_border_side_L": (0.3, 3.5, 0),
                       "lip_upper_border_outer_L": (0.3, 1.4, 0), "philtrum": (0, 1.5, 0), "philtrum_L": (0.1, 1.5, 0),
                       "lip_upper_surround_L": (0.2, 1.3, 0.2), "lip_lower": (0, -2.6, 0.3),
                       "lip_lower_inner_L": (0, -2.5, 0.3), "lip_lower_side_L": (0.1, -1.9, 0.1),
                       "lip_lower_outer_L": (0.1, -0.7, 0), "lip_lower_border": (0, -2.2, 0.2),
                       "lip_lower_border_side_L": (0.1, -1.7, 0.1)}, "reach": 3.0, "half": True, "jaw": {"open": 1.0}},
    "26": {"jaw": {"open": 9.8}, "fit_after_jaw": ("jawOpen", 0.4)},
    "27": {"jaw": {"open": 24.4}, "fit_after_jaw": ("jawOpen", 1.0)},
    "T28": {"fit": {"mouthRollUpper": 1.0}, "open": True},
    "B28": {"fit": {"mouthRollLower": 1.25}, "open": True},
    "29": {"jaw": {"forward": 8.3}, "fit_after_jaw": ("jawForward", 1.0), "sealed": True},
    "30": {"jaw": {"side": 6.7}, "fit_after_jaw": ("jawLeft", 1.0), "sealed": True},
    "T32": {"by_hand": {"lip_upper": (0, -3.6, -6.0), "lip_upper_inner_L": (0, -3.6, -6.0), "lip_upper_side_L": (0, -2.8, -5.0),
                        "lip_upper_outer_L": (0, -1.2, -2.0), "lip_upper_border": (0, -4.8, -4.2),
                        "lip_upper_border_inner_L": (0, -4.4, -4.2), "lip_upper_border_side_L": (0, -3.6, -3.6),
                        "lip_lower": (0, -0.6, 0), "lip_lower_inner_L": (0, -0.6, 0), "lip_lower_side_L": (0, -0.5, 0),
                        "philtrum": (0, -1.6, -1.4), "nose_base": (0, -0.8, -0.2)}, "reach": 5.0, "jaw": {"open": 1.5, "forward": 1.5}},
    "B32": {"by_hand": {"lip_lower_border": (0, 6.0, -4.6), "lip_lower": (0, 3.6, -6.8), "lip_lower_inner_L": (0, 3.6, -6.8),
                        "lip_lower_side_L": (0.1, 2.9, -5.8), "lip_lower_outer_L": (0.2, 2.2, -3.0),
                        "lip_lower_border_side_L": (0, 6.4, -1.8), "lip_lower_border_outer_L": (0.2, 4.4, -1.4),
                        "mouth_corner_L": (0.5, 2.8, -1.6), "lip_upper": (0, 3.5, -2.2), "lip_upper_inner_L": (0, 3.4, -2.2),
                        "lip_upper_side_L": (0, 2.8, -2.0), "lip_upper_outer_L": (0.2, 2.4, -1.8), "lip_upper_border": (0, 2.7, -2.4),
                        "lip_upper_border_side_L": (-0.2, 2.3, -2.4), "nose_base": (0, 0.8, -0.4), "chin_fold": (0, 2.0, 0.6),
                        "philtrum": (0, 1.8, -1.6)}, "reach": 5.0, "folds": {"chin": 0.4}},
    "33": {"fit": {"cheekPuff": 1.15}, "also": {"lip_upper": (0, -0.3, 3.0), "lip_lower": (0, -0.3, 3.0),
           "lip_upper_inner_L": (0, -0.3, 3.0), "lip_lower_inner_L": (0, -0.3, 3.0), "lip_upper_side_L": (-0.4, -.4, 3.0),
           "lip_lower_side_L": (-0.4, -0.4, 3.0), "lip_upper_outer_L": (-.2, -0.8, 3.2), "lip_lower_outer_L": (-.2, -0.8, 3.2),
           "mouth_corner_L": (3.2, -1.0, 3.2), "lip_upper_border_side_L": (0, -0.5, 3.0), "lip_lower_border_side_L": (0, -0.9, 3.0),
           "lip_upper_border": (0, 0.2, 3.0), "lip_lower_border": (0, -0.5, 3.0)}},
    "34": {"fit": {"cheekPuff": 1.25}, "half": True},
    "35": {"by_hand": {"mouth_corner_L": (-4.0, 0.1, 0.4), "lip_upper_outer_L": (-2.6, 0, 0.6), "lip_lower_outer_L": (-2.6, 0, 0.6),
                       "lip_upper_side_L": (-1.2, 0, 0.6), "lip_lower_side_L": (-1.2, 0, 0.6), "mouth_surround_L": (-4.2, 0.2, -0.4),
                       "modiolus_L": (-4.6, 0.4, -2.2), "buccal_upper_L": (-3.8, 0, -3.2), "buccal_lower_L": (-5.2, 0.6, -3.2),
                       "buccal_outer_L": (-3.6, 0, -2.2), "marionette_L": (-3.4, 0.4, -1.6), "masseter_L": (-2.4, 0, -0.8),
                       "nasolabial_L": (-1.6, 0, -1.0)}, "reach": 7.0},
    "38": {"by_hand": {"nose_wing_L": (1.0, 0.1, 1.1), "nose_wing_base_L": (0.9, 0, 0.6), "nose_wing_top_L": (0.4, 0.2, 0.3)},
           "reach": 3.0},
    "39": {"by_hand": {"nose_wing_L": (-0.7, -0.6, -0.6), "nose_wing_base_L": (-0.5, -0.3, -0.3),
                       "nose_wing_top_L": (-0.3, -0.3, -0.1), "nose_tip": (0, -0.5, 0)}, "reach": 3.0},
    "41": {"same_as": "43", "scale": 0.3},
    "42": {"same_as": "43", "scale": 0.75},
    "43": {"fit": {"eyeBlinkLeft": "meet"}, "lids": (0.97, 0.03), "margin": False, "closes": True},
    "44": {"fit": {"eyeSquintLeft": 0.8}, "lids": (0.24, 0.40), "margin": False, "folds": {"under_eye_L": 0.5}},
    "45": {"same_as": "43"},
    "46": {"fit": {"cheekSquintLeft": 0.35}, "plus": "43", "lids": (0.93, 0.07), "margin": False,
           "folds": {"crows_feet_L": 0.5, "under_eye_L": 0.4}},
    "51": {"head": {"yaw": 30}}, "52": {"mirror_of": "51"},
    "53": {"head": {"pitch": 20}}, "54": {"head": {"pitch": -20}},
    "55": {"head": {"roll": 20}}, "56": {"mirror_of": "55"},
    "57": {"head": {"forward": 0.4}}, "58": {"head": {"forward": -0.3}},
    "61": {"eyes": {"yaw_L": 25, "yaw_R": 25}}, "62": {"mirror_of": "61"},
    "63": {"eyes": {"pitch_L": 20}, "fit": {"eyeLookUpLeft": 1.0, "eyeLookUpRight": 1.0}, "lids_follow": (-0.17, 0.24),
           "margin": False},
    "64": {"eyes": {"pitch_L": -25}, "fit": {"eyeLookDownLeft": 1.0, "eyeLookDownRight": 1.0},
           "lids_follow": (0.475, -0.05), "margin": False},
    "65": {"eyes": {"yaw_L": 12}}, "66": {"eyes": {"yaw_L": -18}},
}


def lip_side(name: str, place: np.ndarray) -> float:
    """Return 1 for points of the upper lip and above, 0 for those below, 0.5 at the corner."""
    if "lip_upper" in name or "philtrum" in name or place[1] > -55:
        return 1.0
    if "lip_lower" in name or "chin" in name or place[1] < -80:
        return 0.0
    return float(np.clip((place[1] + 80) / 25, 0, 1)) if "corner" not in name else 0.5


class Maker:
    """Turns the recipes above into feature vectors, mm."""

    def __init__(self, survey: Survey) -> None:
        self.s = survey
        self.names = survey.point_names
        self.at = {n: i for i, n in enumerate(self.names)}
        self.places = survey.face.deformer.points
        x = self.places[:, 0]
        t = np.clip((x + 14) / 28, 0, 1)
        self.left = t * t * (3 - 2 * t)                 # the left half's share of a bilateral movement

    def measured(self, name: str) -> np.ndarray:
        """Return a measured motion at the survey's places."""
        return self.s.measured[name]

    def blink_factor(self) -> float:
        """The measured blink overshoots: the factor at which its margins just meet."""
        s = self.s
        lid = s.face.deformer.lids[0]
        row = {int(r): i for i, r in enumerate(s.rows)}
        out = []
        for a, b in lid.columns:
            d = s.x[row[b]] - s.x[row[a]]
            u = self.measured("eyeBlinkLeft")
            move = u[row[a]] - u[row[b]]
            out.append((d @ d) / (move @ d))
        return float(np.mean(out))

    def spread(self, drawn: dict, reach: float, one_side: bool) -> np.ndarray:
        """Return vectors (k, 3): drawn at their points, fading over ``reach`` mm; the lips do not mix."""
        pairs = [(n, np.array(v, float)) for n, v in drawn.items()]
        if not one_side:
            pairs += [(_other(n), v * [-1, 1, 1]) for n, v in pairs if n.endswith("_L")]
        out = np.zeros((len(self.names), 3))
        total = np.zeros(len(self.names))
        fixed = set(range(len(self.names))) - set(self.s.free.tolist()) - {self.at[n] for n in self.names if n.startswith("tongue_")}
        for n, v in pairs:
            i = self.at[n]
            w = np.exp(-(np.linalg.norm(self.places - self.places[i], axis=1) / reach) ** 2)
            mine = lip_side(n, self.places[i])
            same = np.array([1 - abs(lip_side(m, p) - mine) for m, p in zip(self.names, self.places, strict=True)])
            w = w * same * np.array([not m.startswith("tongue_") for m in self.names])
            out += w[:, None] * v
            total += w
        out /= np.maximum(total, 0.35)[:, None]
        for n, v in pairs:
            out[self.at[n]] = v
        out[list(fixed)] = 0
        return out

    def make(self, code: str) -> np.ndarray:
        """Return the unit's feature vectors, mm, for what its table entry will say (the left half if sided)."""
        r = UNITS[code]
        s = self.s
        v = np.zeros((len(self.names), 3))
        jaw = r.get("jaw", {})
        jaw = (jaw.get("open", 0), jaw.get("side", 0), jaw.get("forward", 0))
        sealed = not r.get("open")
        sided = not any(code == c for c in SYMMETRIC)
        if "fit" in r:
            m = 0
            for name, factor in r["fit"].items():
                m = m + self.measured(name) * (self.blink_factor() if factor == "meet" else factor)
            lids = r.get("lids", r.get("lids_follow", (0, 0)))      # what the face does by itself is not in the table
            if "plus" in r:
                lids = (0, 0)
            v = s.fit(m, lids=(*lids, *(lids if code in SYMMETRIC else (0, 0))), sealed=sealed, symmetric=not sided or r.get("half", False),
                      lids_closed=not r.get("margin", True))
        if "fit_after_jaw" in r:
            name, factor = r["fit_after_jaw"]
            v = s.fit(self.measured(name) * factor, jaw=jaw, sealed=r.get("sealed", False), symmetric=code != "30")
        if "by_hand" in r:
            v = self.spread(r["by_hand"], r["reach"], sided and not r.get("half", False))
        if "also" in r:
            v = v + self.spread(r["also"], 6.0, False)
        v = v * np.array(r.get("axes", (1, 1, 1)))
        if "lip" in r:
            share = np.array([lip_side(n, p) for n, p in zip(self.names, self.places, strict=True)])
            v = v * (share if r["lip"] == "upper" else 1 - share)[:, None]
        if r.get("half"):
            v = v * self.left[:, None]
        if "plus" in r:
            v = v + self.make(r["plus"])
        return v


SYMMETRIC = ("17", "18", "19", "21", "T22", "B22", "T23", "B23", "24", "26", "27", "T28", "B28", "29", "T32", "B32", "33", "63", "64")


# measured unit -> the unit of ours that shows the same thing (left forms where there are sides).
COUNTERPARTS = {
    "browInnerUp": "1", "browOuterUpLeft": "L2", "browDownLeft": "L4", "eyeWideLeft": "L5", "cheekSquintLeft": "L6",
    "eyeSquintLeft": "L7", "noseSneerLeft": "L9", "mouthUpperUpLeft": "L10", "mouthSmileLeft": "L12",
    "mouthDimpleLeft": "L14", "mouthFrownLeft": "L15", "mouthLowerDownLeft": "L16", "mouthShrugLower": "17",
    "mouthPucker": "18", "mouthStretchLeft": "L20", "mouthFunnel": "22", "mouthPress": "24", "jawOpen": "27",
    "mouthRollUpper": "T28", "mouthRollLower": "B28", "jawForward": "29", "jawLeft": "L30", "cheekPuff": "34",
    "eyeBlinkLeft": "L43", "eyeLookUp": "63", "eyeLookDown": "64",
}


def report(maker: Maker) -> list[tuple[str, str, float, float, float]]:
    """Return (measured unit, ours, mean movement mm, amplitude that fits best, share explained)."""
    s, rows = maker.s, []
    for name, code in COUNTERPARTS.items():
        if name in s.measured:
            m = s.measured[name] * (maker.blink_factor() if name == "eyeBlinkLeft" else 1.0)
        else:
            m = s.measured[name + "Left"] + s.measured[name + "Right"]
        pose = lambda w: s.face.pose({code: w}, detail=2)[s.rows] - s.x  # noqa: B023, E731
        full = pose(1.0)
        factor = min(s.best_scale(m, full), 1.0) if code not in ("L43", "27") else 1.0
        shown = pose(factor)
        # a weight of one may be less than the measurement's full strength: go on in proportion
        scale = s.best_scale(m, shown) if factor == 1.0 else 1.0
        size = float(np.sqrt((s.area * (m**2).sum(1)).sum() / s.area.sum()))
        rows.append((name, code, size, factor * scale, s.explained(m, shown * scale)))
    return rows


def number(x: float) -> str:
    """Return a short decimal."""
    text = f"{x:.4f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def main() -> None:
    """Fit, write the table, report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reference", type=Path, required=True)
    parser.add_argument("--report", action="store_true", help="print the share of motion explained; write nothing")
    args = parser.parse_args()
    face = load_face()
    survey = Survey(face, args.reference)
    maker = Maker(survey)
    if args.report:
        rows = report(maker)
        print("| measured unit | ours | mean movement, mm | best amplitude | share explained |\n|---|---|---|---|---|")
        for name, code, size, factor, share in rows:
            print(f"| {name} | {code} | {size:.2f} | {factor:.2f} | {share:.3f} |")
        print(f"\nmean {np.mean([r[-1] for r in rows]):.3f}, least {min(r[-1] for r in rows):.3f}")
        return
    scale = face._data.point_scale
    mouth = face._data.scales["mouth"]
    lines = []
    for code, r in UNITS.items():
        if "same_as" in r or "mirror_of" in r:
            body = ", ".join(f'{k}: "{v}"' if isinstance(v, str) else f"{k}: {v}" for k, v in r.items())
            lines.append(f'  "{code}": {{{body}}}')
            continue
        v = maker.make(code)
        entries = []
        for i, name in enumerate(survey.point_names):
            if code in SYMMETRIC and name.endswith("_R"):
                continue
            w = v[i].copy()
            if code in SYMMETRIC and not name.endswith("_L"):
                w[0] = 0
            if np.linalg.norm(w) >= LEAST:
                entries.append(f"      {name}: [{', '.join(number(c) for c in w / scale[i])}]")
        out = []
        if "jaw" in r:
            j = {k: x if k == "open" else x / mouth[0 if k == "side" else 2] for k, x in r["jaw"].items()}
            out.append("    jaw: {" + ", ".join(f"{k}: {number(x)}" for k, x in j.items()) + "}")
        if "lids" in r:
            pair = {k: x for k, x in zip(("upper_L", "lower_L"), r["lids"], strict=True) if x}
            out.append("    lids: {" + ", ".join(f"{k}: {number(x)}" for k, x in pair.items()) + "}")
        if code in ("26", "27"):
            out.append("    turns_with_jaw: [lip_lower]")
        for key in ("eyes", "head", "folds"):
            if key in r:
                out.append(f"    {key}: {{" + ", ".join(f"{k}: {number(x)}" for k, x in r[key].items()) + "}")
        if entries:
            out += ["    points:", *entries]
        lines += [f'  "{code}":', *out]
    (ROOT / "tables" / "deformations.yaml").write_text(HEADER + "\n".join(lines) + "\n")
    print(len(lines), "lines")


if __name__ == "__main__":
    main()
