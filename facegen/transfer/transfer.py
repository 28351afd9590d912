"""The one door of the transfer: an avatar's mesh and landmarks in, its shapes out.

Based on: Onizuka et al. (2018), section 4, on avatars of several pieces. The steps: into the template's frame (eq. 9,
by landmarks instead of boxes, so that hair or a body does not count), apart into pieces, the skin by `skin`, the other
pieces as what they are, and back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError, nearest
from facegen.fileio.kept import Kept
from facegen.forked import Aside, for_each, shared_zeros
from facegen.geometry.mesh import Mesh
from facegen.progress import Progress, silent, within
from facegen.transfer.alignment import Similarity, align
from facegen.transfer.apart import take_apart
from facegen.transfer.choices import OURS_CHOICES, Choices
from facegen.transfer.landmarks import Landmarks
from facegen.transfer.pieces import Piece
from facegen.transfer.pushing import Contact
from facegen.transfer.skin import Skin, Solver, lay_skin
from facegen.transfer.solve import OURS, Weights
from facegen.transfer.template import Template
from facegen.transfer.whole import Beside, WholeMotion, among_all

# Because squares of larger numbers, and float32 in files, run over.
_FARTHEST = 1e30
# Shapes that are made together, to bound the memory.
_AT_A_TIME = 8


@dataclass(frozen=True, eq=False)
class Transferred:
    """``shapes``: name -> displacement (n, 3) of the avatar's own vertices, in its own axes and units. ``frame``: from
    there to the template's. ``skin``, ``pieces``: what the avatar was taken for; ``contacts``: how far eyes and teeth
    went through the skin before and after they were kept apart, mm, in each of the shapes. ``halves``: shape -> its
    corrective half way, see `halfway`. ``warnings``: what was odd about the mesh. ``fresh``: the shapes that were
    computed, not remembered."""

    shapes: Mapping[str, NDArray]
    frame: Similarity
    skin: Skin
    pieces: tuple[Piece, ...]
    contacts: Mapping[str, Contact]
    halves: Mapping[str, NDArray]
    warnings: tuple[str, ...] = ()
    fresh: tuple[str, ...] = ()


def transfer(mesh: Mesh, landmarks: Landmarks, template: Template, *, choices: Choices = OURS_CHOICES,
             pieces: Mapping[str, str] | None = None, kept: Kept | None = None, progress: Progress = silent
             ) -> Transferred:
    """Return the template's shapes on an avatar: a `Binding` that is used once.

    choices: beside ours. progress: called as `Progress` says. Otherwise as there.
    """
    binding = Binding(mesh, landmarks, template, pieces=pieces, kept=kept, progress=within(progress, 0.0, 0.3))
    return binding.shapes(choices, progress=within(progress, 0.3, 1.0))


@dataclass
class _Remembered:
    """What was computed last: ``motion`` (k, n, 3) of all vertices, ``contacts`` and ``halves``, and for each shape
    ``how``: the choices it depends on, None if it was not computed yet."""

    motion: NDArray[np.float64]
    how: list[Choices | None]
    contacts: dict[str, Contact] = field(default_factory=dict)
    halves: dict[int, NDArray] = field(default_factory=dict)

    @classmethod
    def of(cls, k: int, n: int) -> _Remembered:
        """Return nothing, with room for k shapes of n vertices."""
        return cls(shared_zeros((k, n, 3)), [None] * k)

    def forget(self, shapes: Sequence[int]) -> None:
        """Let go of some shapes, before their motion is overwritten."""
        for k in shapes:
            self.how[k] = None

    def put(self, shapes: NDArray[np.int64], beside: Beside, how: Sequence[Choices]) -> None:
        """Remember of some shapes (s,) whose motion is there already what is beside it."""
        for name, contact in beside.contacts.items():
            all_of = self.contacts.setdefault(name, Contact(*np.zeros((2, len(self.how)))))
            all_of.before[shapes], all_of.after[shapes] = contact.before, contact.after
        for k, own in zip(shapes.tolist(), how, strict=True):
            self.how[k] = own
            self.halves.pop(k, None)
        self.halves.update(beside.halves)


class Binding:
    """An avatar laid on a template: what no choice changes is computed once, and shapes only where a choice changes
    them. Not for two threads at a time."""

    def __init__(self, mesh: Mesh, landmarks: Landmarks, template: Template, *,
                 pieces: Mapping[str, str] | None = None, kept: Kept | None = None, progress: Progress = silent
                 ) -> None:
        """mesh: the avatar, in any axes and units. landmarks: on it. pieces: part, material or number of a component
        -> kind. kept: where registrations are kept and found again. Raises InputError for what cannot be used: unknown
        names, a mesh that cannot be solved."""
        far = np.flatnonzero((np.abs(mesh.vertices) > _FARTHEST).any(axis=1))
        if len(far):
            raise InputError(f"mesh: {len(far)} of {len(mesh.vertices)} vertices lie beyond {_FARTHEST:g} (first: "
                             f"{', '.join(map(str, far[:5]))}); remove them or write the mesh in larger units")
        self.template = template
        self.frame = align(landmarks.points(mesh.vertices), template.landmarks)
        progress("telling the pieces apart", 0.0)
        self._parts = parts = take_apart(mesh, landmarks, self.frame, explicit=pieces)
        self.pieces = parts.pieces
        with template.making():
            self.skin = lay_skin(template, parts.surface, parts.places(template.places), kept=kept,
                                 progress=within(progress, 0.1, 1.0))
        self._solver: tuple[Weights, Solver] | None = None
        self._made: _Remembered | None = None

    @cached_property
    def _whole(self) -> WholeMotion:
        return WholeMotion(self.skin, self._parts)

    def shapes(self, choices: Choices = OURS_CHOICES, only: Sequence[str] | None = None, *,
               progress: Progress = silent) -> Transferred:
        """Return the shapes, or those of some names. Raises InputError for a name that is none."""
        template = self.template
        for name in only or ():
            if name not in template.names:
                raise InputError(f"only: no shape is called '{name}'{nearest(str(name), template.names)}")
        wanted = [k for k, name in enumerate(template.names) if only is None or name in only]
        progress("finding lids, lips and eyes", 0.0)
        self._prepare(choices)
        how = self._choices_by_shape(choices)
        made = self._made or _Remembered.of(len(template.names), len(self._parts.vertices))
        self._made = made
        needed = {*wanted, *(template.minus[k] for k in wanted if template.minus[k] >= 0)}
        fresh = [k for k in sorted(needed) if made.how[k] != how[k]]
        blocks = [np.array(fresh[start:start + _AT_A_TIME]) for start in range(0, len(fresh), _AT_A_TIME)]
        if blocks:
            skin_motion = self._skin_motion(choices)
            made.forget(fresh)

            def work(i: int) -> Beside:
                made.motion[blocks[i]], beside = self._moved(blocks[i], skin_motion(blocks[i]), choices)
                return beside

            done = for_each(len(blocks), work, progress=within(progress, 0.2, 1.0), stage="carrying the shapes over")
            for block, beside in zip(blocks, done, strict=True):
                made.put(block, beside, [how[k] for k in block])
        back, own = self.frame.inverse(), self._parts.own

        def returned(motion: NDArray) -> NDArray[np.float64]:
            return np.take(back.apply_vectors(motion), own, axis=0)

        found = {template.names[k]: returned(made.motion[k] if template.minus[k] < 0 else
                                             made.motion[k] - made.motion[template.minus[k]]) for k in wanted}
        halves = {template.names[k]: returned(made.halves[k]) for k in wanted if k in made.halves}
        ours = choices.method == "landmarks"
        contacts = {name: Contact(one.before[wanted], one.after[wanted]) for name, one in made.contacts.items() if ours}
        notes = self._whole.notes if ours else ()
        return Transferred(found, self.frame, self.skin, self.pieces, contacts, halves,
                           (*self._parts.skin.notes, *notes), tuple(template.names[k] for k in fresh))

    def _choices_by_shape(self, choices: Choices) -> list[Choices]:
        """Return the choices that each shape depends on."""
        if choices.method != "landmarks":
            return [choices] * len(self.template.names)
        both = zip(self._whole.jaw_moves, self._whole.lids_close, strict=True)
        return [replace(choices, opening=choices.opening if jaw else 1.0,
                        lid_closure=choices.lid_closure if lid else 1.0) for jaw, lid in both]

    def _prepare(self, choices: Choices) -> None:
        """Make what no shape changes, in two processes if both halves of it are missing."""
        weights = choices.weights or OURS
        if not choices.ours or (self._solver is not None and self._solver[0] == weights):
            return
        self._solver = None                         # two are never needed
        _ = self.skin.feet, self.template.without_jaw   # which both halves need
        with Aside(lambda: self.skin.system(weights), useful="_whole" not in vars(self)) as system:
            _ = self._whole, self.skin.jaw_share
            self._solver = weights, self.skin.solver(system.result())

    def _skin_motion(self, choices: Choices) -> Callable[[NDArray], NDArray]:
        """Return what gives the skin's displacements (s, n, 3) in some shapes (s,)."""
        if not choices.ours:
            return self.skin.published_motion(choices.method, choices.weights).__getitem__
        _, solver = self._solver

        def motion(shapes: NDArray[np.int64]) -> NDArray[np.float64]:
            result = solver(shapes)
            self.skin.open_jaw(result, self.template.shapes.jaw[shapes], choices.opening)
            return result

        return motion

    def _moved(self, shapes: NDArray[np.int64], on_skin: NDArray, choices: Choices) -> tuple[NDArray, Beside]:
        if choices.method == "landmarks":
            return self._whole(shapes, on_skin, opening=choices.opening, lid_closure=choices.lid_closure)
        motion = among_all(on_skin, self._parts.rows, len(self._parts.vertices))
        self._parts.skin.carry(motion)
        return motion, Beside({}, {})
