"""Lengths and directions of a face, from its landmarks in the template's frame: what pieces are measured by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.face.landmarks import REQUIRED

Array = NDArray[np.float64]
Points = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class FaceMeasures:
    """Lengths and directions of a face, from its landmarks in the template's frame."""

    points: Points

    def __post_init__(self) -> None:
        missing = [name for name in REQUIRED if name not in self.points]
        if missing:
            raise InputError(f"points: the landmarks {', '.join(missing)} are missing")
        wrong = [name for name, at in self.points.items() if np.shape(at) != (3,) or not np.isfinite(at).all()]
        if wrong:
            raise InputError(f"points: expected three finite numbers for {', '.join(wrong)}")

    @cached_property
    def height(self) -> float:
        """From the chin to the brows, at least what a face that is all eyes has."""
        p = self.points
        brows = (p["brow_mid_L"] + p["brow_mid_R"]) / 2
        return max(float(np.linalg.norm(brows - p["chin"])), float(np.linalg.norm(self.eye("L") - self.eye("R"))))

    @cached_property
    def centre(self) -> Array:
        """The middle of eyes and mouth (3,)."""
        return (self.eye("L") + self.eye("R") + 2 * self.lips) / 4

    @cached_property
    def lips(self) -> Array:
        """The middle of the lip line (3,)."""
        return (self.points["mouth_inner_top"] + self.points["mouth_inner_bottom"]) / 2

    @cached_property
    def mouth_width(self) -> float:
        """From corner to corner."""
        return float(np.linalg.norm(self.points["mouth_corner_L"] - self.points["mouth_corner_R"]))

    @cached_property
    def brows(self) -> float:
        """From the tail of one brow to the other's."""
        return float(np.linalg.norm(self.points["brow_outer_L"] - self.points["brow_outer_R"]))

    @cached_property
    def lip_normal(self) -> Array:
        """The direction (3,) from the lower row of teeth to the upper: at right angles to the lip line and to the way
        from the lips to the corners, which runs far back along a muzzle and hardly at all on a person."""
        p = self.points
        back = (p["mouth_corner_L"] + p["mouth_corner_R"]) / 2 - self.lips + [0.0, 0.0, -0.5 * self.mouth_width]
        up = np.cross(-back, [1.0, 0.0, 0.0])
        return up / max(np.linalg.norm(up), 1e-300)

    @cached_property
    def mouth_axes(self) -> Array:
        """The mouth's axes in rows (3, 3): to the subject's left, up (`lip_normal`), and out."""
        left = np.array([1.0, 0.0, 0.0])
        return np.stack([left, self.lip_normal, np.cross(left, self.lip_normal)])

    def eye(self, s: str) -> Array:
        """The middle (3,) of an eye's opening."""
        return np.mean([self.points[f"eye_{name}_{s}"] for name in ("inner", "outer", "upper", "lower")], axis=0)

    def eye_width(self, s: str) -> float:
        """From corner to corner, or between the lids if that is more."""
        p = self.points
        return max(float(np.linalg.norm(p[f"eye_inner_{s}"] - p[f"eye_outer_{s}"])),
                   float(np.linalg.norm(p[f"eye_upper_{s}"] - p[f"eye_lower_{s}"])))

    def eye_outward(self, s: str) -> Array:
        """The direction (3,) in which the lids' opening looks."""
        p = self.points
        across = p[f"eye_outer_{s}"] - p[f"eye_inner_{s}"]
        up = p[f"brow_mid_{s}"] - p[f"eye_lower_{s}"]
        out = np.cross(across, up) * (1.0 if s == "L" else -1.0)
        return out / max(np.linalg.norm(out), 1e-300)
