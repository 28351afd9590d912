"""What no human head may be: told before it is bent into one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from facegen.adoption.base import Base
from facegen.errors import InputError
from facegen.transfer.alignment import align
from facegen.transfer.apart import Apart

# Millimetres, in the base face's size, that a landmark may be off on average: people 3 to 6, animals 15 and more.
_HUMAN = 10.0
_LEAST_OPENING = 0.08       # of an eye's width


def check_head(apart: Apart, places: Mapping[str, tuple[NDArray, NDArray]], base: Base) -> None:
    """Raise InputError if a mesh is not one that the base face's regions, lids and jaw can be laid on: no human face,
    closed eyes."""
    points = apart.points
    common = [name for name in base.landmarks if name in points and not name.startswith(("jaw", "temple", "head", "neck"))]
    misfit = np.mean([np.linalg.norm(points[name] - base.landmarks[name]) for name in common])
    if misfit > _HUMAN:
        raise InputError(f"head: this is no human face: its landmarks are {misfit:.0f} mm from an average person's when "
                         f"both are laid on each other (people: 3 to 6, at most {_HUMAN:g}); an animal or a cartoon can be "
                         "given blendshapes instead: facegen rig")
    for side, what in (("L", "left"), ("R", "right")):
        width = np.linalg.norm(points[f"eye_inner_{side}"] - points[f"eye_outer_{side}"])
        gap = np.linalg.norm(points[f"eye_upper_{side}"] - points[f"eye_lower_{side}"])
        if gap < _LEAST_OPENING * width:
            raise InputError(f"head: the {what} eye is closed or has no opening: eye_upper_{side} and eye_lower_{side} are "
                             f"{gap:.2g} mm apart, the corners {width:.2g}; expected a head with open eyes, whose lids "
                             "can be laid on eyeballs")
