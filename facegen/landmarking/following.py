"""Where places follow from known ones: conditional means of a Gaussian process over the face.

What a face departs from another by is taken as a smooth random field (M. Luethi, T. Gerig, C. Jud, T. Vetter,
"Gaussian Process Morphable Models", 2018): its mean given some places moves the others, and its variance says how sure
they are. Between heads of different kinds that is a stretch of the whole, of the muzzle by itself, and bending; beside
a face that was laid on the mesh it is only what the laying missed, which hardly reaches from one place to the next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Between kinds of heads, mm of the base face: everything moves by so much, bends by so much over a head's size, and by
# so much from one part to the next; and shares by which the whole, and the muzzle beside that, stretch. Measured on
# the shipped animals, the people and a panda; twice or half of each makes little difference.
_MOVES, _BENDS, _HEAD, _PARTS, _PART = 30.0, 8.0, 80.0, 5.0, 12.0
_STRETCHES, _MUZZLE = 0.3, 0.2
# What the laying missed, mm: of what was seen and of what was only laid, and how far that reaches. Because at 10 mm
# and more some places got worse by clicks on others, over the heads of benchmarks/landmarks.py.
_SEEN, _LAID, _REACH = 1.2, 4.0, 8.0
# How much of that is the same on both sides.
_BOTH = 0.6
# How near a click is to what is meant, mm.
CLICK = 0.7

_MUZZLE_PARTS = ("nose_tip", "nose_wing", "nose_base", "mouth", "chin")


def follow_kinds(rest: Mapping[str, Array], known: Mapping[str, tuple[Array, float]]
                 ) -> tuple[dict[str, Array], dict[str, float]]:
    """Return places of all of the base face's landmarks on another kind of head, and their deviations, mm.

    rest: name -> place (3,) on the base face. known: name -> (place (3,) in the base face's frame, deviation mm).
    """
    names = [name for name in known if name in rest]
    x, p = np.array(list(rest.values())), np.array([rest[name] for name in names])
    off = np.array([known[name][0] for name in names]) - p
    of_x, of_p = _of_muzzle(list(rest)), _of_muzzle(names)
    whole = rest["nose_bridge"]
    muzzle = x[of_x > 0].mean(axis=0)

    def kernel(a: Array, b: Array, of_a: Array, of_b: Array) -> Array:
        square = ((a[:, None] - b[None]) ** 2).sum(axis=2)
        return (_MOVES**2 + _BENDS**2 * np.exp(-square / (2 * _HEAD**2)) + _PARTS**2 * np.exp(-square / (2 * _PART**2))
                + _STRETCHES**2 * (a - whole) @ (b - whole).T
                + _MUZZLE**2 * of_a[:, None] * of_b * ((a - muzzle) @ (b - muzzle).T))

    across = kernel(x, p, of_x, of_p)
    within = kernel(p, p, of_p, of_p) + np.diag([known[name][1] ** 2 for name in names])
    moved = x + across @ np.linalg.solve(within, off)
    left = kernel(x, x, of_x, of_x).diagonal() - (across * np.linalg.solve(within, across.T).T).sum(axis=1)
    return dict(zip(rest, moved, strict=True)), dict(zip(rest, np.sqrt(left.clip(1e-6)), strict=True))


def follow_laid(laid: Mapping[str, Array], rest: Mapping[str, Array], seen: Sequence[str], known: Mapping[str, Array]
                ) -> dict[str, Array]:
    """Return places of a laid face, moved beside known ones. laid, known: name -> place (3,) in the base face's frame;
    rest: the base face's own, by which places are near to each other; seen: what was more than laid."""
    names, rows = list(laid), [list(laid).index(name) for name in known if name in laid]
    if not rows:
        return dict(laid)
    places, own = np.array(list(laid.values())), np.array([rest[name] for name in names])
    deviation = np.array([_SEEN if name in seen else _LAID for name in names])
    mirror = [names.index(other) if other in laid else i for i, other in enumerate(map(partner, names))]
    near = np.exp(-((own[:, None] - own[None]) ** 2).sum(axis=2) / (2 * _REACH**2))
    moved = places.copy()
    for axis, sign in enumerate((-1.0, 1.0, 1.0)):
        kernel = deviation[:, None] * deviation * (near + sign * _BOTH * near[:, mirror])
        off = np.array([known[names[i]][axis] for i in rows]) - places[rows, axis]
        within = kernel[np.ix_(rows, rows)] + CLICK**2 * np.eye(len(rows))
        moved[:, axis] += kernel[:, rows] @ np.linalg.solve(within, off)
    return dict(zip(names, moved, strict=True))


def partner(name: str) -> str:
    """Return the name of a landmark's mirror image: its own for one in the middle."""
    return f"{name[:-1]}{'R' if name[-1] == 'L' else 'L'}" if name.endswith(("_L", "_R")) else name


def _of_muzzle(names: Sequence[str]) -> Array:
    return np.array([float(name.startswith(_MUZZLE_PARTS)) for name in names])
