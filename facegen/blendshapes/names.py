"""Names of shapes in files, and what other people's names mean.

Our own: ``AU12_L`` for the atom L12, ``AU17``, ``AU22_T`` for T22, ``AU1+4_L`` for a corrective; an expression by its
name in the table; the other sets as their owners write them (`jawOpen`, `viseme_PP`, `happy`). Others write
``eyeBlink_L``, ``EyeBlinkLeft``, ``A14_Eye_Blink_Left`` or ``Head.eyeBlinkLeft``: all the same shape.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from facegen.facs.units import split_code

_UNIT = re.compile(r"AU0*([0-9]+(?:[+-][0-9]+)*)(?:_([LRTB]))?", re.ASCII)
_OWNER = re.compile(r"^.*[.:|/]")               # Head.jawOpen, blendShape1:jawOpen
_NUMBERED = re.compile(r"^[A-Za-z][0-9]{2}_")   # A14_Eye_Blink_Left
_SIDES = {"left": "l", "right": "r"}


def shape_of(member: str) -> str:
    """Return the name in files of a member of the unit table's basis.

    >>> shape_of("L12"), shape_of("17"), shape_of("1+4:L")
    ('AU12_L', 'AU17', 'AU1+4_L')
    """
    name, _, place = member.partition(":")
    if not place and name[0] in "LRTB":
        place, name = split_code(name)
    return f"AU{name}_{place}" if place else f"AU{name}"


def member_of(shape: str) -> str | None:
    """Return the member of the unit table's basis that a name in files means, or None. `AU01_L` counts as `AU1_L`.

    >>> member_of("AU12_L"), member_of("AU1+4_L"), member_of("jawOpen")
    ('L12', '1+4:L', None)
    """
    found = _UNIT.fullmatch(shape)
    if not found:
        return None
    name, place = found[1], found[2] or ""
    combined = not name.isdecimal()
    return f"{name}:{place}" if combined and place else name if combined else place + name


def folded(name: str) -> str:
    """Return a name without what tools add to it or spell in their own way.

    >>> folded("A14_Eye_Blink_Left"), folded("Head.eyeBlink_L"), folded("EyeBlinkLeft")
    ('eyeblink:l', 'eyeblink:l', 'eyeblink:l')
    """
    name = _NUMBERED.sub("", _OWNER.sub("", name.strip()))
    side = re.search(r"(?:_([LRlr])|[_-]?([Ll]eft|[Rr]ight|LEFT|RIGHT))$", name)
    mark = ""
    if side:
        name = name[:side.start()]
        mark = (side[1] or _SIDES[side[2].casefold()]).casefold()
    stem = re.sub(r"[\s_-]+", "", name).casefold()
    return f"{stem}:{mark}" if mark else stem


def match(names: Iterable[str], known: Mapping[str, Iterable[str]]) -> dict[str, str]:
    """Return name -> the known shape that it means, for those that mean one; exact names go before spelling.

    known: shape -> other names of it. A shape that two names mean goes to the first; the other is left out.
    """
    spelt: dict[str, str] = {}
    for shape, others in known.items():
        for word in (shape, *others):
            spelt.setdefault(folded(word), shape)
    names = list(dict.fromkeys(names))
    found = {name: name for name in names if name in known}
    taken = set(found.values())
    for name in names:
        shape = spelt.get(folded(name))
        if name not in found and shape is not None and shape not in taken:
            found[name] = shape
            taken.add(shape)
    return {name: found[name] for name in names if name in found}
