"""A clip's script as text, as a person writes it: YAML, a key or an event a line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from facegen.errors import TableError
from facegen.facs.yamlfile import parse_yaml

SOURCE = "script"
"""What errors call the text."""

_LISTS = ("keyframes", "events")


def write(script: Mapping[str, Any]) -> str:
    """Return a script as YAML that `read` makes the same data of; "" for an empty one."""
    lines: list[str] = []
    for key, value in script.items():
        if key in _LISTS:
            lines += [f"{key}:", *(f"  - {flow(one)}" for one in value)]
        elif key == "tracks":
            lines.append("tracks:")
            for track in value:
                lines += _track(track)
        else:
            lines.append(f"{key}: {flow(value)}")
    return "\n".join(lines) + "\n" if lines else ""


def read(text: str) -> dict[str, Any]:
    """Return the script of a text; TableError, with the line, for what is no YAML mapping."""
    if not text.strip():
        return {}
    data = parse_yaml(text, SOURCE)
    if not isinstance(data, dict):
        raise TableError(f"{SOURCE}: expected a mapping such as keyframes: [...], got {type(data).__name__}")
    return data


def _track(track: Mapping[str, Any]) -> list[str]:
    lines = []
    for key, value in track.items():
        start = "  - " if not lines else "    "
        if key in _LISTS:
            lines += [f"{start}{key}:", *(f"      - {flow(one)}" for one in value)]
        else:
            lines.append(f"{start}{key}: {flow(value)}")
    return lines


def flow(value: Any) -> str:
    """Return plain data as YAML on one line."""
    import yaml

    # No line is broken: one key, one line.
    text = yaml.safe_dump(value, default_flow_style=True, width=10**6, sort_keys=False, allow_unicode=True).strip()
    return text.removesuffix("...").strip()
