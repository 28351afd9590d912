"""What a name says of a piece of an avatar: of an object, a node, a material. Evidence, not proof."""

from __future__ import annotations

import re
from itertools import pairwise

KINDS = ("skin", "eye_L", "eye_R", "teeth_upper", "teeth_lower", "tongue", "mouth", "carried", "skull", "body")
"""What a piece may be."""

INSIDE = frozenset({"eye", "teeth", "tongue", "mouth"})
"""Kinds of names of what lies behind lids and lips."""

_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]+")
# Read in this order: an "eyelash" is no eye, a "brow" of the "hair" material is a brow, a "mouth_teeth" is teeth.
_MEANINGS: tuple[tuple[str, frozenset[str]], ...] = (
    ("skin", frozenset({"eyelid", "eyelids", "lid", "lids", "lip", "lips"})),
    ("carried", frozenset({"lash", "lashes", "eyelash", "eyelashes", "cilia", "brow", "brows", "eyebrow", "eyebrows",
                           "moustache", "mustache", "beard", "goatee", "whisker", "whiskers", "tear", "tears",
                           "tearline", "occlusion", "eyeline", "eyeliner", "stubble"})),
    ("skull", frozenset({"glasses", "spectacles", "goggles", "eyewear", "hat", "cap", "helmet", "hood", "hair",
                         "hairs", "fringe", "bangs", "ponytail", "scalp", "ear", "ears", "horn", "horns", "antenna",
                         "headband", "earring", "earrings", "mane", "forelock", "headphones"})),
    ("teeth", frozenset({"tooth", "teeth", "gum", "gums", "denture", "dentures", "fang", "fangs", "molar", "molars",
                         "incisor", "incisors"})),
    ("tongue", frozenset({"tongue"})),
    ("eye", frozenset({"eye", "eyes", "eyeball", "eyeballs", "cornea", "sclera", "iris", "irises", "pupil", "pupils",
                       "eyewhite", "limbus", "highlight", "highlights", "catchlight"})),
    ("body", frozenset({"body", "torso", "cloth", "clothes", "clothing", "shirt", "suit", "dress", "jacket", "coat",
                        "collar", "tie", "scarf", "hand", "hands", "arm", "arms", "leg", "legs", "foot", "feet",
                        "shoe", "shoes", "tops", "bottoms", "onepiece", "tail"})),
    ("mouth", frozenset({"mouth", "oral", "palate", "cavity", "throat"})),
    ("skin", frozenset({"skin", "face", "head"})),
)
_UPPER = frozenset({"upper", "up", "top", "maxilla", "maxillary"})
_LOWER = frozenset({"lower", "low", "down", "bottom", "mandible", "mandibular", "jaw"})


def words_of(name: str) -> frozenset[str]:
    """Return the words of a name in small letters: "EyeBall_L.001" has eye, ball, eyeball, l."""
    found = [word.lower() for word in _WORDS.findall(name) if not word.isdigit()]
    return frozenset(found) | {a + b for a, b in pairwise(found)}


def kind_of_name(name: str) -> str:
    """Return what a name says: a kind, "eye" or "teeth" without side or row, or nothing."""
    words = words_of(name)
    return next((kind for kind, meaning in _MEANINGS if words & meaning), "")


def row_of_name(name: str) -> str:
    """Return "upper" or "lower" if a name says so, else nothing."""
    words = words_of(name)
    upper, lower = bool(words & _UPPER), bool(words & _LOWER)
    return "" if upper == lower else "upper" if upper else "lower"
