"""Driving a rig by frames of weights: what does not change is prepared once, a frame only multiplies.

The parametric face adds the movements of the shapes before it deforms (`Face.linear_controls`). An avatar that has the
shapes itself takes their weights as they are; what it has not is made of what it has, part by part
(`facegen.face.convert`), so that weights that change a little change the face a little.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.animation.angles import reach
from facegen.animation.meaning import Meaning, Part, pairs
from facegen.blendshapes.recipes import CLASH
from facegen.errors import InputError, nearest
from facegen.face.avatar import LOST, AvatarFace, held
from facegen.face.face import Controls, Face
from facegen.face.rig import Rig
from facegen.facs.deformation import Deformation
from facegen.facs.expressions import resolve

Array = NDArray[np.float64]

HEAD = ("yaw", "pitch", "roll")
GAZE = ("yaw_L", "pitch_L", "yaw_R", "pitch_R")
LOOKS = ("eyeLookOutLeft", "eyeLookInLeft", "eyeLookUpLeft", "eyeLookDownLeft",
         "eyeLookInRight", "eyeLookOutRight", "eyeLookUpRight", "eyeLookDownRight")
"""ARKit's shapes for the angles of `GAZE`, each towards + and then towards -; at weight 1 as far as the units reach."""

_SHOWN = 5              # names that a warning lists
_EXACT = 1e-6           # a part that loses less is made as it is


class Driver:
    """Poses one rig by frames of one recording.

    rig: a face, as `load_face` gives it. vocabulary, names: what the weights are of, as in a `Performance`. detail: the
    level of the mesh. ``direct`` (k,): which shapes the rig has itself; ``unknown``, ``poor``: names that it cannot
    show, or not well. Raises InputError if it can show none. ::

        driver = Driver(face, "arkit", ["jawOpen", "eyeBlinkLeft"])
        vertices = driver.vertices(np.array([0.3, 1.0]))
    """

    def __new__(cls, rig: Rig, vocabulary: str, names: Sequence[str], *, detail: int = 2) -> Driver:
        """Return the driver of this kind of rig."""
        return super().__new__(_AvatarDriver if isinstance(rig, AvatarFace) else _FaceDriver)

    def __init__(self, rig: Rig, vocabulary: str, names: Sequence[str], *, detail: int = 2) -> None:
        self.rig, self.detail = rig, detail
        self.meaning = Meaning(vocabulary, names)
        self.names = self.meaning.names
        self.looking, self.turning = self.meaning.columns("looks"), self.meaning.columns("turns")
        self.direct = np.zeros(len(self.names), bool)
        self.unknown: tuple[str, ...] = self.meaning.unknown
        self.poor: tuple[str, ...] = ()
        self._prepare()

    def vertices(self, weights: Array, head: Array | None = None, gaze: Array | None = None) -> Array:
        """Return the vertices (n, 3), mm, of ``rig.mesh(detail)``.

        weights: (k,) finite; 0..1 is shown, but for a shape that an avatar has itself, which may leave it. head: (3,)
        yaw, pitch and roll, gaze: (4,) yaw_L, pitch_L, yaw_R and pitch_R, degrees, as far as the rig turns; where they
        are given, shapes that turn the head or the eyes do nothing.
        """
        raise NotImplementedError

    def check(self, moving: Iterable[str] | None = None, *, head: bool = False, gaze: bool = False) -> tuple[str, ...]:
        """Return what to warn of if some names (None: all) are moving, and the head or the eyes turn by angles."""
        shown = set(self.names if moving is None else moving)
        name, said = getattr(self.rig, "path", Path(self.rig.name)).name, []
        if unknown := [one for one in self.unknown if one in shown]:
            said.append(f"{_list(unknown)}: no shapes of {name}, and not understood, so left out")
        if poor := [one for one in self.poor if one in shown]:
            said.append(f"{_list(poor)}: {name} has no shapes for more than {100 * LOST:.0f} % of their movement; the "
                        "nearest is shown")
        return tuple(said)

    def _prepare(self) -> None:
        raise NotImplementedError

    def _refuse_if_nothing(self, usable: Iterable[str]) -> None:
        """Raise InputError if there are names and none is usable."""
        if not self.names or any(True for _ in usable):
            return
        known = self.meaning.vocabulary if self.meaning.vocabulary != "shapes" else "units, ARKit, visemes or VRM"
        has = list(getattr(self.rig, "shapes", ()))
        raise InputError(f"names: {self.rig.name} can show none of the {len(self.names)} shapes: {_list(self.names)}"
                         f"{nearest(self.names[0], has) if has else ''}; expected names of {known}"
                         + (", or of the avatar's own shapes" if has else ""))

    def _split(self, weights: Array, head: Array | None, gaze: Array | None) -> tuple[Array, NDArray[np.bool_]]:
        """Return the weights and which of them do nothing, because angles are given."""
        off = np.zeros(len(self.names), bool)
        if head is not None:
            off |= self.turning
        if gaze is not None:
            off |= self.looking
        return np.asarray(weights, np.float64), off


class _FaceDriver(Driver):
    """The parametric face: the deformer's input is a sum of what each part puts in."""

    rig: Face

    def _prepare(self) -> None:
        self._refuse_if_nothing(self.meaning.shapes)
        zero = self.rig.linear_controls(Deformation(), strict=False)
        self._shapes = {one.name: getattr(zero, one.name).shape for one in fields(Controls)}
        parts = self.meaning.parts.values()
        self._inputs = np.array([self._input(part) for part in parts]).reshape(len(parts), self._size)
        rows = self.rig.feature_points
        self._with_jaw = [[list(rows).index(name) for one in part.deformations for name in one.with_jaw if name in rows]
                          for part in parts]

    def vertices(self, weights: Array, head: Array | None = None, gaze: Array | None = None) -> Array:
        """Return the vertices, see `Driver.vertices`."""
        return self.rig.pose_controls(self.controls(weights, head, gaze), detail=self.detail)

    def controls(self, weights: Array, head: Array | None = None, gaze: Array | None = None) -> Controls:
        """Return the deformer's input."""
        weights, off = self._split(weights, head, gaze)
        amounts = self.meaning.coefficients(np.clip(weights, 0.0, 1.0), off)
        row, at, found = amounts @ self._inputs if len(amounts) else np.zeros(self._size), 0, {}
        for name, shape in self._shapes.items():
            size = int(np.prod(shape))
            found[name] = row[at:at + size].reshape(shape)
            at += size
        if head is not None:
            found["head"] = np.append(within("head", head), 0.0)
        if gaze is not None:
            found["eyes"] = within("eyes", gaze)
        turning = {row for amount, rows in zip(amounts, self._with_jaw, strict=True) if amount for row in rows}
        return self.rig.finished_controls(Controls(**found), sorted(turning))

    @property
    def _size(self) -> int:
        return sum(int(np.prod(shape)) for shape in self._shapes.values())

    def _input(self, part: Part) -> Array:
        total = np.zeros(self._size)
        for sign, several in ((1.0, part.deformations), (-1.0, part.minus)):
            for one in several:
                controls = self.rig.linear_controls(one, strict=False)
                total += sign * np.concatenate([getattr(controls, name).ravel() for name in self._shapes])
        return total


class _AvatarDriver(Driver):
    """An avatar: its own shapes by name, the rest part by part of what it has."""

    rig: AvatarFace

    def _prepare(self) -> None:
        rig, meaning = self.rig, self.meaning
        places = {name: row for row, name in enumerate(rig.shapes)}
        own = {} if meaning.vocabulary == "units" else {
            name: shape for name in self.names if (shape := self._own(name)) is not None}
        # What corrects another shape half way moves with that shape, on this rig as on the one that was recorded.
        halves = {name for name in self.names if name in set(rig.notes.halves.values())}
        own = {name: shape for name, shape in own.items() if name not in halves}
        self._refuse_if_nothing([*own, *meaning.shapes])
        self.own = own
        self.direct = np.array([name in own for name in self.names], bool)
        self._to = np.array([places[own[name]] for name in self.names if name in own], np.int64)
        needed = {part for name in self.names if name not in own for part in meaning.made_of[name]}
        if meaning.vocabulary == "units":
            needed = set(meaning.parts)
        self._members = [name if part.members and not part.turns else None for name, part in meaning.parts.items()]
        self._head = np.array([self._turn(part) for part in meaning.parts.values()]).reshape(len(meaning.parts), 4)
        self._made = np.zeros((len(meaning.parts), len(places)))
        lost = self._make({name: part for name, part in meaning.parts.items() if name in needed and not part.turns})
        self.unknown = tuple(name for name in meaning.unknown if name not in own and name not in halves)
        self.poor = tuple(name for name in self.names if name not in own
                          and any(lost.get(part, 0.0) > LOST for part in meaning.made_of[name]))

    def _make(self, parts: Mapping[str, Part]) -> dict[str, float]:
        """Fill in what makes the parts, one by one and in pairs; return what is lost of each."""
        row = {name: at for at, name in enumerate(self.meaning.parts)}
        lost = {}
        for name, part in parts.items():
            self._made[row[name]], lost[name] = self._made_of(part)
        joint, self._pairs = [], []
        for one, other, both in pairs(parts):
            if max(lost[one], lost[other]) < _EXACT:
                continue                    # each is there for itself
            made, left = self._made_of(both)
            joint.append(made)
            self._pairs.append((row[one], row[other]))
            lost[one] = lost[other] = left
        self._joint = np.array(joint).reshape(len(joint), self._made.shape[1])
        return lost

    def vertices(self, weights: Array, head: Array | None = None, gaze: Array | None = None) -> Array:
        """Return the vertices, see `Driver.vertices`."""
        shapes, turn = self.shape_weights(weights, head, gaze)
        return self.rig.turned(self.rig.pose_weights(shapes), turn)

    def shape_weights(self, weights: Array, head: Array | None = None, gaze: Array | None = None
                      ) -> tuple[Array, Array]:
        """Return the weights (s,) of the avatar's shapes, and how the head turns (4,): see `AvatarFace.turned`."""
        weights, off = self._split(weights, head, gaze)
        made, turn = np.zeros(self._made.shape[1]), np.zeros(4)
        if len(self._made):
            amounts = self.meaning.coefficients(np.clip(weights, 0.0, 1.0), off | self.direct)
            turn = amounts @ self._head
            made = self._sum(self._held(amounts))
        if gaze is not None and self._looks is not None:
            made = made + self._looks.shape_weights(_ways(gaze))[0]
        if head is not None:
            turn = np.append(within("head", head), 0.0)
        np.clip(made, 0.0, 1.0, out=made)
        direct = np.where(off, 0.0, weights)[self.direct]
        own = np.zeros(len(made))
        own[self._to] = direct
        # What is made tops up what the recording says of a shape to 1 at most.
        return own + np.minimum(made, np.maximum(1.0 - own, 0.0)), turn

    def check(self, moving: Iterable[str] | None = None, *, head: bool = False, gaze: bool = False) -> tuple[str, ...]:
        """Return what to warn of, see `Driver.check`."""
        said = list(super().check(moving))
        if head and not self.rig.notes.framed:
            said.append(f"{self.rig.path.name} does not say where its neck is, so the head does not turn; "
                        "`facegen rig` notes it")
        if gaze and self._looks is None:
            said.append(f"{self.rig.path.name} has no shapes that turn the eyes, so the gaze is not shown")
        return tuple(said)

    def _own(self, name: str) -> str | None:
        """Return the avatar's own shape that a name of the recording is."""
        if name in self.rig.shapes:
            return name
        shape = self.meaning.shapes.get(name)
        return None if shape is None else self._known.get(shape)

    @property
    def _known(self) -> Mapping[str, str]:
        kind = self.meaning.vocabulary
        return {shape.removeprefix(CLASH) if kind == "expressions" else shape: name
                for name, (shape, recipe) in self.rig.known.items() if kind in ("shapes", recipe.set)}

    def _turn(self, part: Part) -> Array:
        """Return how a part turns the head (4,)."""
        return sum((value * self.rig.head_angles(resolve({member: 1.0})) for member, value in part.members.items()
                    if part.turns), np.zeros(4))

    def _made_of(self, part: Part) -> tuple[Array, float]:
        """Return the weights (s,) of the avatar's shapes that make a part, and what share of it is lost."""
        weights, lost = self.rig.made_of(part.members, part.raw)
        row = self._row(weights)
        if part.minus:                      # only its difference to what it corrects, which is there too
            row = row - self._row(self.rig.made_of({}, part.minus)[0])
        return row, lost

    def _row(self, weights: Mapping[str, float]) -> Array:
        return np.array([weights.get(name, 0.0) for name in self.rig.shapes])

    def _sum(self, amounts: Array) -> Array:
        """Return the weights (s,) that make the parts: together what goes together, the rest one by one."""
        if not len(self._pairs):
            return amounts @ self._made
        amounts, (one, other) = amounts.copy(), np.array(self._pairs).T
        both = np.minimum(amounts[one], amounts[other])
        amounts[one] -= both
        amounts[other] -= both
        return amounts @ self._made + both @ self._joint

    def _held(self, amounts: Array) -> Array:
        """Return coefficients of parts that close no eye twice."""
        members = {name: value for name, value in zip(self._members, amounts.tolist(), strict=True)
                   if name is not None and value}
        kept = held(members)
        if kept == members:
            return amounts
        return np.array([value if name is None or not value else kept[name]
                         for name, value in zip(self._members, amounts.tolist(), strict=True)])

    @cached_property
    def _looks(self) -> _AvatarDriver | None:
        """What turns the eyes by angles, or None if the avatar has no shapes for it."""
        try:
            found = Driver(self.rig, "arkit", LOOKS)
        except InputError:                  # no shape's name is understood
            return None
        return found if found.shape_weights(np.ones(len(LOOKS)))[0].any() else None


def within(part: str, angles: Array) -> Array:
    """Return angles (..., 3) of the "head" or (..., 4) of the "eyes", degrees, clipped to what the units reach."""
    low, high = limits(part)
    return np.clip(angles, low, high)


def limits(part: str) -> tuple[Array, Array]:
    """Return the least and the largest angles of the "head" (3,) or of the "eyes" (4,), degrees."""
    axes = HEAD if part == "head" else ("yaw", "pitch", "yaw", "pitch")
    reached = np.array([reach(part, axis) for axis in axes])
    return -reached[:, 1], reached[:, 0]


def _ways(gaze: Array) -> Array:
    """Return how far (8,) each angle of the eyes goes of what they reach: towards +, then towards -, each 0..1."""
    low, high = limits("eyes")
    return np.clip(np.stack([gaze / high, gaze / low], axis=1), 0.0, 1.0).ravel()


def _list(names: Sequence[str]) -> str:
    more = len(names) - _SHOWN
    return ", ".join(names[:_SHOWN]) + (f" and {more} more" if more > 0 else "")
