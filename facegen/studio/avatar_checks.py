"""What cannot be in the avatar's section of a work."""

from __future__ import annotations

from typing import TYPE_CHECKING

from facegen.blendshapes.recipes import shape_sets
from facegen.errors import InputError
from facegen.face.landmarks import NAMES, OPTIONAL
from facegen.facs.validate import Entry
from facegen.studio.placement import AXES, across
from facegen.transfer.piece_names import KINDS
from facegen.transfer.weights import read_weights

if TYPE_CHECKING:
    from facegen.studio.work import AvatarWork

OPENING, LID_CLOSURE = (0.1, 3.0), (0.0, 2.0)
"""Least and most of the factors, as `facegen.rig` takes them."""

# More than any mesh has that is taken: a landmark is compared with the mesh where that is known.
_ANY = 10**9


def check_avatar(work: AvatarWork) -> None:
    """Raise InputError for what cannot be."""
    if not across(work.up, work.front):
        raise InputError(f"up, front: expected two of {', '.join(AXES)} at right angles, got {work.up}, {work.front}")
    for name, place in Entry(work.landmarks, "avatar", "landmarks").items():
        check_place(Entry(name, "avatar", "landmarks").choice(NAMES, "landmark"), place)
    for name, entry in Entry(work.skipped, "avatar", "skipped").items():
        Entry(name, "avatar", "skipped").choice(OPTIONAL, "optional landmark")
        entry.flag()
    Entry(work.opening, "avatar", "opening").number(*OPENING)
    Entry(work.lid_closure, "avatar", "lid_closure").number(*LID_CLOSURE)
    shape_sets(set_names(work.sets))
    read_weights(dict(work.weights))
    for piece, entry in Entry(work.pieces, "avatar", "pieces").items():
        Entry(piece, "avatar", "pieces").text()
        entry.choice(KINDS, "kind of piece")


def check_place(name: str, place: Entry) -> None:
    """Raise InputError for what is no place on a triangle."""
    fields = place.fields(required=("face", "barycentric"))
    fields["face"].index(_ANY, "a triangle")
    weights = fields["barycentric"].vector(1.0)
    if min(weights) < 0 or abs(sum(weights) - 1.0) > 1e-6:
        raise fields["barycentric"].wrong(f"three weights of 0 or more that sum to one, for '{name}'")


def set_names(sets: str) -> list[str]:
    """Return "units, arkit" as names."""
    return [name.strip() for name in sets.split(",") if name.strip()]
