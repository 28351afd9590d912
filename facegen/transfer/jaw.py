"""The jaw of an avatar: where it turns, how far, and what goes with it.

The template knows its jaw as a rotation about two joints. Carried over as a rotation about the avatar's own joints, a
long jaw swings as a whole; transferred as gradients it would fold at the corner of the mouth (Onizuka 2018, section 5,
the horse). How far it turns is the avatar's own measure: its lip seam and its jaw's length, not a guessed ratio.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.face.deformer import Jaw
from facegen.geometry.closest import Feet
from facegen.geometry.factor import Factor
from facegen.geometry.operators import Surface
from facegen.transfer.solve import rotation_between
from facegen.transfer.template import placing

# Because a jaw that turns less than this share of the template's hardly opens, and one that turns more dislocates.
_LEAST_TURN, _MOST_TURN = 0.45, 1.4
# Millimetres: a partner's share counts this firmly; farther ones give way to smoothness.
_NEAR = 0.3
# Smoothness of the jaw's share, mm^2, against the trust in a partner at one millimetre.
_SMOOTH = 36.0
# Millimetres: a partner nearer than this is the same place on a faithful copy, and its share is taken as it is.
_SAME = 0.01
# A lip's share, if landmarks tell it.
_LIP_HOLD = 10.0


@dataclass(frozen=True, eq=False)
class JawMotion:
    """``hinge`` (3,), mm; ``axis`` (3,) unit, to the subject's left; ``turn``: degrees for each degree of the
    template's; ``glide`` (3,) mm for each degree; ``size``: millimetres for each of the template's."""

    hinge: NDArray[np.float64]
    axis: NDArray[np.float64]
    turn: float
    glide: NDArray[np.float64]
    size: float

    def movement(self, at: NDArray, jaw: NDArray) -> NDArray[np.float64]:
        """Return how places (n, 3) move for the template's jaw (k, 3): degrees, mm to the side, mm forward."""
        angle = np.radians(jaw[:, 0] * self.turn)[:, None, None]
        d = at - self.hinge
        along = (d @ self.axis)[:, None] * self.axis
        across = d - along
        turned = np.cos(angle) * across + np.sin(angle) * np.cross(self.axis, across)      # Rodrigues
        slide = jaw[:, 1, None] * self.axis * self.size + self.glide * jaw[:, 0, None]
        slide = slide + jaw[:, 2, None] * np.array([0.0, 0.0, 1.0]) * self.size
        return turned - across + slide[:, None, :]


def avatar_jaw(template_hinge: Jaw, template: Mapping[str, NDArray], avatar: Mapping[str, NDArray],
               registered: NDArray, original: NDArray, share: NDArray, *, opening: float = 1.0) -> JawMotion:
    """Return the avatar's jaw.

    template, avatar: landmarks. registered, original (n, 3): the skin in the template's shape and its own; share (n,):
    which of it is jaw. Joints are the landmarks jaw_L and jaw_R if the avatar has them; else what an affine fit of the
    jaw makes of the template's. opening: a factor on how far it turns, for the user.
    """
    given = all(f"jaw_{side}" in points for side in "LR" for points in (template, avatar))
    if given:
        middle = (template["jaw_L"] + template["jaw_R"]) / 2
        axis, across = (points["jaw_L"] - points["jaw_R"] for points in (avatar, template))
        width = np.linalg.norm(axis) / max(np.linalg.norm(across), 1e-9)
        hinge = (avatar["jaw_L"] + avatar["jaw_R"]) / 2 + (template_hinge.hinge - middle) * [0.0, width, width]
        # The template's axis is lateral, whatever its joints' landmarks say: it turns as the line through them does.
        axis = rotation_between(*(way[None] / max(np.linalg.norm(way), 1e-9) for way in (across, axis)))[0, :, 0]
    else:
        weight = share + 1e-3 * share.mean()
        centre_r, centre_o = (np.average(p, axis=0, weights=weight) for p in (registered, original))
        r, o = registered - centre_r, original - centre_o
        ridge = 0.1 * np.average((r**2).sum(axis=1), weights=weight) * weight.sum() / 3
        left = (r * weight[:, None]).T @ r + ridge * np.eye(3)
        affine = np.linalg.solve(left, (r * weight[:, None]).T @ o + ridge * np.eye(3)).T
        hinge = centre_o + affine @ (template_hinge.hinge - centre_r)
        hinge[0] = (avatar["mouth_corner_L"][0] + avatar["mouth_corner_R"][0]) / 2
        axis = np.array([1.0, 0.0, 0.0])
    axis = axis / np.linalg.norm(axis)
    # Along the lips from corner to corner: a muzzle's slit is long though its mouth is narrow from the front.
    seam, seam_t = (_seam(points) for points in (avatar, template))
    length = np.linalg.norm(avatar["mouth_inner_bottom"] - hinge)
    length_t = np.linalg.norm(template["mouth_inner_bottom"] - template_hinge.hinge)
    turn = np.clip(seam / seam_t * length_t / max(length, 1e-9), _LEAST_TURN, _MOST_TURN) * opening
    size = seam / seam_t
    return JawMotion(hinge, axis, float(turn), template_hinge.glide * size * opening, float(size))


def _seam(points: Mapping[str, NDArray]) -> float:
    """Return the length of the lower lip's inner edge, mm, through the landmarks there are."""
    lip = (points["mouth_inner_top"] + points["mouth_inner_bottom"]) / 2
    return max(sum(float(np.linalg.norm(points[f"mouth_corner_{side}"] - lip)) for side in "LR"), 1e-6)


def jaw_share(surface: Surface, feet: Feet, template_faces: NDArray, template_share: NDArray, sides: NDArray,
              places: Mapping[str, tuple[NDArray, NDArray]]) -> NDArray[np.float64]:
    """Return how much of the jaw's motion each vertex (n,) takes, 0 to 1: the template's where they are partners, and
    a smooth continuation elsewhere, such as in a mouth's lining. sides: `side_fields`; the lips' landmarks are held."""
    n = len(surface.vertices)
    carried = np.zeros(n)
    found = feet.found
    carried[found] = (feet.weights[found] * template_share[template_faces[feet.faces[found]]]).sum(axis=1)
    area = np.maximum(surface.vertex_areas, 1e-9)
    trust = np.where(found, area / (feet.distances**2 + _NEAR**2), 0.0)
    hold = _LIP_HOLD * area.mean()
    lips = {name: value for name, value in (("mouth_top", 0.0), ("mouth_bottom", 1.0)) if name in places}
    at = placing(places, list(lips), n)
    firm = np.where(at @ trust > hold, 0.0, hold)           # where there is a partner the template knows the share
    right = trust * carried + at.T @ (firm * np.array(list(lips.values())))
    matrix = (_SMOOTH * surface.bending + 0.05 * surface.stretching + at.T @ (firm[:, None] * at)
              + sparse.diags_array(trust + 1e-6 * area))
    smooth = Factor(matrix, what="the jaw's share of the skin").solve(right)
    same = np.where(found, 1 / (1 + (np.where(found, feet.distances, 0.0) / _SAME) ** 2), 0.0)
    return np.clip(same * carried + (1 - same) * smooth, 0.0, 1.0)
