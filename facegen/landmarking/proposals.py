"""What is proposed: places with a confidence, whole sets of them, and in which order to ask for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from facegen.face.landmarks import REQUIRED
from facegen.geometry.mesh import Mesh
from facegen.transfer.alignment import Similarity
from facegen.transfer.landmarks import Landmarks

Array = NDArray[np.float64]

# The order in which places are best asked for: those that fix the face's place and size first.
ASKED = ("eye_outer_L", "eye_outer_R", "nose_tip", "mouth_corner_L", "mouth_corner_R", "chin", "eye_inner_L",
         "eye_inner_R", "eye_upper_L", "eye_upper_R", "eye_lower_L", "eye_lower_R", "mouth_inner_top",
         "mouth_inner_bottom", "mouth_top", "mouth_bottom", "nose_bridge", "nose_wing_L", "nose_wing_R", "brow_inner_L",
         "brow_inner_R", "brow_mid_L", "brow_mid_R", "brow_outer_L", "brow_outer_R")


@dataclass(frozen=True, eq=False)
class Proposal:
    """A place for a landmark: on triangle ``face`` with ``barycentric`` (3,), at ``xyz`` (3,) in the mesh's axes and
    units. ``confidence``: 0 to 1; ``why``: "given", "mirrored", "seen" (on the mesh itself), "laid" (with the
    base face) or "followed" (from known ones); ``given``: known before."""

    name: str
    face: int
    barycentric: Array
    xyz: Array
    confidence: float
    why: str

    @property
    def given(self) -> bool:
        """Whether it was known, and is returned as it was."""
        return self.why == "given"


@dataclass(frozen=True, eq=False)
class Proposals(Mapping[str, Proposal]):
    """Name -> `Proposal`, in the order of the list of landmarks. ``face``: how surely there is a face, 0 to 1.

    ``warnings``: a sentence each; ``errors``: those of them about what must be wrong. ``ask``: the place to ask for
    next, or None when all required ones are known. ``frame``: from the base face's axes and millimetres to the mesh's,
    or None where no face is.
    """

    places: Mapping[str, Proposal]
    face: float
    warnings: tuple[str, ...] = ()
    ask: str | None = None
    frame: Similarity | None = None
    mesh: Mesh | None = field(default=None, repr=False)
    errors: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Proposal:
        return self.places[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.places)

    def __len__(self) -> int:
        return len(self.places)

    def below(self, confidence: float) -> list[str]:
        """Return the names of required places that are less sure than this."""
        return [name for name in REQUIRED if name in self.places and self.places[name].confidence < confidence]

    def is_worth(self, name: str, confidence: float) -> bool:
        """Return whether a place is required, or as sure as this."""
        return name in REQUIRED or self.places[name].confidence >= confidence

    def landmarks(self) -> Landmarks:
        """Return the places as the landmarks that a rig takes."""
        faces = np.array([one.face for one in self.places.values()], np.int64)
        return Landmarks(tuple(self.places), faces, self.mesh.faces[faces].astype(np.int64),
                         np.array([one.barycentric for one in self.places.values()]).reshape(-1, 3))
