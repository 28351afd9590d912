"""Expressions of VRM avatars as weights of morph targets.

VRM Consortium, "VRMC_vrm-1.0", expressions: each preset or custom expression binds targets of nodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from facegen.errors import InputError, nearest

PRESETS = ("happy", "angry", "sad", "relaxed", "surprised", "neutral", "aa", "ih", "ou", "ee", "oh", "blink",
           "blinkLeft", "blinkRight", "lookUp", "lookDown", "lookLeft", "lookRight")
_BINDS = ("morphTargetBinds", "materialColorBinds", "textureTransformBinds")
_MARK = {"facegen": True}


def is_vrm(found: Mapping[str, Any]) -> bool:
    """Return whether a glTF file's JSON says that it is a VRM 1.0 avatar."""
    extensions = found.get("extensions")
    return isinstance(extensions, dict) and isinstance(extensions.get("VRMC_vrm"), dict)


def is_vrm0(found: Mapping[str, Any]) -> bool:
    """Return whether a glTF file's JSON says that it is a VRM 0.x avatar. Such avatars look to -z."""
    extensions = found.get("extensions")
    return isinstance(extensions, Mapping) and "VRM" in extensions


def check_expressions(expressions: Mapping[str, Mapping[str, float]], shapes: Sequence[str]) -> None:
    """Raise InputError for a weight that is none or a shape that is not there."""
    for name, weights in expressions.items():
        if not isinstance(name, str) or not name or not isinstance(weights, Mapping):
            raise InputError(f"expressions: expected a name and the weights of shapes, got {name!r}: {weights!r}")
        for shape, weight in weights.items():
            if shape not in shapes:
                raise InputError(f"expressions: '{name}' uses the shape {shape!r}, which is not among the shapes"
                                 f"{nearest(shape, shapes)}")
            if isinstance(weight, bool) or not isinstance(weight, (int, float)) or not 0.0 <= weight <= 1.0:
                raise InputError(f"expressions: the weight of '{shape}' in '{name}' must be 0..1, got {weight!r}")


def add_expressions(found: dict[str, Any], expressions: Mapping[str, Mapping[str, float]],
                    places: Mapping[str, Sequence[tuple[int, int]]]) -> None:
    """Write expressions into a VRM's JSON. places: shape -> (node, target index) of all meshes that have it.

    An expression that the avatar's author bound to something stays as it is; an empty one and ours are filled.
    """
    if not is_vrm(found) or not expressions:
        return
    vrm = found["extensions"]["VRMC_vrm"]
    groups = vrm.get("expressions") if isinstance(vrm.get("expressions"), dict) else {}
    vrm["expressions"] = groups
    for name, weights in expressions.items():
        kind = "preset" if name in PRESETS else "custom"
        group = groups.get(kind) if isinstance(groups.get(kind), dict) else {}
        groups[kind] = group
        old = group.get(name) if isinstance(group.get(name), dict) else {}
        if any(old.get(key) for key in _BINDS) and not _is_ours(old):
            continue
        extras = old.get("extras") if isinstance(old.get("extras"), dict) else {}
        binds = [{"node": node, "index": index, "weight": float(weight)} for shape, weight in weights.items()
                 if weight > 0 for node, index in places[shape]]
        defaults = {"isBinary": False, "overrideBlink": "none", "overrideLookAt": "none", "overrideMouth": "none"}
        group[name] = {**defaults, **old, "morphTargetBinds": binds, "extras": {**extras, **_MARK}}


def _is_ours(expression: Mapping[str, Any]) -> bool:
    extras = expression.get("extras")
    return isinstance(extras, dict) and extras.get("facegen") is True
