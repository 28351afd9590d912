"""Placing landmarks on an avatar, step by step: what is asked for next, and what each step makes of the work.

All here is data to data: the picture and its clicks are elsewhere (`facegen.studio.picker_view`), and undoing is the
page's. A place is {"face": triangle, "barycentric": [a, b, c]}.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.adoption.write import yaml_text
from facegen.errors import InputError
from facegen.face.landmarks import OPTIONAL, REQUIRED
from facegen.geometry.mesh import Mesh
from facegen.studio.landmark_words import ORDER, WORDS, partner
from facegen.studio.work import AvatarWork
from facegen.transfer.landmarks import Landmarks

Array = NDArray[np.float64]
Place = Mapping[str, Any]

CONFIRMED, PROPOSED, OPEN, SKIPPED = "confirmed", "proposed", "open", "skipped"
"""States of a point."""

# Points of one slit: closed lips and lids touch, so that a click for one may hit the other's mark.
_MEET = frozenset({"mouth_inner_top", "mouth_inner_bottom", "mouth_top", "mouth_bottom"})


def place(face: int, barycentric: Iterable[float]) -> dict[str, Any]:
    """Return a place on a triangle as a work and a landmarks' file hold it: weights of 0 or more that sum to one."""
    weights = np.clip(np.asarray(tuple(barycentric), float), 0.0, None)
    return {"face": int(face), "barycentric": [float(each) for each in weights / weights.sum()]}


def point(mesh: Mesh, one: Place) -> Array:
    """Return where a place is (3,) on a mesh."""
    return np.asarray(one["barycentric"]) @ mesh.vertices[mesh.faces[one["face"]]]


def fits(mesh: Mesh, landmarks: Mapping[str, Place]) -> bool:
    """Return whether a mesh has all the triangles that landmarks are on."""
    return all(0 <= one["face"] < len(mesh.faces) for one in landmarks.values())


def as_landmarks(mesh: Mesh, landmarks: Mapping[str, Place]) -> Landmarks:
    """Return places as the transfer takes them."""
    faces = np.array([one["face"] for one in landmarks.values()], np.int64)
    weights = np.array([one["barycentric"] for one in landmarks.values()], float).reshape(-1, 3)
    return Landmarks(tuple(landmarks), faces, mesh.faces[faces].astype(np.int64).reshape(-1, 3), weights)


def as_places(landmarks: Landmarks) -> dict[str, Place]:
    """Return what `as_landmarks` was given."""
    return {name: place(face, weights) for name, face, weights in
            zip(landmarks.names, landmarks.faces, landmarks.barycentric, strict=True)}


# -- what is asked for ---------------------------------------------------------------------------------------------
def wanted(work: AvatarWork, *, chosen: str | None = None, advised: str | None = None) -> str | None:
    """Return the point to ask for, or None when there is nothing to ask.

    chosen: by the person; goes first, placed or not. advised: what would help most, if anybody knows. A point whose
    partner is placed has time: it is known by mirroring.
    """
    if chosen is not None:
        return chosen
    left = [name for name in ORDER if state(work, name) == OPEN]
    left = [name for name in left if name in REQUIRED] or left
    left = [name for name in left if partner(name) not in work.landmarks] or left
    return advised if advised in left else next(iter(left), None)


def state(work: AvatarWork, name: str, proposed: Container[str] = ()) -> str:
    """Return the state of a point. proposed: names that have a proposal."""
    if name in work.landmarks:
        return CONFIRMED
    if work.skipped.get(name):
        return SKIPPED
    return PROPOSED if name in proposed else OPEN


def missing(work: AvatarWork) -> list[str]:
    """Return the required points that are not confirmed, in the order they are asked for."""
    return [name for name in ORDER if name in REQUIRED and name not in work.landmarks]


def may_meet(one: str, other: str) -> bool:
    """Return whether two points may lie on one place, so that a click on the one may mean the other."""
    if {one, other} <= _MEET:
        return True
    ends = ("eye_upper", "eye_lower")
    return one.startswith(ends) and other.startswith(ends) and one[-2:] == other[-2:]


# -- steps ---------------------------------------------------------------------------------------------------------
def placed(work: AvatarWork, name: str, one: Place, other: Place | None = None) -> AvatarWork:
    """Return the work with a point at a place. other: the partner's place; it goes along if it was confirmed."""
    landmarks = {**work.landmarks, name: dict(one)}
    pair = partner(name)
    if other is not None and work.symmetric and pair in work.landmarks:
        landmarks[pair] = dict(other)
    skipped = {each: flag for each, flag in work.skipped.items() if each != name}
    return replace(work, landmarks=_ordered(landmarks), skipped=skipped)


def taken(work: AvatarWork, proposals: Mapping[str, Place], names: Iterable[str] | None = None) -> AvatarWork:
    """Return the work with proposals confirmed: those of ``names``, or all; what is confirmed or skipped stays."""
    chosen = list(proposals) if names is None else list(names)
    more = {name: dict(proposals[name]) for name in chosen
            if name in proposals and name not in work.landmarks and not work.skipped.get(name)}
    return replace(work, landmarks=_ordered({**work.landmarks, **more}))


def removed(work: AvatarWork, name: str) -> AvatarWork:
    """Return the work without a point, which is open again."""
    return replace(work, landmarks={each: one for each, one in work.landmarks.items() if each != name},
                   skipped={each: flag for each, flag in work.skipped.items() if each != name})


def skipped(work: AvatarWork, name: str) -> AvatarWork:
    """Return the work in which an optional point is not asked for; InputError for a required one."""
    if name not in OPTIONAL:
        raise InputError(f"{WORDS[name].label}: this point is needed; only optional points can be skipped")
    return replace(removed(work, name), skipped={**work.skipped, name: True})


def skipped_rest(work: AvatarWork) -> AvatarWork:
    """Return the work in which no optional point is asked for any more."""
    return replace(work, skipped={**work.skipped, **{name: True for name in OPTIONAL if name not in work.landmarks}})


def _ordered(landmarks: Mapping[str, Place]) -> dict[str, Place]:
    return {name: landmarks[name] for name in (*REQUIRED, *OPTIONAL) if name in landmarks}


# -- files ---------------------------------------------------------------------------------------------------------
def file_text(work: AvatarWork, digest: str) -> str:
    """Return the landmarks' file (docs/landmarks.md). digest: SHA-256 of the avatar's file, so that a file for another
    mesh is known."""
    marks = {name: {"face": one["face"], "barycentric": [round(each, 9) for each in one["barycentric"]]}
             for name, one in work.landmarks.items()}
    return yaml_text(f"Landmarks of {work.file}, placed in facegen's studio.",
                     {"mesh": f"sha256:{digest}", "landmarks": marks})


def words_for(text: str) -> str:
    """Return a message with the words that the studio uses instead of landmarks' names."""
    for name in sorted(WORDS, key=len, reverse=True):
        text = text.replace(f"'{name}'", f"**{WORDS[name].label}**")
        if "_" in name:                         # others are words: a chin may be spoken of
            text = re.sub(rf"\b{name}\b", f"**{WORDS[name].label}**", text)
    return text[:1].upper() + text[1:]
