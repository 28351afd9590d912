"""What no human head may be: told before it is bent into one."""

from __future__ import annotations

import numpy as np

from facegen.adoption.base import Base
from facegen.errors import InputError
from facegen.transfer.apart import Apart

# Millimetres, in the base face's size, that landmarks may be off on average: adults 2 to 4, a baby 7; a cat 12.
_HUMAN = 10.0
# Because people set them on wide smooth places, these say little.
_VAGUE = ("jaw", "temple", "head", "neck")
_LEAST_OPENING = 0.08       # of an eye's width


def check_head(apart: Apart, base: Base) -> None:
    """Raise InputError if a mesh is not one that the base face's regions, lids and jaw can be laid on: no human face,
    closed eyes."""
    points = apart.points
    home = {name: place for name, place in base.landmarks.items() if name in points and not name.startswith(_VAGUE)}
    misfit = np.mean([np.linalg.norm(points[name] - place) for name, place in home.items()])
    if misfit > _HUMAN:
        raise InputError(f"head: this is no human face: laid on an average person's, its landmarks are {misfit:.0f} mm "
                         f"off on average (adults: 2 to 4, a baby: 7, at most {_HUMAN:g}); an animal or a cartoon can "
                         "be given blendshapes instead: facegen rig")
    for side, what in (("L", "left"), ("R", "right")):
        width = np.linalg.norm(points[f"eye_inner_{side}"] - points[f"eye_outer_{side}"])
        gap = np.linalg.norm(points[f"eye_upper_{side}"] - points[f"eye_lower_{side}"])
        if gap < _LEAST_OPENING * width:
            raise InputError(f"head: the {what} eye is closed or has no opening: eye_upper_{side} and eye_lower_{side} "
                             f"are {gap:.2g} mm apart, the corners {width:.2g}; expected a head with open eyes, whose "
                             "lids can be laid on eyeballs")
