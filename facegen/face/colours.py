"""The colours of what faces are made of: sRGB 0..255, before any light. How it shines is the renderer's to know."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

Colour = tuple[float, float, float]

COLOURS: Mapping[str, Colour] = MappingProxyType({
    "skin": (224, 174, 148),
    "nostril": (134, 82, 68),
    "lips": (190, 104, 98),
    "brows": (78, 52, 36),
    "lashes": (62, 38, 30),
    "hair": (74, 49, 34),
    "sclera": (230, 225, 220),
    "iris": (98, 72, 48),
    "limbus": (60, 44, 32),
    "pupil": (16, 12, 11),
    "teeth": (242, 231, 213),
    "gums": (176, 92, 88),
    "tongue": (186, 96, 92),
    "mouth": (92, 34, 30),
})

CLAY: Colour = (200, 190, 180)
"""Of a material that is not known."""
