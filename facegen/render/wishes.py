"""What a view, a size and a background look like as text, on a command line or in a file."""

from __future__ import annotations

import re

from facegen.errors import InputError


def parse_view(text: str) -> tuple[float, float]:
    """Return "30,-10" as (yaw, pitch) in degrees; one number alone is the yaw."""
    parts = text.split(",")
    try:
        angles = [float(part) for part in parts]
    except ValueError:
        angles = []
    if not 1 <= len(angles) <= 2:
        raise InputError(f"view: expected YAW,PITCH in degrees such as 30,0, got '{text}'")
    return angles[0], angles[1] if len(angles) == 2 else 0.0


def parse_size(text: str) -> tuple[int, int]:
    """Return "512" or "640x480" as (width, height) in pixels."""
    found = re.fullmatch(r"([0-9]{1,6})(?:[xX×]([0-9]{1,6}))?", text.strip(), re.ASCII)
    if not found:
        raise InputError(f"size: expected pixels such as 512 or 640x480, got '{text}'")
    return int(found[1]), int(found[2] or found[1])


def parse_background(text: str) -> str | tuple[int, ...]:
    """Return "plain", "transparent", or "#aabbcc" and "170,187,204" as (r, g, b)."""
    if re.fullmatch("#[0-9a-fA-F]{6}", text):
        return tuple(bytes.fromhex(text[1:]))
    if re.fullmatch("[0-9]{1,6}(,[0-9]{1,6}){2}", text, re.ASCII):
        return tuple(int(part) for part in text.split(","))
    if text not in ("plain", "transparent"):
        raise InputError(f"background: expected plain, transparent, #rrggbb or r,g,b, got '{text}'")
    return text
