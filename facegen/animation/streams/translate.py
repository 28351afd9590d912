"""A whole performance in another vocabulary.

Head and eyes go as angles where both vocabularies have them: units 51 to 56 are the head's yaw, pitch and roll, units
61 to 66 and ARKit's eyeLook shapes are the gaze. All else goes by `facegen.face.convert_many`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from facegen.animation.angles import reach
from facegen.animation.performance import VOCABULARIES, Performance
from facegen.animation.streams import looks
from facegen.blendshapes.recipes import SETS
from facegen.errors import InputError, nearest
from facegen.face.convert_many import convert_many

Array = NDArray[np.float64]

SAID = 0.005
"""A conversion that loses less than this share of the movement is not worth a word."""

_EYES = {"arkit": looks.SHAPES, "units": looks.UNITS}
_HEAD = (("51", "52", "yaw"), ("53", "54", "pitch"), ("55", "56", "roll"))
_TURNS = tuple(unit for plus, minus, _ in _HEAD for unit in (plus, minus))


def translated(one: Performance, vocabulary: str) -> Performance:
    """Return a performance in another vocabulary: "units", "expressions", "arkit", "visemes" or "vrm".

    ``about["residual"]`` is the share of the movement that is lost, of the whole recording; a warning says more.
    Weights outside 0..1 are cut, and told. Frames without any weight stay without; the same vocabulary comes back as it
    is. InputError for an unknown vocabulary, and for "shapes": those of one rig's file mean nothing elsewhere.
    """
    if vocabulary not in SETS:
        raise InputError(f"vocabulary: expected {', '.join(SETS)}, got {vocabulary!r}{nearest(str(vocabulary), SETS)}")
    if one.vocabulary == vocabulary:
        return one
    if one.vocabulary == "shapes":
        raise InputError(f"vocabulary: the performance's shapes ({', '.join(one.names[:3])} ...) are those of one rig; "
                         f"only {', '.join(VOCABULARIES[:-1])} can be converted")
    said = []
    beyond = np.nansum((one.weights < 0.0) | (one.weights > 1.0))
    if beyond:
        said.append(f"{int(beyond)} weights outside 0..1 were cut")
    found = one.found
    weights = np.clip(np.nan_to_num(one.weights[found]), 0.0, 1.0)
    head = one.head if one.vocabulary != "units" else _head(one)
    aside = set(_TURNS) if one.vocabulary == "units" else set()
    eyes: dict[str, Array] = {}
    if vocabulary in _EYES and one.vocabulary in _EYES:
        aside |= set(_EYES[one.vocabulary])
        looking = looks.turned_by(one)
        looking = looking if looking is not None else one.gaze
        if looking is not None:
            eyes = {name: column[found] for name, column in
                    (looks.shapes_of if vocabulary == "arkit" else looks.units_of)(looking).items()}
    kept = [k for k, name in enumerate(one.names) if name not in aside]
    made = convert_many([one.names[k] for k in kept], weights[:, kept], one.vocabulary, vocabulary)
    if made.left_out:
        said.append(f"units of the head are no shapes, and left out: {', '.join(made.left_out)}")
    if made.lost >= SAID:
        said.append(f"{one.vocabulary} to {vocabulary}: {100 * made.lost:.1f} % of the movement is lost"
                    + _which([one.names[k] for k in kept], weights[:, kept], one.vocabulary, vocabulary))
    columns = dict(zip(made.names, made.weights.T, strict=True)) | {
        name: column for name, column in eyes.items() if np.nan_to_num(column).any()}
    result = np.full((len(one), len(columns)), np.nan)
    if columns:
        result[found] = np.column_stack(list(columns.values()))
    residual = max(made.lost, float(one.about.get("residual", 0.0)))
    return replace(one, names=tuple(columns), weights=result, vocabulary=vocabulary, head=head,
                   about={**one.about, "residual": f"{residual:.6f}"}, warnings=(*one.warnings, *said))


def _which(names: list[str], weights: Array, source: str, target: str) -> str:
    """Return in words which names lose most, each by itself and as much as it is used."""
    alone = convert_many(names, np.eye(len(names)), source, target).residual
    used = alone * weights.mean(axis=0)
    most = [names[k] for k in np.argsort(-used, kind="stable")[:3] if used[k] > 0.1 * used.sum()]
    return f", most of it of {', '.join(most)}" if most else ""


def _head(one: Performance) -> Array | None:
    """Return the head's turn: as recorded, else by its units."""
    if one.head is not None or not set(_TURNS) & set(one.names):
        return one.head
    nothing = np.where(one.found, 0.0, np.nan)
    turns = []
    for plus, minus, axis in _HEAD:
        up, down = reach("head", axis)
        turns.append((one.column(plus) if plus in one.names else nothing) * up
                     - (one.column(minus) if minus in one.names else nothing) * down)
    return np.column_stack(turns)
