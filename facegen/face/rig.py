"""What everything downstream asks of a face, be it the parametric one or an avatar with blendshapes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from facegen.facs.expressions import Resolution
from facegen.geometry.mesh import Mesh


class Rig(Protocol):
    """A face that can be posed. Vertices are in millimetres, +x the subject's left, +y up, +z forward.

    Beyond this, what only some faces have is asked for by name and may be missing: ``feature_points``, ``controls``
    and ``cage_sides`` of the parametric face; ``shape_weights``, ``colours``, ``focus`` of an avatar.
    """

    name: str

    @property
    def landmarks(self) -> tuple[str, ...]:
        """Names of the landmarks that it knows of itself."""

    def mesh(self, detail: int = 2) -> Mesh:
        """Return the neutral at a subdivision level; a face of one level returns that."""

    def pose(self, what: Any = "neutral", *, person: Any = None, intensity: float = 1.0, detail: int = 2
             ) -> NDArray[np.float64]:
        """Return the vertices (n, 3) of ``mesh(detail)`` under an expression."""

    def resolve(self, what: Any, *, person: Any = None, intensity: float = 1.0) -> Resolution:
        """Return what an input means."""

    def head_angles(self, found: Resolution) -> NDArray[np.float64]:
        """Return how the head turns (4,) in what was resolved: yaw, pitch, roll in degrees and forward in mm."""

    def check(self, meaning: Resolution) -> tuple[str, ...]:
        """Return what to warn of before this is shown; InputError if it cannot be shown."""

    def landmark_points(self, vertices: NDArray, *, detail: int = 2) -> Mapping[str, NDArray]:
        """Return name -> place (3,) of the landmarks on posed vertices."""
