"""Proposed landmarks as a file that `facegen rig` takes, with what was known as it was written and the confidences."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.textfile import save_text
from facegen.landmarking.proposals import Proposals

# Decimals of barycentric weights: a ten-thousandth of a triangle's side would do.
_DECIMALS = 6
# An optional landmark less sure than this is left out: a rig goes without it.
WORTH = 0.5


def save_landmarks(found: Proposals, path: Path, mesh_name: str, entries: Mapping[str, Any] | None = None) -> Path:
    """Write landmarks and return the path; the file appears whole or not at all.

    entries: how known places stand in the file they came from: they are written as they are. Raises FileError.
    """
    return save_text(landmarks_text(found, mesh_name, entries or {}), path)


def landmarks_text(found: Proposals, mesh_name: str, entries: Mapping[str, Any]) -> str:
    """Return the text of a landmark file."""
    shown = {name: one for name, one in found.items() if one.given or found.is_worth(name, WORTH)}
    lines = [f"# Landmarks of {mesh_name}, proposed by facegen. Left and right are the subject's.",
             "# Look at each before you rely on it; how sure it is stands below, 1 for those that were given.",
             f"mesh: {json.dumps(mesh_name, ensure_ascii=False)}", "landmarks:"]
    for name, one in shown.items():
        place = entries.get(name, {"face": int(one.face), "barycentric": _rounded(one.barycentric)})
        lines.append(f"  {name}: {_plain(place)}")
    lines.append("confidence:")
    lines += [f"  {name}: {one.confidence:.2f}" for name, one in shown.items()]
    return "\n".join(lines) + "\n"


def _rounded(weights: NDArray) -> list[float]:
    """Return three weights with few decimals that sum to one."""
    short = np.round(np.clip(weights, 0.0, 1.0), _DECIMALS)
    largest = int(short.argmax())
    short[largest] = np.round(1.0 - (short.sum() - short[largest]), _DECIMALS)
    return [float(one) for one in short]


def _plain(value: Any) -> str:
    """Return a value as YAML on one line. YAML reads 1e-07 as text, and 1.0e-07 as a number."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_plain(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_plain, value)) + "]"
    if isinstance(value, float):
        return re.sub(r"^(-?\d+)e", r"\1.0e", repr(value))
    return json.dumps(value, ensure_ascii=False)
