"""Landmarks in words, for a person who places them: what each is called, where it is, and what to look at."""

from __future__ import annotations

from dataclasses import dataclass

from facegen.face.landmarks import NAMES, REQUIRED

_SIDES = {"L": "left", "R": "right"}


@dataclass(frozen=True)
class Words:
    """``label``: short; ``part``: a key of `VIEWS`; ``where``: a sentence."""

    label: str
    part: str
    where: str


VIEWS = {"whole": "Whole", "eye_L": "Left eye", "eye_R": "Right eye", "nose": "Nose", "mouth": "Mouth", "jaw": "Jaw"}
"""What can be looked at: key -> label. Left and right are the subject's."""

# Without its side: (label, part, sentence). {side} is left or right, {S} its letter.
_WORDS = {
    "eye_inner": ("Inner corner, {side} eye", "eye_{S}",
        "The inner corner of the subject's {side} eye, beside the nose, where the lids meet."),
    "eye_outer": ("Outer corner, {side} eye", "eye_{S}",
        "The outer corner of the subject's {side} eye, towards the ear, where the lids meet."),
    "eye_upper": ("Upper lid, {side} eye", "eye_{S}",
        "The middle of the subject's {side} upper lid, on its edge over the eye, not on the eyeball."),
    "eye_lower": ("Lower lid, {side} eye", "eye_{S}",
        "The middle of the subject's {side} lower lid, on its edge under the eye, not on the eyeball."),
    "brow_inner": ("Brow beside the nose, {side}", "eye_{S}",
        "The inner end of the subject's {side} brow, beside the nose. Without brows: where it would begin."),
    "brow_mid": ("Middle of the brow, {side}", "eye_{S}",
        "The middle of the subject's {side} brow, over the eye. Without brows: where it would be."),
    "brow_outer": ("Tail of the brow, {side}", "eye_{S}",
        "The outer end of the subject's {side} brow, towards the temple. Without brows: where it would end."),
    "nose_tip": ("Tip of the nose", "nose",
        "The tip of the nose, in the middle, where it comes out farthest."),
    "nose_bridge": ("Bridge of the nose", "nose",
        "The bridge of the nose: in the middle, between the eyes."),
    "nose_wing": ("Wing of the nose, {side}", "nose",
        "The subject's {side} wing of the nose, where the nostril bulges out to the side."),
    "mouth_corner": ("Corner of the mouth, {side}", "mouth",
        "The subject's {side} corner of the mouth, where the lips meet."),
    "mouth_top": ("Upper lip, upper edge", "mouth",
        "The middle of the upper lip's upper edge, where the lip meets the skin."),
    "mouth_inner_top": ("Upper lip, lower edge", "mouth",
        "The middle of the upper lip's lower edge, where the mouth opens. Closed lips: on the line between them, "
        "upper side."),
    "mouth_inner_bottom": ("Lower lip, upper edge", "mouth",
        "The middle of the lower lip's upper edge, where the mouth opens. Closed lips: on the line between them, "
        "lower side."),
    "mouth_bottom": ("Lower lip, lower edge", "mouth",
        "The middle of the lower lip's lower edge, where the lip meets the skin."),
    "chin": ("Chin", "jaw",
        "The tip of the chin, in the middle, where it comes out farthest."),
    "eye_upper_inner": ("Upper lid, inner half, {side}", "eye_{S}",
        "On the edge of the subject's {side} upper lid, half way from its middle to the inner corner."),
    "eye_upper_outer": ("Upper lid, outer half, {side}", "eye_{S}",
        "On the edge of the subject's {side} upper lid, half way from its middle to the outer corner."),
    "eye_lower_inner": ("Lower lid, inner half, {side}", "eye_{S}",
        "On the edge of the subject's {side} lower lid, half way from its middle to the inner corner."),
    "eye_lower_outer": ("Lower lid, outer half, {side}", "eye_{S}",
        "On the edge of the subject's {side} lower lid, half way from its middle to the outer corner."),
    "eye_center": ("Pupil, {side}", "eye_{S}",
        "The pupil of the subject's {side} eye, on the eyeball."),
    "nose_base": ("Base of the nose", "nose",
        "Under the tip of the nose, in the middle, where the nose meets the upper lip."),
    "mouth_upper": ("Upper lip, half way, {side}", "mouth",
        "The upper lip's upper edge, half way from its middle to the subject's {side} corner of the mouth."),
    "mouth_lower": ("Lower lip, half way, {side}", "mouth",
        "The lower lip's lower edge, half way from its middle to the subject's {side} corner of the mouth."),
    "jaw": ("Joint of the jaw, {side}", "jaw",
        "The subject's {side} joint of the jaw, just in front of the ear. An animal's lies far back."),
    "jaw_angle": ("Angle of the jaw, {side}", "jaw",
        "The subject's {side} angle of the jaw, below the ear."),
    "temple": ("Temple, {side}", "whole",
        "The subject's {side} temple, beside the tail of the brow. It keeps still."),
    "head_top": ("Top of the head", "whole",
        "The top of the head. It keeps still."),
    "head_back": ("Back of the head", "whole",
        "The back of the head. It keeps still."),
    "neck": ("Neck", "whole",
        "The front of the neck, in the middle. It keeps still."),
}


def _words(name: str) -> Words:
    base, _, side = name.rpartition("_")
    base, side = (base, side) if side in _SIDES else (name, "")
    return Words(*(text.format(side=_SIDES.get(side, ""), S=side) for text in _WORDS[base]))


WORDS: dict[str, Words] = {name: _words(name) for name in NAMES}
"""Landmark -> its words."""

# Because these few say most of where everything else is; their partners are proposed by mirroring.
_FIRST = ("eye_inner_L", "eye_outer_L", "nose_tip", "mouth_corner_L", "chin", "mouth_top")
_BY_PART = tuple(sorted(REQUIRED, key=lambda name: (list(VIEWS).index(WORDS[name].part), REQUIRED.index(name))))

ORDER: tuple[str, ...] = (*_FIRST, *(name for name in _BY_PART if name not in _FIRST),
                          *(name for name in NAMES if name not in REQUIRED))
"""The order in which points are asked for: what helps most, then part by part, at last the optional ones."""


def partner(name: str) -> str | None:
    """Return the landmark on the other side, if there is one."""
    other = {"_L": "_R", "_R": "_L"}.get(name[-2:])
    return None if other is None else name[:-2] + other
