"""How sure a proposed place is. Calibrated by benchmarks/landmarks.py on heads of several authors: of places with a
confidence c, the share c or more lies within a twentieth of the distance between the outer corners of the eyes."""

from __future__ import annotations

from collections.abc import Mapping
from math import erf, exp, pi, sqrt

import numpy as np
from numpy.typing import NDArray

# A face is recognised if it is this sure; else so many known places are asked for.
RECOGNISED, ENOUGH_TO_START = 0.5, 6
# A laid face whose relief is as alike as this is a face; below the second it is none.
A_FACE, _NO_FACE = 0.65, 0.4
# A known place's mirror image.
MIRRORED = 0.9
# A place is good within this share of the distance between the outer corners of the eyes.
_GOOD = 0.05
# What was seen of a face that is certainly one; and what was only laid, by part, because of brows and wings of the nose
# little shows.
_SEEN = 0.95
_LAID = {"brow": 0.6, "nose_wing": 0.65, "chin": 0.85, "mouth_top": 0.7, "mouth_bottom": 0.7, "nose_bridge": 0.8,
         "eye": 0.85}
_LAID_ELSE = 0.75
# Likeness of reliefs from which nothing, and all of this, is believed; what enough known places make of it at least.
_DOUBTFUL, _CERTAIN, _WITH_ENOUGH = 0.4, 0.8, 0.35


def sure(alike: float) -> float:
    """Return how surely, 0 to 1, a relief that is so much alike is a face's."""
    return float(np.clip((alike - _NO_FACE) / (A_FACE - _NO_FACE), 0.0, 1.0))


def belief(alike: float, known: int) -> float:
    """Return how far, 0 to 1, places of a face are believed whose relief is so much alike, with so many known."""
    found = float(np.clip((alike - _DOUBTFUL) / (_CERTAIN - _DOUBTFUL), 0.0, 1.0))
    return max(found, _WITH_ENOUGH) if known >= ENOUGH_TO_START else found


def laid_share(name: str, seen: bool) -> float:
    """Return how sure a place is that was seen, or only laid, on what is certainly a face."""
    return _SEEN if seen else next((share for part, share in _LAID.items() if name.startswith(part)), _LAID_ELSE)


def confidence_of(off: float, places: Mapping[str, NDArray]) -> float:
    """Return how sure a place is that may be off by so much each way, normally distributed: the share of such places
    that are good. places: name -> (3,) of the face, in the same units."""
    t = _GOOD * float(np.linalg.norm(places["eye_outer_L"] - places["eye_outer_R"])) / max(off, 1e-9)
    return erf(t / sqrt(2)) - sqrt(2 / pi) * t * exp(-t * t / 2)
