"""From an avatar's file to a file with blendshapes."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from facegen.blendshapes.recipes import shape_sets
from facegen.data import meshes_dir
from facegen.errors import FileError, InputError, nearest
from facegen.face.face import load_face
from facegen.fileio.avatar import AvatarFile, check_output, load_avatar, save_avatar
from facegen.fileio.kept import Kept, kept_in
from facegen.forked import Aside
from facegen.progress import Progress, silent, within
from facegen.transfer.choices import Choices
from facegen.transfer.halfway import half_name
from facegen.transfer.landmark_checks import average_face
from facegen.transfer.landmarks import Landmarks, check_places, load_checked
from facegen.transfer.pieces import describe
from facegen.transfer.template import Template, template_of
from facegen.transfer.template_file import read_template
from facegen.transfer.transfer import Binding, Transferred
from facegen.transfer.weights import WeightsLike, read_weights

DEFAULT_SETS = ("units", "arkit", "visemes")
"""What an avatar gets unless told otherwise: the units make every expression, the others are what programs ask for."""


@dataclass(frozen=True, eq=False)
class Rigged:
    """``path`` of the file written, ``names`` of its shapes, ``warnings``, ``found``: how the transfer
    went, and ``avatar``: what was written, as it is read again."""

    path: Path
    names: tuple[str, ...]
    warnings: tuple[str, ...]
    found: Transferred
    avatar: AvatarFile

    @property
    def pieces(self) -> list[dict[str, object]]:
        """A row for each piece: name, kind, triangles, components, why."""
        return describe(self.found.pieces)


@cache
def _shipped() -> Mapping[str, Path]:
    return {p.parent.name: p for p in sorted((meshes_dir() / "avatars").glob("*/*.obj")) if p.stem == p.parent.name}


def avatar_names() -> tuple[str, ...]:
    """Return the names of the shipped avatars."""
    return tuple(_shipped())


def avatar_path(avatar: str | Path, *, what: str = "avatar") -> Path:
    """Return the file of an avatar, given by path or a shipped one by name. ``what`` it is called in errors. Raises
    FileError."""
    path = _shipped().get(str(avatar), Path(avatar))
    if not path.exists():
        named = f", or one of {', '.join(_shipped())}" if path.suffix == "" else ""
        raise FileError(f"{what}: expected a file{named}, got {str(avatar)!r}, which does not exist"
                        f"{nearest(str(avatar), _shipped())}")
    return path


def avatar_files(avatar: str | Path, landmarks: str | Path | None, *, what: str = "avatar") -> tuple[Path, Path]:
    """Return the file of an avatar, given by path or a shipped one by name, and that of its landmarks. ``what`` it is
    called in errors. Raises InputError or FileError."""
    path = avatar_path(avatar, what=what)
    marks = Path(landmarks) if landmarks is not None else path.with_name("landmarks.yaml") \
        if str(avatar) in _shipped() else None
    if marks is None:
        raise InputError(f"landmarks: expected the file of the {what}'s landmarks, got none; 'facegen "
                         f"landmarks {path.name} -o {path.stem}.yaml' proposes them, to be looked at "
                         "(docs/landmarks.md lists the names)")
    return path, marks


def _found(avatar: str | Path | AvatarFile, landmarks: str | Path | Landmarks | None
           ) -> tuple[Path | AvatarFile, Path | Landmarks]:
    """Return an avatar and its landmarks, or the files they are to be read from. Raises as `avatar_files`."""
    if isinstance(avatar, AvatarFile) and landmarks is not None:
        return avatar, landmarks if isinstance(landmarks, Landmarks) else Path(landmarks)
    path, marks = avatar_files(avatar.path if isinstance(avatar, AvatarFile) else avatar,
                               "" if isinstance(landmarks, Landmarks) else landmarks)
    return path, landmarks if isinstance(landmarks, Landmarks) else marks


def _read(avatar: Path | AvatarFile, landmarks: Path | Landmarks) -> tuple[AvatarFile, Landmarks, list[str]]:
    """Return an avatar and its landmarks, read and checked, and what is odd about these."""
    source = avatar if isinstance(avatar, AvatarFile) else load_avatar(avatar)
    if isinstance(landmarks, Landmarks):
        return source, landmarks, check_places(landmarks, source.mesh)
    return source, *load_checked(landmarks, source.mesh, mesh_name=source.path.name, digest=source.digest)


class Rigging:
    """An avatar on its way to blendshapes: read and laid on the template once, its shapes as often as wanted, of which
    only those that a choice changes are computed anew. Not for two threads at a time. ::

        rigging = facegen.Rigging("cat.obj", landmarks="cat.yaml")
        rigging.shapes(["jawOpen"], opening=1.2).shapes["jawOpen"]          # (n, 3), the avatar's axes and units
        rigging.save("cat.glb", opening=1.2)
    """

    def __init__(self, avatar: str | Path | AvatarFile, *, landmarks: str | Path | Landmarks | None = None,
                 sets: Sequence[str] | None = None, shapes: Sequence[str] | None = None,
                 person: str | Path | None = None, template: str | Path | None = None,
                 template_landmarks: str | Path | None = None, pieces: Mapping[str, str] | None = None,
                 cache: bool = True) -> None:
        """Read and check everything; the work is done when it is asked for.

        avatar, landmarks: as in `rig`, or what `load_avatar` and `snap` gave. Everything else as in `rig`.
        """
        self._kept = kept_in("registrations") if cache else None
        found = _found(avatar, landmarks)
        average_face()          # which both need: landmarks are compared with it, and the template is made of it
        with Aside(lambda: _read(*found), useful=not _last.made) as reading:
            self._asked = _asked(sets, shapes, person, template, template_landmarks)
            if reading.forked:
                self._template()
            self.source, self.places, odd = reading.result()
        self.warnings = (*odd, *_without_expressions(self.source, self._asked.sets))
        self._pieces = pieces
        self._binding: Binding | None = None
        self._once = False

    @property
    def names(self) -> tuple[str, ...]:
        """The shapes that can be had."""
        return tuple(self._asked.sets)

    def shapes(self, only: Sequence[str] | None = None, *, method: str = "landmarks",
               weights: WeightsLike | None = None, opening: float = 1.0, lid_closure: float = 1.0,
               progress: Progress = silent) -> Transferred:
        """Return the shapes, or those of some names. Everything else as in `rig`. Raises InputError."""
        return self._shapes(only, Choices(method, read_weights(weights), opening, lid_closure), progress)

    def save(self, output: str | Path, *, method: str = "landmarks", weights: WeightsLike | None = None,
             opening: float = 1.0, lid_closure: float = 1.0, normals: bool = True, quantise: bool = False,
             progress: Progress = silent) -> Rigged:
        """Write the avatar with all its shapes. Everything as in `rig`. Raises InputError; nothing is written then."""
        choices = Choices(method, read_weights(weights), opening, lid_closure)
        sets, source = self._asked.sets, self.source
        check_output(source, output, sets)
        found = self._shapes(None, choices, within(progress, 0.0, 0.9))
        if self._once:
            self._binding = None        # at 100,000 triangles 200 MiB, which writing can use
        made = {name: found.shapes[name] for name in sets}
        made |= {half_name(name): moved for name, moved in found.halves.items()}
        expressions = {name: {name: 1.0} for name, kind in sets.items() if kind == "vrm"}
        notes = _notes(source, self.places.points(source.mesh.vertices), found, sets)
        progress("writing the avatar", 0.9)
        written = save_avatar(source, output, made, notes=notes, normals=normals, quantise=quantise,
                              expressions=expressions)
        return Rigged(written, tuple(made), (*self.warnings, *found.warnings), found,
                      replace(source, shapes={**source.shapes, **made}, notes=notes))

    def _shapes(self, only: Sequence[str] | None, choices: Choices, progress: Progress) -> Transferred:
        for name in only or ():
            if name not in self.names:
                raise InputError(f"only: '{name}' is none of the shapes that were asked for"
                                 f"{nearest(str(name), self.names)}")
        if self._binding is None:
            progress("making the shapes of the template", 0.0)
            self._binding = Binding(self.source.mesh, self.places, self._template(), pieces=self._pieces,
                                    kept=self._kept, progress=within(progress, 0.1, 0.4))
            progress = within(progress, 0.4, 1.0)
        return self._binding.shapes(choices, self.names if only is None else only, progress=progress)

    def _template(self) -> Template:
        return _last.template(self._asked.of, lambda: self._asked.make(self._kept))


def rig(avatar: str | Path, output: str | Path, *, landmarks: str | Path | None = None,
        sets: Sequence[str] | None = None, shapes: Sequence[str] | None = None, person: str | Path | None = None,
        template: str | Path | None = None, template_landmarks: str | Path | None = None, method: str = "landmarks",
        weights: WeightsLike | None = None, opening: float = 1.0, lid_closure: float = 1.0,
        pieces: Mapping[str, str] | None = None, normals: bool = True, quantise: bool = False, cache: bool = True,
        progress: Progress = silent) -> Rigged:
    """Give an avatar blendshapes and write it; `Rigging` does the same in steps.

    avatar: the path of a .obj, .glb, .gltf, .vrm, .ply or .stl file, or a shipped avatar's name. output: .glb (or
    .gltf, .vrm), .npz, or a folder for a sequence of OBJ files. landmarks: their file; a shipped avatar has its own.
    sets: vocabularies, see `shape_sets`; `DEFAULT_SETS` without. shapes: only those of these names. person: whose
    habits override expressions. template, template_landmarks: another face that has shapes, instead of facegen's own
    and its sets, see `read_template`. method, opening, lid_closure: see `Choices`; weights: as `read_weights` takes
    them; pieces: part, material or number of a component -> kind. normals, quantise: as in `save_avatar`. cache: use
    again how the skin was laid on the template, kept in the user's cache folder, if avatar, landmarks, pieces and
    template are the same. progress: called with what is being done and the share that is behind, 0 to 1, before the
    file appears; what it raises stops the work. Raises InputError and its children. Nothing is written when anything is
    raised. ::

        facegen.rig("cat.obj", "cat.glb", landmarks="cat.yaml")
        facegen.load_face("cat.glb").pose("happiness")
    """
    progress("reading the avatar", 0.0)
    rigging = Rigging(avatar, landmarks=landmarks, sets=sets, shapes=shapes, person=person, template=template,
                      template_landmarks=template_landmarks, pieces=pieces, cache=cache)
    rigging._once = True
    return rigging.save(output, method=method, weights=weights, opening=opening, lid_closure=lid_closure,
                        normals=normals, quantise=quantise, progress=within(progress, 0.05, 1.0))


@dataclass(frozen=True)
class _Asked:
    """What is to be made. ``sets``: shape -> the vocabulary it belongs to, empty if unknown; ``make``: makes the
    template, ``of`` this, and keeps registrations where it is told to."""

    sets: Mapping[str, str]
    of: Hashable
    make: Callable[[Kept | None], Template]


def _asked(sets: Sequence[str] | None, shapes: Sequence[str] | None, person: str | Path | None,
           template: str | Path | None, template_landmarks: str | Path | None) -> _Asked:
    """Return the shapes to make and the template to make them from, checked: facegen's own face, or a file."""
    if template is not None:
        if sets is not None or person is not None:
            raise InputError(f"{'person' if sets is None else 'sets'}: facegen's own shapes cannot be had from another "
                             "template, whose shapes go by its own names; leave it out, and choose among them by name "
                             "(shapes)")
        file = read_template(template, landmarks=template_landmarks, shapes=shapes)
        return _Asked({name: file.sets.get(name, "") for name in file.shapes}, file, file.template)
    if template_landmarks is not None:
        raise InputError("template_landmarks: expected a template that they are on, got none (--template)")
    recipes = shape_sets(DEFAULT_SETS if sets is None else sets, person)
    wanted = list(recipes) if shapes is None else list(dict.fromkeys(shapes))
    if not wanted:
        raise InputError("shapes: expected one or more names, got none")
    for name in wanted:
        if name not in recipes:
            raise InputError(f"shapes: '{name}' is not in the sets that were asked for{nearest(str(name), recipes)} "
                             "(facegen list shapes)")
    # A corrective is made from the shape that it corrects, whether or not that is asked for.
    needed = {*wanted, *(recipes[name].minus for name in wanted)}
    of = tuple((name, recipe) for name, recipe in recipes.items() if name in needed)
    return _Asked({name: recipes[name].set for name in wanted}, of, lambda kept: template_of(load_face(), dict(of)))


class _Last:
    """The template that was made last: many avatars get the same shapes, and a template is tens of megabytes."""

    def __init__(self) -> None:
        self._kept: tuple[Hashable, Template] | None = None

    @property
    def made(self) -> bool:
        """Whether there is one."""
        return self._kept is not None

    def template(self, of: Hashable, make: Callable[[], Template]) -> Template:
        """Return it if it was made of this; else make it, and keep it instead."""
        kept = self._kept
        if kept is None or kept[0] != of:
            self._kept = kept = of, make()
        return kept[1]


_last = _Last()


def _without_expressions(source: AvatarFile, sets: Mapping[str, str]) -> list[str]:
    """Return a warning if presets of VRM go into a file that cannot bind them."""
    if source.is_vrm0 and "vrm" in sets.values():
        return [f"{source.path.name} is a VRM 0.x avatar: it gets the shapes but no expressions that use them; convert "
                "it to VRM 1.0 first"]
    return []


def _notes(source: AvatarFile, points: Mapping[str, np.ndarray], found: Transferred,
           sets: Mapping[str, str]) -> dict[str, object]:
    """Return what facegen keeps in the file, to load it as a face: see facegen.face.avatar_notes."""
    kinds: dict[str, str] = {}
    for piece in found.pieces:
        parts = {source.mesh.parts[p] for p in np.unique(source.mesh.face_parts[piece.faces])}
        for part in parts:
            kinds[part] = "skin" if kinds.get(part, piece.kind) != piece.kind else piece.kind
    frame = found.frame
    return {
        "version": 1,
        "frame": {"scale": frame.scale, "rotation": frame.rotation.tolist(), "offset": frame.offset.tolist()},
        "landmarks": {name: at.tolist() for name, at in points.items()},
        **({"neck": points["neck"].tolist()} if "neck" in points else {}),
        "sets": sorted(set(sets.values()) - {""}),
        "shapes": {name: {"set": kind} if kind else {} for name, kind in sets.items()},
        **({"halves": {name: half_name(name) for name in found.halves if name in sets}} if found.halves else {}),
        "pieces": kinds,
    }
