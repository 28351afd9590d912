"""What to tell a person who sets landmarks: that no face was recognised, and what is odd about known places."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.mesh import Mesh
from facegen.landmarking.confidence import ENOUGH_TO_START, RECOGNISED
from facegen.landmarking.proposals import ASKED, Proposal
from facegen.transfer.landmark_checks import place_faults

# A known place this far from where a recognised face has it, in distances between the outer corners of the eyes, is
# astray.
_ASTRAY = 0.3


def not_recognised(face: float, given: Mapping[str, Proposal]) -> list[str]:
    """Return a warning if no face was recognised (``face``: how surely), with how many places to set."""
    more = ENOUGH_TO_START - len([name for name in given if name in ASKED])
    if face >= RECOGNISED or more <= 0:
        return []
    missing = [name for name in ASKED if name not in given][:more]
    return [f"no human face was recognised: the places are guesses; set {more} more, best {', '.join(missing)}, and "
            "the others are proposed from those"]


def odd_places(given: Mapping[str, Proposal], mesh: Mesh, where: Mapping[str, NDArray] | None
               ) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what must be wrong about known places and what is odd, a sentence each: see `place_faults`, and what lies
    astray.

    where: name -> place (3,) where a face was recognised without them, or None.
    """
    if not given:
        return (), ()
    faces = np.array([one.face for one in given.values()], np.int64)
    weights = np.array([one.barycentric for one in given.values()])
    errors, warnings = place_faults(tuple(given), mesh.faces[faces].astype(np.int64), weights, mesh)
    if not errors and where is not None:
        warnings = [*_astray(given, where), *warnings]
    return tuple(errors), tuple(warnings)


def _astray(given: Mapping[str, Proposal], where: Mapping[str, NDArray]) -> list[str]:
    """Return which known places lie where a recognised face has another one, or none."""
    unit = float(np.linalg.norm(where["eye_outer_L"] - where["eye_outer_R"]))
    result = []
    for name, one in given.items():
        if name not in where:
            continue
        off = {other: float(np.linalg.norm(one.xyz - place)) / unit for other, place in where.items()}
        if off[name] < _ASTRAY:
            continue
        near = min(off, key=off.get)
        partner = f"{name[:-2]}_{'R' if name.endswith('L') else 'L'}"
        if name.endswith(("_L", "_R")) and off[partner] < 0.5 * off[name]:
            result.append(f"'{name}' lies on the side of '{partner}': _L is the subject's own left, on the right of a "
                          "picture of the face")
        elif off[near] < 0.5 * _ASTRAY:
            result.append(f"'{name}' lies where '{near}' seems to be; is that meant?")
        else:
            result.append(f"'{name}' lies far from where it seems to be; is that meant?")
    return result
