"""The animation of a glTF file as a performance. `facegen.jobs.animated` writes one, for it takes a face."""

from __future__ import annotations

import os
from pathlib import Path

from facegen.animation.performance import Performance
from facegen.animation.streams.formats import Format, Sample, Wish
from facegen.blendshapes.recipes import SETS, shape_set
from facegen.face.avatar_notes import read_notes
from facegen.face.head import angles
from facegen.fileio.gltf_scene import rotations
from facegen.fileio.gltf_weights import read_weight_animation

SUFFIXES = (".glb", ".gltf", ".vrm")


def knows(sample: Sample) -> bool:
    """Return whether a file is a GLB, or has the suffix of a glTF file."""
    return sample.head.startswith(b"glTF") or sample.path.suffix.lower() in SUFFIXES


def read(path: Path, wish: Wish) -> Performance:
    """Return the performance of a file; of several animations the one that the wish has as its person."""
    number = wish.person is not None and wish.person.isdecimal() and len(wish.person) < 7
    return read_gltf_performance(path, int(wish.person) if number else wish.person)


def read_gltf_performance(path: str | os.PathLike[str], animation: str | int | None = None) -> Performance:
    """Return the weights of morph targets over time in a .glb, .gltf or .vrm file.

    animation: its name or its number, counted from 0; the first that has weights without. The vocabulary is the set
    whose names, written as its owner does, these are, else "shapes". ``head`` is there in files that facegen wrote.
    Raises FileError, or InputError for the animation. ::

        facegen.save_clip(read_gltf_performance("take.glb"), "take.mp4", face="human.glb")
    """
    found = read_weight_animation(path, animation)
    head = None
    if found.turn is not None:
        turn = read_notes(found.notes, str(path)).rotation
        head = angles(turn @ rotations(found.turn) @ turn.T)
    about = {"format": GLTF.name, "path": os.fspath(path), "animation": found.name}
    return Performance(found.times, found.names, found.weights, vocabulary_of(found.names), head=head, about=about,
                       warnings=found.warnings)


def vocabulary_of(names: tuple[str, ...]) -> str:
    """Return the set of shapes that all of these names belong to, or "shapes". Units in files are coefficients, after
    all combinations, so those are "shapes" too."""
    return next((kind for kind in SETS if kind != "units" and set(names) <= set(shape_set(kind))), "shapes")


GLTF = Format("gltf", "weights of morph targets over time in a glTF file (.glb, .gltf, .vrm); facegen play writes it",
              SUFFIXES, knows, read)
