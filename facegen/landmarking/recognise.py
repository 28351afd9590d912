"""A face found on a mesh with no place known: where it is, and the base face's front laid there."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from facegen.landmarking.confidence import A_FACE
from facegen.landmarking.detect import candidates
from facegen.landmarking.eye_pairs import eye_frames
from facegen.landmarking.fit import BENT, WHOLE, Laid, lay, likeness
from facegen.landmarking.model import FaceModel
from facegen.landmarking.skin import Head
from facegen.transfer.alignment import Similarity

# So many of the places found are followed to their end.
_FOLLOWED = 2
# After so many rounds so many of them are laid on.
_TRIED, _KEPT = 2, 8
# One that is less alike than the best by this is followed no further.
_CLEARLY = 0.1
# The middle of the base face, mm.
MIDDLE = np.array([0.0, -35.0, 0.0])


def recognise(head: Head, model: FaceModel) -> tuple[Laid, float] | None:
    """Return the face laid where it is most alike to the mesh, and how alike."""
    found = _followed(head, model, [one.frame for one in candidates(head.surface.corners, head.planes)])
    if found is None or found[1] < A_FACE:
        more = _followed(head, model, eye_frames(head.balls, head.planes))
        found = max((one for one in (found, more) if one is not None), key=lambda one: one[1], default=None)
    return found


def _followed(head: Head, model: FaceModel, frames: list[Similarity]) -> tuple[Laid, float] | None:
    """Return the face laid from the best of several frames, and how alike it is."""
    if not frames:
        return None
    search = head.shown.search
    whole = [laid for laid, _ in _best_of(head, model, frames)]
    whole = _best_of(head, model, [frame for laid in whole for frame in (laid.frame, *_beside(laid.frame))])
    whole = [laid for laid, alike in whole if alike > whole[0][1] - _CLEARLY]
    bent = [lay(model, search, laid.frame, {}, BENT, laid.vertices) for laid in whole]
    alike = [likeness(model, laid, search) for laid in bent]
    best = int(np.argmax(alike))
    return bent[best], alike[best]


def _best_of(head: Head, model: FaceModel, frames: list[Similarity]) -> list[tuple[Laid, float]]:
    """Return the faces laid from frames, as a whole, that are most alike, and how alike; the best first."""
    search = head.shown.search
    laid = [lay(model, search, frame, {}, WHOLE[:_TRIED]) for frame in frames]
    best = np.argsort([likeness(model, one, search) for one in laid])[::-1][:_KEPT]
    laid = [lay(model, search, laid[i].frame, {}, WHOLE[_TRIED:], laid[i].vertices) for i in best]
    alike = [likeness(model, one, search) for one in laid]
    return [(laid[i], alike[i]) for i in np.argsort(alike)[::-1][:_FOLLOWED]]


def _beside(frame: Similarity) -> Iterator[Similarity]:
    """Yield frames beside one: larger and smaller, higher and lower. A face that is laid a nose too high stays there,
    because a brow is alike to a lip."""
    for size, up in product((0.9, 1.0, 1.1), (-12.0, 0.0, 12.0)):
        if size != 1.0 or up:
            middle = frame.apply(MIDDLE + np.array([0.0, up, 0.0]))
            scale = frame.scale * size
            yield Similarity(scale, frame.rotation, middle - scale * frame.rotation @ MIDDLE)
