"""From the face that a page shows to a key of a clip, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from facegen.errors import InputError
from facegen.facs.deformation import Deformation, weighted_sum
from facegen.facs.expressions import resolve
from facegen.facs.notation import canonical
from facegen.facs.units import split_code
from facegen.facs.yamlfile import parse_yaml
from facegen.studio import script_text
from facegen.studio.page import Page
from facegen.studio.work import FaceWork

_EYES = {str(number) for number in range(61, 67)}       # units that turn the eyes


def face_key(page: Page) -> dict[str, Any]:
    """Return what a key of the page's face as it is now shows: pose, raw, intensity as a script has them.

    Eyes that look at a point are turned as they are now: a key knows no point.
    """
    face = page.work.face
    if not face.gaze:
        made: dict[str, Any] = {"pose": face.script}
        if face.raw:
            made["raw"] = dict(face.raw)
        return made if face.intensity == 1.0 else {**made, "intensity": round(face.intensity, 3)}
    meaning = page.meaning()
    units = {code: weight for code, weight in meaning.units.items() if split_code(code)[1] not in _EYES}
    raw = [one for one in meaning.more if one]
    return {"pose": canonical(units), **({"raw": weighted_sum([(1.0, one) for one in raw]).as_dict()} if raw else {})}


def key_face(item: Mapping[str, Any], face: FaceWork, default: str | None = None) -> FaceWork:
    """Return a face that shows what a key shows, to be changed by hand. default: the pose of an event's kind.

    InputError for one that turns the head or the eyes by angles, which no slider shows.
    """
    if "head" in item or "eyes" in item:
        raise InputError("this key turns the head or the eyes by degrees, which the Face tab does not show; change it "
                         "in the script")
    found = resolve(_text(item.get("pose", default or "neutral")))
    raw = deformation_data(item, found.deformation if not found.units else None)
    return replace(face, units=dict(found.units), blend={}, gaze={}, raw=raw,
                   intensity=float(item.get("intensity", 1.0)))


def deformation_data(item: Mapping[str, Any], pose: Deformation | None) -> Mapping[str, Any]:
    """Return the raw data of a key, its pose's own if that is no units."""
    if "raw" in item:
        return dict(item["raw"])
    return pose.as_dict() if pose else {}


def read_pose(text: str) -> str | dict[str, Any]:
    """Return the pose that a text says: a name, a FACS script, or a mapping in YAML; InputError."""
    if not text.strip():
        raise InputError("pose: expected an expression's name or a FACS script such as 6C+12D, got nothing")
    data = parse_yaml(text, "pose") if text.strip().startswith("{") else text.strip()
    return data if isinstance(data, (str, dict)) else str(data)


def write_pose(pose: object) -> str:
    """Return a pose as the text that `read_pose` reads."""
    return script_text.flow(pose) if isinstance(pose, Mapping) else "" if pose is None else str(pose)


def _text(pose: object) -> Any:
    return str(pose) if type(pose) is int else pose
