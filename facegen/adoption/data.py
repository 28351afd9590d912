"""A person's ``face.yaml``: the base face's, with the places, the lengths and the parts of the person."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.adoption.base import Base
from facegen.adoption.parts import TEETH, Eyes
from facegen.adoption.shape import Shape
from facegen.adoption.space import Space
from facegen.transfer.alignment import Similarity

Array = NDArray[np.float64]

_DECIMALS = 3       # micrometres
# Brows that lie nearer together than the base face's come together by less: what they moved by beyond that would fold
# the skin between them into a slit.
_BROWS, _ABOVE_THE_NOSE = "brow_room", ("brow_", "forehead_")


def face_data(base: Base, shape: Shape, space: Space, eyes: Eyes, bite: Similarity, *, name: str, source: str,
              parts: list[dict[str, Any]], landmarks: bool = True) -> dict[str, Any]:
    """Return what a person's face.yaml says, in the base face's order.

    parts: the entries of the key ``parts``. Indices of vertices, regions, sheets and lids stay the base face's.
    """
    old = base.data
    data = dict(old)
    measures, ratios = _measures(base, shape, eyes)
    data |= {"name": name, "source": source, "cage": "cage.obj", "surface": "surface.obj",
             "centre_O": _row(space(old["centre_O"])), "parts": parts,
             "measures": {**measures, _BROWS: _brow_room(base, shape, ratios)},
             "scales": {**old["scales"], _BROWS: [_BROWS, *old["scales"]["upper"][1:]]}}
    data["points"] = {key: _point(one, space, bite) | ({"scale": _BROWS} if key.startswith(_ABOVE_THE_NOSE) else {})
                      for key, one in old["points"].items()}
    hinge = space(old["jaw"]["hinge"])
    data["jaw"] = {**old["jaw"], "hinge": _row(hinge),
                   "glide": _row(np.array(old["jaw"]["glide"]) * ratios["mouth_width"])}
    data["eyes"] = {side: _row(centre) for side, centre in zip("LR", eyes.centres, strict=True)}
    data["eye_size"] = round(eyes.size, 4)
    # A lid's travel is a share of the opening: over a smaller one the same turn of the ball is a larger share.
    follow = eyes.size / ratios["eye_opening"]
    data["lid_follow"] = {key: [round(x * follow, 5) for x in row] for key, row in old["lid_follow"].items()}
    data["head"] = {key: _row(space(place)) for key, place in old["head"].items()}
    data["head_half_height"] = round(float(old["head_half_height"] * np.ptp(shape.cage[:, 1])
                                           / np.ptp(base.cage.vertices[:, 1])), _DECIMALS)
    data["folds"] = {key: _fold(one, space, shape.scale) for key, one in old["folds"].items()}
    order = [*old, "surface", "eye_size"]
    order.insert(order.index("cage") + 1, order.pop(order.index("surface")))
    order.insert(order.index("eyes") + 1, order.pop(order.index("eye_size")))
    return {key: data[key] for key in order}


def landmark_data(base: Base, entries: Mapping[str, Any], space: Space, parts: Mapping[str, Array], eyes: Eyes,
                  own: Mapping[str, Array]) -> dict[str, Any]:
    """Return the entries of a person's landmarks.yaml.

    entries: the base face's. parts: name -> vertices (p, 3) of the person's. own: landmark -> place (3,) on the
    person's head, taken for those that lie on parts.
    """
    result = {}
    for name, entry in entries.items():
        if not isinstance(entry, dict) or "at" not in entry:
            result[name] = entry
        elif entry["part"].startswith("eye_"):
            side = entry["part"][-1]
            home = np.array(base.data["eyes"][side])
            at = eyes.centres["LR".index(side)] + eyes.size * (np.array(entry["at"]) - home)
            result[name] = {**entry, "at": _row(at)}
        elif entry["part"] in parts:
            result[name] = {**entry, "at": _row(own.get(name, space(entry["at"])))}
    return result


def _measures(base: Base, shape: Shape, eyes: Eyes) -> tuple[dict[str, float], dict[str, float]]:
    """Return the person's measures, mm, and how many times the base face's they are."""
    names = {"nose": "nose_base", "lip": "lip_upper", "left": "mouth_corner_L", "right": "mouth_corner_R"}
    homes = np.array([base.data["eyes"][side] for side in "LR"])

    def lengths(cage: Array, centres: Array) -> dict[str, float]:
        at = {key: cage[base.point(name)] for key, name in names.items()}
        gaps = [np.linalg.norm(cage[base.point(f"lid_upper_{k}_{s}")] - cage[base.point(f"lid_lower_{k}_{s}")])
                for s in "LR" for k in ("mid", "outer_mid")]
        return {"eye_separation": float(np.linalg.norm(centres[0] - centres[1])),
                "eye_nose": float(np.linalg.norm(centres.mean(axis=0)[1:] - at["nose"][1:])),
                "mouth_nose": float(np.linalg.norm(at["nose"] - at["lip"])),
                "mouth_width": float(np.linalg.norm(at["left"] - at["right"])), "eye_opening": float(np.mean(gaps))}

    before, after = lengths(base.cage.vertices, homes), lengths(shape.cage, eyes.centres)
    ratios = {key: after[key] / before[key] for key in before}
    return {key: round(value * ratios[key], _DECIMALS) for key, value in base.data["measures"].items()}, ratios


def _brow_room(base: Base, shape: Shape, ratios: Mapping[str, float]) -> float:
    """Return what the eyes' separation, to which brows refer their movement aside, is for brows, mm."""
    gap, room = (float(np.linalg.norm(cage[base.point("brow_inner_L")] - cage[base.point("brow_inner_R")]))
                 for cage in (base.cage.vertices, shape.cage))
    return round(base.data["measures"]["eye_separation"] * min(room / gap, ratios["eye_separation"]), _DECIMALS)


def _point(entry: dict[str, Any], space: Space, bite: Similarity) -> dict[str, Any]:
    if "at" not in entry:
        return entry
    carry = bite.apply if entry.get("part") in TEETH else space
    return {**entry, "at": _row(carry(np.array(entry["at"], float)))}


def _fold(entry: dict[str, Any], space: Space, scale: float) -> dict[str, Any]:
    sized = {key: round(entry[key] * scale, _DECIMALS) for key in ("width", "depth", "ridge")}
    return {**entry, "along": [_row(place) for place in space(entry["along"])], **sized}


def _row(place: Array) -> list[float]:
    return (np.round(place, _DECIMALS) + 0.0).tolist()
