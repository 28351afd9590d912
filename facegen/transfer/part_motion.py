"""How far and in which direction a part's motion goes on another face.

Based on: Onizuka et al. (2018), section 4.3, eq. 16-18: the movement u of a template's landmark becomes A_k R_k u on
the avatar, where R_k turns the part's direction on the template into that on the avatar, and A_k holds the ratios of
the part's sizes. Sizes are measured in the part's own axes, so they scale there: movement = R_t A R_s^T u, which for
parts that face +z is the paper's.

Where we differ: a part's axes come from pairs of its landmarks (corner to corner, lower to upper), not from the
smallest singular vector of all of them (eq. 17): a closed mouth is a line, and the normal of a line is arbitrary.
Ratios are guarded: no extent divides by zero, and the height of a mouth that is closed says nothing of its motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# A part's lateral axis runs from the first to the second landmark, its upward axis from the third to the fourth
# (means where several are named); its reach is where its say ends, in parts of its width on the template.
_MEASURED = (
    *((f"brow_{s}", (a, b), ((f"eye_inner_{s}", f"eye_outer_{s}"),
                             (f"brow_inner_{s}", f"brow_mid_{s}", f"brow_outer_{s}")))
      for s, a, b in (("R", "brow_outer_R", "brow_inner_R"), ("L", "brow_inner_L", "brow_outer_L"))),
    ("nose", ("nose_wing_R", "nose_wing_L"), (("nose_wing_R", "nose_wing_L"), ("nose_bridge",))),
    *((f"eye_{s}", (a, b), ((f"eye_lower_{s}",), (f"eye_upper_{s}",)))
      for s, a, b in (("R", "eye_outer_R", "eye_inner_R"), ("L", "eye_inner_L", "eye_outer_L"))),
    ("mouth", ("mouth_corner_R", "mouth_corner_L"), (("mouth_bottom",), ("mouth_top",))),
)
MEMBERS = {
    "brow_R": ("brow_inner_R", "brow_mid_R", "brow_outer_R"), "brow_L": ("brow_inner_L", "brow_mid_L", "brow_outer_L"),
    "nose": ("nose_tip", "nose_bridge", "nose_wing_L", "nose_wing_R", "nose_base"),
    **{f"eye_{s}": tuple(f"eye_{n}_{s}" for n in ("inner", "outer", "upper", "lower", "upper_inner", "upper_outer",
                                                  "lower_inner", "lower_outer")) for s in "RL"},
    "mouth": ("mouth_corner_L", "mouth_corner_R", "mouth_top", "mouth_inner_top", "mouth_inner_bottom", "mouth_bottom",
              "mouth_upper_L", "mouth_upper_R", "mouth_lower_L", "mouth_lower_R"),
}
"""The landmarks L_k of the six parts."""
LIP_HEIGHTS = (("mouth_inner_top", "mouth_top"), ("mouth_inner_bottom", "mouth_bottom"))
"""The edge of either lip, and its border with the skin."""

# Because a size ratio beyond this is a mistaken landmark or a caricature, and the motion would tear the mesh.
_LEAST, _MOST = 0.25, 4.0
# Because a neutral face does not tell how far its mouth opens: its upward ratio stays this near to its lateral one.
_MOUTH_LEAST, _MOUTH_MOST = 0.7, 1.4
# The share of a part's frame fades with the distance from its landmarks over this share of its width on the template.
_REACH = 0.6
# The say of "no part": where all parts are farther than about 1.5 reaches, motion is neither turned nor scaled.
_ELSEWHERE = 0.1
# Parts of which neither has a say at the other's landmarks: on a muzzle they are turned against each other by a right
# angle, and the mean of both would roll a lip's middle to a point. Brows and lids, of one skin, go together.
_APART = ("nose", "mouth")
_TINY = 1e-300
# Means of rotations need about five rounds; what is left then is less than this.
_MOST_ROUNDS, _ROUNDING = 20, 1e-14


@dataclass(frozen=True, eq=False)
class PartMotion:
    """``matrices``: part -> R_t A R_s^T (3, 3), for movements; ``turns``: part -> R_t R_s^T (3, 3), a rotation."""

    matrices: Mapping[str, NDArray]
    turns: Mapping[str, NDArray]
    ratios: Mapping[str, NDArray]


def part_motion(template: Mapping[str, NDArray], avatar: Mapping[str, NDArray]) -> PartMotion:
    """Return eq. 16-18 for landmarks name -> place (3,) on the template and on the avatar, in one frame and unit."""
    matrices, turns, ratios = {}, {}, {}
    for part, across, (low, high) in _MEASURED:
        source, target = (_axes(points, across, low, high) for points in (template, avatar))
        ratio = np.clip(_extent(avatar, across, low, high) / np.maximum(_extent(template, across, low, high), 1e-9),
                        _LEAST, _MOST)
        if part == "mouth":
            ratio[1] = np.clip(ratio[1], _MOUTH_LEAST * ratio[0], _MOUTH_MOST * ratio[0])
        elif part.startswith("brow"):
            ratio[1] = ratio[0]         # the height of a brow is its distance from the eye: lids, not brows, have it
        size = np.array([ratio[0], ratio[1], np.sqrt(ratio[0] * ratio[1])])
        matrices[part] = target @ np.diag(size) @ source.T
        turns[part] = target @ source.T
        ratios[part] = size
    return PartMotion(matrices, turns, ratios)


def _mean(points: Mapping[str, NDArray], names: tuple[str, ...]) -> NDArray:
    return np.mean([points[name] for name in names], axis=0)


def _axes(points: Mapping[str, NDArray], across: tuple[str, str], low: tuple[str, ...],
          high: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the part's axes as columns: lateral, upward, forward. Lateral counts: the corners are far apart."""
    x = points[across[1]] - points[across[0]]
    y = _mean(points, high) - _mean(points, low)
    x = x / max(np.linalg.norm(x), 1e-12)
    y = y - (y @ x) * x
    length = np.linalg.norm(y)
    if length < 1e-9:                                       # a painted mouth: no height; upward is the head's
        y = np.array([0.0, 1.0, 0.0]) - x[1] * x
        length = np.linalg.norm(y)
    y = y / length
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _extent(points: Mapping[str, NDArray], across: tuple[str, str], low: tuple[str, ...],
            high: tuple[str, ...]) -> NDArray[np.float64]:
    return np.array([np.linalg.norm(points[across[1]] - points[across[0]]),
                     np.linalg.norm(_mean(points, high) - _mean(points, low))])


def spread(motion: PartMotion, landmarks: Mapping[str, NDArray], at: NDArray) -> tuple[NDArray, NDArray]:
    """Return, for places (n, 3) on the template, matrices (n, 3, 3) for movements and the rotations (n, 3, 3) in them.

    Each part's matrix holds near its landmarks; between parts they blend, and far from all of them a movement stays
    as it is. At a nose's landmarks the mouth has no say, nor a nose at the mouth's: see `_APART`. landmarks: the
    template's.
    """
    shares = {}
    for part, across, _ in _MEASURED:
        centres = np.array([landmarks[name] for name in MEMBERS[part] if name in landmarks])
        reach = _REACH * np.linalg.norm(landmarks[across[1]] - landmarks[across[0]])
        squared = ((at[:, None, :] - centres[None]) ** 2).sum(axis=2).min(axis=1)
        shares[part] = np.exp(-squared / reach**2)
    nose, mouth = (shares[part] for part in _APART)
    both = nose * (1.0 - mouth**2), mouth * (1.0 - nose**2)
    kept = (nose + mouth) / np.maximum(both[0] + both[1], _TINY)
    shares |= {part: share * kept for part, share in zip(_APART, both, strict=True)}
    total = np.full(len(at), _ELSEWHERE)
    matrix = np.tile(_ELSEWHERE * np.eye(3), (len(at), 1, 1))
    turn = matrix.copy()
    for part, share in shares.items():
        total += share
        matrix += share[:, None, None] * motion.matrices[part]
        turn += share[:, None, None] * motion.turns[part]
    return matrix / total[:, None, None], nearest_rotations(turn / total[:, None, None])


def nearest_rotations(matrices: NDArray) -> NDArray[np.float64]:
    """Return the rotations (n, 3, 3) nearest to means of rotations that differ by less than a right angle.

    By Newton's iteration (Higham 1986): a third of the time of singular values, which serve where it does not end.
    """
    rows = np.ascontiguousarray(np.moveaxis(matrices, 0, 2))            # (3, 3, n): NumPy is slow along short last axes
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(_MOST_ROUNDS):
            cofactors = np.stack([np.cross(rows[k - 2], rows[k - 1], axis=0) for k in range(3)])
            step = cofactors / (rows[0] * cofactors[0]).sum(axis=0) - rows
            rows += step / 2
            if np.abs(step).max(initial=0.0) < _ROUNDING:
                return np.ascontiguousarray(np.moveaxis(rows, 2, 0))
    u, _, vt = np.linalg.svd(matrices)
    return u @ vt
