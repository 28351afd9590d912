"""A lid's skin goes no farther than the template's, in openings of the eye.

Gradients and anchors carry a movement over in millimetres of a blend of parts: under the brow, a small eye's lid would
go as far as the large eye's of the template, and hang over its own edge like a beak.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.closest import means, means_of_motion
from facegen.geometry.fade import smooth_step
from facegen.transfer.closing_field import Field
from facegen.transfer.margins import Margins
from facegen.transfer.skin import Skin
from facegen.transfer.slit_wanted import directions

Array = NDArray[np.float64]

# Skin may go so many times as far: a lid folds otherwise than the template's.
_FARTHER = 1.25
# It has to keep to that where it goes with an edge by this share or more.
_OF_LID = 0.2
# And in shapes that close the lids, or open them, by more than the first share of the gap, wholly from the second on.
_FROM, _TO = 0.1, 0.3
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class LidLimits:
    """``ways`` (r, 3): where lids close to, at the vertices of a field; ``most`` (k, r), mm: how far they may go there
    in k shapes; ``closing``, ``opening`` (k, r): 1 where lids close or are wider than at rest, 0 where they are as they
    were; ``of_lid`` (r,): 1 on a lid, 0 where its skin ends or the template has none."""

    ways: Array
    most: Array
    closing: Array
    opening: Array
    of_lid: Array

    def of(self, shapes: NDArray) -> LidLimits:
        """Return those of some of the shapes."""
        return replace(self, most=self.most[shapes], closing=self.closing[shapes],
                       opening=self.opening[shapes])

    def back(self, shape: int, motion: Array) -> Array:
        """Return what takes displacements (r, 3) in a shape back to where they may go (r, 3)."""
        excess = np.maximum((motion * self.ways).sum(axis=1) - self.most[shape], 0.0)
        return -(self.of_lid * self.closing[shape] * excess)[:, None] * self.ways


def lid_limits(skin: Skin, template: Margins, avatar: Margins, field: Field, left: Array) -> LidLimits:
    """Return how far the skin round an eye may go. template, avatar: `facing_margins`; left (k, SAMPLES): the share of
    the gap at rest that the template leaves."""
    own, rows, motion = skin.template.surface, field.rows, skin.template.motion
    gaps = [margins.gap(at) for margins, at in ((template, own.vertices), (avatar, skin.surface.vertices))]
    lengths = [np.linalg.norm(gap, axis=1) for gap in gaps]
    scale = lengths[1].sum() / max(lengths[0].sum(), _TINY)
    up = np.where(field.lower > field.upper, 1.0, -1.0)[:, None]
    on_template, ways = (up * directions(field.along @ gap) for gap in gaps)
    feet = skin.feet
    partner = means(own.faces[feet.faces[rows]], feet.weights[rows], len(own.vertices))
    most = (means_of_motion(partner, motion) * on_template).sum(axis=2)
    of_lid = smooth_step(np.maximum(field.upper, field.lower) / _OF_LID) * feet.found[rows]
    closing, opening = (smooth_step((change - _FROM) / (_TO - _FROM)) @ field.along.T
                        for change in (1.0 - left, left - 1.0))
    return LidLimits(ways, _FARTHER * scale * np.maximum(most, 0.0), closing, opening, of_lid)
