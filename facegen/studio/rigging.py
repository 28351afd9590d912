"""An avatar of a work gets its blendshapes: what step 3 does, without a browser."""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.face.avatar import AvatarFace
from facegen.facs.expressions import Resolution
from facegen.fileio.textfile import make_folder, save_text
from facegen.geometry.mesh import Mesh
from facegen.jobs.preview import save_preview
from facegen.studio.avatar_checks import set_names
from facegen.studio.avatar_file import FOLDER, Opened
from facegen.studio.desk import FACES
from facegen.studio.landmark_words import WORDS
from facegen.studio.picking import as_landmarks, file_text, missing, words_for
from facegen.studio.work import AvatarWork
from facegen.transfer.alignment import align
from facegen.transfer.apart import take_apart
from facegen.transfer.landmark_checks import average_face
from facegen.transfer.pieces import describe
from facegen.transfer.rig import Rigged, Rigging
from facegen.transfer.transfer import Transferred

Array = NDArray[np.float64]
Report = Callable[[str, float], None]

# So many missing points are named; of more, the number.
_NAMED = 3
# What of a work changes the avatar's laying on the template, and what only its shapes.
_LAID = ("file", "landmarks", "sets", "pieces")
_TUNED = ("opening", "lid_closure", "weights")


class RigMaker:
    """Makes blendshapes of the avatar of a work; what tuning does not change is made once. Threads take turns.

    folder: of the work.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = threading.Lock()
        self._laid: tuple[str, Rigging] | None = None

    def make(self, work: AvatarWork, opened: Opened, report: Report) -> Rigged:
        """Write the avatar with blendshapes into the folder of faces. InputError in words; nothing is written then."""
        with self._lock:
            path = self.path(opened)
            made = self._rigging(work, opened, report).save(
                make_folder(path.parent) / path.name, weights=dict(work.weights) or None, opening=work.opening,
                lid_closure=work.lid_closure, progress=report)
            save_text(f"{opened.avatar.digest}\n{key(work, opened)}", self._note(opened))
            return made

    def tune(self, work: AvatarWork, opened: Opened, weights: Mapping[str, float]) -> tuple[Array, Transferred]:
        """Return vertices (n, 3), mm, of the avatar's own mesh with shapes by weights, and how they were made.

        Only the shapes that have a weight and that the work's choices change are computed.
        """
        with self._lock:
            rigging = self._rigging(work, opened, lambda stage, share: None)
            found = rigging.shapes([name for name in weights if name in rigging.names],
                                   weights=dict(work.weights) or None, opening=work.opening,
                                   lid_closure=work.lid_closure)
        return posed(opened.avatar.mesh.vertices, found, weights), found

    def shown(self, work: AvatarWork, opened: Opened, face: AvatarFace, meaning: Resolution
              ) -> tuple[Mesh, Transferred]:
        """Return the avatar's own mesh, mm, as the work's choices make it show something, and how its shapes were made.

        face: the avatar with blendshapes as its file was last made, which says what the shapes are for.
        """
        vertices, found = self.tune(work, opened, face.shape_weights(meaning))
        own = opened.avatar.mesh
        rest = own.with_vertices(found.frame.apply(own.vertices))
        vertices = face.turned(vertices, face.head_angles(meaning), rest)
        return replace(own, vertices=vertices, colours=opened.avatar.vertex_colours), found

    def path(self, opened: Opened) -> Path:
        """Return where the avatar with blendshapes is or will be."""
        return self.folder / FACES / opened.output

    def is_there(self, opened: Opened) -> bool:
        """Return whether the avatar's file with blendshapes is there, whatever they were made by."""
        return self._noted(opened)[0] == opened.avatar.digest

    def is_made(self, work: AvatarWork, opened: Opened) -> bool:
        """Return whether the file is there and is what this work makes."""
        return self._noted(opened) == [opened.avatar.digest, key(work, opened)]

    def _noted(self, opened: Opened) -> list[str]:
        note = self._note(opened)
        return note.read_text().split("\n") if self.path(opened).is_file() and note.is_file() else [""]

    def _note(self, opened: Opened) -> Path:
        return self.folder / FOLDER / f"{opened.output}.made"

    def _rigging(self, work: AvatarWork, opened: Opened, report: Report) -> Rigging:
        check_ready(work)
        now = key(work, opened, _LAID)
        if self._laid is None or self._laid[0] != now:
            report("reading the avatar", 0.0)
            marks = make_folder(self.folder / FOLDER) / f"{opened.output}.landmarks.yaml"
            save_text(file_text(work, opened.avatar.digest), marks)
            try:
                made = Rigging(opened.avatar, landmarks=marks, sets=set_names(work.sets), pieces=dict(work.pieces))
            except InputError as error:             # of a file that the person never sees
                raise InputError(words_for(str(error).removeprefix(f"{marks}: "))) from None
            self._laid = now, made
        return self._laid[1]


def check_ready(work: AvatarWork) -> None:
    """Raise InputError in words if points are missing."""
    left = missing(work)
    if left:
        named = ", ".join(WORDS[name].label for name in left[:_NAMED])
        more = f" and {len(left) - _NAMED} more" if len(left) > _NAMED else ""
        raise InputError(f"{len(left)} point{'s are' if len(left) > 1 else ' is'} missing: {named}{more}. Place them "
                         "in step 2, or take the proposals")


def key(work: AvatarWork, opened: Opened, names: tuple[str, ...] = (*_LAID, *_TUNED)) -> str:
    """Return a text that differs where what a rigged file depends on differs."""
    plain = asdict(work)
    text = json.dumps([opened.avatar.digest, *(plain[name] for name in names)], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def posed(vertices: Array, found: Transferred, weights: Mapping[str, float]) -> Array:
    """Return an avatar's vertices (n, 3), in the template's frame, mm, with shapes by weights."""
    moved = np.array(vertices, float)
    for name, weight in weights.items():
        if name in found.shapes:
            moved += weight * found.shapes[name]
        if name in found.halves:
            between = min(max(weight, 0.0), 1.0)
            moved += 4.0 * between * (1.0 - between) * found.halves[name]
    return found.frame.apply(moved)


def pieces(work: AvatarWork, opened: Opened) -> list[dict[str, object]]:
    """Return what the avatar is made of, as `describe` gives it, largest first; InputError if points are missing."""
    check_ready(work)
    mesh = opened.avatar.mesh
    marks = as_landmarks(mesh, work.landmarks)
    found = take_apart(mesh, marks, align(marks.points(mesh.vertices), average_face()), explicit=dict(work.pieces))
    return sorted(describe(found.pieces), key=lambda row: -row["triangles"])


def preview(face: AvatarFace, folder: Path, opened: Opened, report: Report) -> Path:
    """Draw the sheet of a rigged avatar and return its file."""
    return save_preview(face, make_folder(folder / FOLDER) / f"{Path(opened.output).stem}.png", progress=report)
