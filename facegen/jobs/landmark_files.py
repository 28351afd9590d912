"""Landmarks for an avatar's file: proposed, written, and drawn to be looked at: ``facegen landmarks``."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from facegen.errors import InputError
from facegen.face.landmarks import landmark_entries
from facegen.fileio.avatar import load_avatar
from facegen.fileio.images import check_image_path
from facegen.fileio.textfile import check_place
from facegen.jobs.landmark_preview import save_landmark_preview
from facegen.landmarking.proposals import Proposals
from facegen.landmarking.propose import Proposer
from facegen.landmarking.write import save_landmarks
from facegen.transfer.landmarks import check_places, load_landmarks
from facegen.transfer.rig import avatar_path

# Below this a place is to be looked at: of places this sure one in ten is off by more than a tenth of the distance
# between the outer corners of the eyes.
UNSURE = 0.5


@dataclass(frozen=True, eq=False)
class Marked:
    """``path`` of the file written, ``found``: the landmarks, and ``warnings``, a sentence each."""

    path: Path
    found: Proposals
    warnings: tuple[str, ...]


def mark(avatar: str | Path, output: str | os.PathLike[str], *, known: str | os.PathLike[str] | None = None,
         preview: str | os.PathLike[str] | None = None) -> Marked:
    """Propose landmarks for an avatar, write them, and return them.

    avatar: its file, or a shipped avatar's name. output: .yaml, which `facegen rig` takes. known: a landmark file with
    some of them, which are kept as they are. preview: where a sheet of pictures goes (.png, .webp, .jpg). Raises
    InputError and its children; nothing is written then. ::

        mark("avatar.obj", "avatar.yaml", preview="sheet.png")
    """
    path = avatar_path(avatar)
    output = check_place(output, (".yaml", ".yml"))
    if preview is not None:
        check_image_path(preview)
    source = load_avatar(path)
    given, entries = {}, {}
    if known is not None:
        given, entries = _known(Path(known), source.mesh, path.name, source.digest)
    found = Proposer(source.mesh).propose(given)
    warnings = list(found.warnings)
    unsure = found.below(UNSURE)
    if unsure:
        warnings.append(f"not sure of {', '.join(unsure)}: look at them, correct what is wrong, and give the right "
                        "ones with --from to improve the others")
    try:
        warnings += [one for one in check_places(found.landmarks(), source.mesh) if one not in warnings]
    except InputError as error:
        warnings.append(f"a rig would refuse these: {error}")
    written = save_landmarks(found, output, path.name, entries)
    if preview is not None:
        save_landmark_preview(source, found, preview)
    return Marked(written, found, tuple(warnings))


def _known(path: Path, mesh, mesh_name: str, digest: str):
    """Return the places in a file, as `Proposer.propose` takes them, and how they stand there."""
    places = load_landmarks(path, mesh, mesh_name=mesh_name, digest=digest, partial=True)
    given = {name: (int(face), weights) for name, face, weights in
             zip(places.names, places.faces, places.barycentric, strict=True)}
    return given, {name: entry.value for name, entry in landmark_entries(path, partial=True)[1].items()}
