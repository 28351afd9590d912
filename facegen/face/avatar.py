"""An avatar with blendshapes is a face like any other: expressions, action units and raw data become its weights.

    v = v0 + sum_i w_i s_i + sum_i 4 w_i (1 - w_i) c_i

The last, with weights between 0 and 1, keeps lids half way on large round eyes (`facegen.transfer.halfway`); few shapes
have such a corrective c_i.
A rig of facegen's own units is posed exactly by the coefficients that the unit table gives. Another rig - ARKit's
shapes, expressions, VRM's presets, visemes - is posed by the weights that come nearest (`facegen.face.convert`).
"""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from dataclasses import replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.blendshapes.names import match, shape_of
from facegen.blendshapes.recipes import CLASH, Recipe, is_head, shape_set
from facegen.errors import InputError, nearest
from facegen.face.avatar_landmarks import placing
from facegen.face.avatar_notes import Notes, read_notes
from facegen.face.convert import Shapes, as_common, raw_movement
from facegen.face.face import load_face
from facegen.face.head import neck_weight, turn_head
from facegen.facs.deformation import Deformation, weighted_sum
from facegen.facs.expressions import Resolution, resolve
from facegen.facs.tables import load_units
from facegen.geometry.mesh import Mesh

if TYPE_CHECKING:
    from facegen.fileio.avatar import AvatarFile

Array = NDArray[np.float64]

LOST = 0.2
"""A pose that loses more than this share of its movement is warned of."""

# With so many of ARKit's 52 a rig says all of a face; its visemes and presets then only repeat it.
_MOST_OF_ARKIT = 40
# The neck of the base face: where it is if the notes do not say, and from the pivot, above which place all turns and
# below which nothing does; millimetres of a head of the base face's size, which notes' millimetres are.
_PIVOT = np.array([0.0, -70.0, -75.0])
_MOVES_ABOVE, _RESTS_BELOW = np.array([0.0, -14.0, 5.0]), np.array([0.0, -68.0, -5.0])
# The head, millimetres round the eyes' middle: what a picture of an avatar with a body shows. Landmarks outside widen
# it, with so much room round them.
_HEAD_LOW, _HEAD_HIGH, _ROOM = np.array([-100.0, -150.0, -160.0]), np.array([100.0, 150.0, 60.0]), 30.0
# Because units that close an eye by more than half are those to give way when others close it too.
_CLOSERS = 0.5
_TOUCH = 1e-9           # rounding of a sum that is one
_MOUTH_WIDTH = 44.8     # mm, of the base face: what lengths of raw data are fractions of, where no landmarks tell
_WIDEST = "27"          # the unit that opens the jaw as far as it goes
_BEHIND_LIDS = 0.45      # of the width of an eye: where it turns, behind its corners
_KEPT = 256             # poses whose weights are remembered


class AvatarFace:
    """A face made of an avatar's file and its blendshapes; load one with `load_face`.

    ``name``; ``shapes``: names of all blendshapes in the file; ``digest`` of the file. ``colours``: material -> sRGB
    0..255 as far as known. ``focus``: the vertices a picture should frame, or None for all.
    """

    def __init__(self, avatar: AvatarFile) -> None:
        if not avatar.shapes:
            raise InputError(f"face: {avatar.path} has no blendshapes (morph targets) yet; rig it first: "
                             f"facegen rig {avatar.path.name} --landmarks {avatar.path.stem}.yaml "
                             f"-o {avatar.path.stem}-rigged.glb")
        self.name = avatar.path.stem
        self.path = avatar.path
        self.digest = avatar.digest
        self.colours: Mapping[str, tuple[float, float, float]] = dict(avatar.colours)
        self.notes: Notes = read_notes(avatar.notes, str(avatar.path), backward=avatar.is_vrm0)
        self._file = avatar
        self._mesh = replace(avatar.mesh, vertices=self.notes.apply(avatar.mesh.vertices),
                             colours=avatar.vertex_colours)
        self._fitted: dict[Any, tuple[dict[str, float], float]] = {}

    # -- what there is ------------------------------------------------------------------------------------------
    @property
    def file(self) -> AvatarFile:
        """The file it was made of."""
        return self._file

    @property
    def shapes(self) -> tuple[str, ...]:
        """Names of all blendshapes in the file."""
        return tuple(self._file.shapes)

    @property
    def landmarks(self) -> tuple[str, ...]:
        """Names of the landmarks that the file's notes give."""
        return tuple(self.notes.landmarks)

    def mesh(self, detail: int = 2) -> Mesh:
        """Return the neutral, millimetres; an avatar has one level of detail, so ``detail`` changes nothing."""
        return self._mesh

    def landmark_points(self, vertices: Array, *, detail: int = 2) -> dict[str, Array]:
        """Return name -> place (3,), mm, of every landmark on posed vertices (n, 3)."""
        vertices = np.asarray(vertices, np.float64)
        if vertices.shape != self._mesh.vertices.shape:
            raise InputError(f"vertices: expected shape {self._mesh.vertices.shape}, got {vertices.shape}")
        return dict(zip(self.landmarks, self.landmark_weights() @ vertices, strict=True))

    def landmark_weights(self) -> sparse.csr_array:
        """Return the weights (k, n) of the vertices of ``mesh()`` that place the landmarks; kept."""
        return self._landmarks_on

    def motion(self, name: str) -> Array:
        """Return how the vertices (n, 3), mm, move in a shape of the file."""
        return self._motion[:, [self._places[name]]].toarray().reshape(-1, 3)

    @cached_property
    def known(self) -> dict[str, tuple[str, Recipe]]:
        """Blendshape -> (the shape that it is, its recipe), for those whose names are understood."""
        recipes = shape_set("all")
        found = match(self.shapes, {shape: recipe.also for shape, recipe in recipes.items()})
        for shape, kind in self.notes.sets.items():
            plain = CLASH + shape
            if kind == "expressions" and found.get(shape) == shape and plain in recipes:
                found[shape] = plain                    # a file of expressions alone: blink is the expression
        return {name: (shape, recipes[shape]) for name, shape in found.items()}

    @cached_property
    def focus(self) -> NDArray[np.int64] | None:
        """The vertices of the head, if the notes tell it from a body; None is all."""
        if not self.notes.landmarks:
            return None
        places = np.array(list(self.notes.landmarks.values()))
        eyes = [at for name, at in self.notes.landmarks.items() if name.startswith(("eye_inner", "eye_outer"))]
        middle = np.mean(eyes or places, axis=0)
        low = np.minimum(middle + _HEAD_LOW, places.min(axis=0) - _ROOM)
        high = np.maximum(middle + _HEAD_HIGH, places.max(axis=0) + _ROOM)
        used = np.unique(self._mesh.faces)
        at = self._mesh.vertices[used]
        inside = used[((at >= low) & (at <= high)).all(axis=1)]
        # A little neck or hair belongs to the portrait; a body does not.
        whole, head = np.ptp(at, axis=0).max(), (high - low).max()
        return inside if len(inside) and whole > 1.5 * head else None

    # -- poses --------------------------------------------------------------------------------------------------
    def pose(self, what: Any = "neutral", *, person: Any = None, intensity: float = 1.0, detail: int = 2) -> Array:
        """Return the vertices (n, 3), mm, under an expression: anything that the parametric face takes."""
        found = self.resolve(what, person=person, intensity=intensity)
        return self.turned(self.pose_shapes(self.shape_weights(found)), self.head_angles(found))

    def pose_shapes(self, weights: Mapping[str, float]) -> Array:
        """Return the vertices (n, 3), mm, for blendshape -> weight, by the file's own names. Weights may leave 0..1.

        Shapes that the file's notes correct half way are corrected. No weight moves nothing: the neutral comes back bit
        for bit. InputError for a name that the file has not.
        """
        row = np.zeros(len(self.shapes))
        for name, weight in weights.items():
            if name not in self._places:
                raise InputError(f"weights: {self.path.name} has no shape '{name}'{nearest(name, self.shapes)}")
            if isinstance(weight, bool) or not isinstance(weight, numbers.Real) or not np.isfinite(weight):
                raise InputError(f"weights: {name}: expected a finite number, got {weight!r}")
            row[self._places[name]] = weight
        return self.pose_weights(row)

    def pose_weights(self, weights: Array) -> Array:
        """Return the vertices (..., n, 3), mm, for finite weights (..., k) in the order of `shapes`.

        As `pose_shapes`, for many frames and without its checks.
        """
        weights = np.asarray(weights, np.float64)
        neutral = self._mesh.vertices
        if not weights.any():
            return np.broadcast_to(neutral, (*weights.shape[:-1], *neutral.shape)).copy()
        moved = self._motion @ self.corrected(weights).reshape(-1, weights.shape[-1]).T     # (3 n, frames)
        return moved.T.reshape(*weights.shape[:-1], *neutral.shape) + neutral

    def corrected(self, weights: Array) -> Array:
        """Return weights (..., k) with those of the shapes that correct others half way."""
        if not len(self._halves):
            return weights
        whole, half = self._halves.T
        between = np.clip(weights[..., whole], 0.0, 1.0)
        weights = weights.copy()
        np.add.at(weights, (..., half), 4.0 * between * (1.0 - between))
        return weights

    def turned(self, vertices: Array, head: Array, rest: Mesh | None = None) -> Array:
        """Return posed vertices (..., n, 3) with the head turned: head (..., 4) is yaw, pitch, roll in degrees and
        forward in mm. rest: the neutral, mm, that they are of if it is not `mesh`: a file of another kind has the same
        avatar's vertices in another order. Nothing turns where the file does not say where the neck is."""
        if not np.any(head) or not self.notes.framed:
            return vertices
        return turn_head(vertices, head, self.neck, self.neck_weight if rest is None else self._neck_weight(rest))

    def head_angles(self, found: Resolution) -> Array:
        """Return how the head turns (4,) in what was resolved: as `turned` takes it."""
        every = [[one.head.get(key, 0.0) for key in ("yaw", "pitch", "roll", "forward")]
                 for one in (found.deformation, *found.more)]
        lengths = [self._mouth_width if one.units == "face" else 1.0 for one in (found.deformation, *found.more)]
        return (np.array(every) * [[1.0, 1.0, 1.0, length] for length in lengths]).sum(axis=0)

    def resolve(self, what: Any, *, person: Any = None, intensity: float = 1.0) -> Resolution:
        """Return the chain name -> units -> deformation data; what has been resolved is returned as it is."""
        if isinstance(what, Resolution):
            return what
        return resolve(what, person=person, intensity=intensity)

    def shape_weights(self, found: Resolution) -> dict[str, float]:
        """Return blendshape -> weight that shows what was resolved, as well as these shapes can."""
        return self._weights(found)[0]

    def made_of(self, members: Mapping[str, float], raw: tuple[Deformation, ...] = ()
                ) -> tuple[dict[str, float], float]:
        """Return blendshape -> weight that makes coefficients of the unit table and a sum of raw data, as well as these
        shapes can, and the share of the movement that is lost. InputError if no shape's name is understood."""
        key = (tuple(members.items()), raw)
        found = self._fitted.get(key)           # once: another thread may clear it
        if found is None:
            if not self.known:
                raise InputError(f"face: none of the {len(self.shapes)} blendshapes of {self.path.name} has a name "
                                 "that is understood (units such as AU12_L, ARKit, visemes, VRM, expressions); "
                                 "rename them, or rig the neutral: facegen rig")
            fitted, lost = self._made_of.fitted(members, raw_movement(raw) if raw else None)
            if len(self._fitted) >= _KEPT:
                self._fitted.clear()
            self._fitted[key] = found = self._by_name(fitted), lost
        return found

    def check(self, meaning: Resolution) -> tuple[str, ...]:
        """Return what to warn of: movement that these shapes cannot make, a head that cannot turn."""
        lost = self._weights(meaning)[1]
        warnings = []
        if lost > LOST:
            warnings.append(f"{self.path.name} has no shapes for {100 * lost:.0f} % of this movement; the nearest is "
                            "shown")
        if any(one.head for one in (meaning.deformation, *meaning.more)) and not self.notes.framed:
            warnings.append(f"{self.path.name} does not say where its neck is, so the head does not turn; "
                            "`facegen rig` notes it")
        return tuple(warnings)

    # -- inside -------------------------------------------------------------------------------------------------
    def _weights(self, found: Resolution) -> tuple[dict[str, float], float]:
        table = load_units().with_basis(found.own)
        members = {name: value for name, value in table.coefficients(found.units).items() if not is_head(name)}
        members, own = as_common(members, found.own)
        raw = tuple(one for one in (_beyond(found, table), *own, *map(_headless, found.more)) if one)
        if not members and not raw:
            return {}, 0.0
        return self.made_of(held(members), raw)

    @cached_property
    def _made_of(self) -> Shapes:
        """The shapes that poses are made of: units if there are all, else whatever says the most."""
        recipes = dict(self.known.values())
        units = {shape: recipe for shape, recipe in recipes.items() if recipe.set == "units"}
        if set(units) >= _moving_units():
            return Shapes(units)
        if sum(recipe.set == "arkit" for recipe in recipes.values()) >= _MOST_OF_ARKIT:
            recipes = {shape: one for shape, one in recipes.items() if one.set not in ("visemes", "vrm")}
        # A corrective without the shape that it corrects means nothing.
        return Shapes({shape: one for shape, one in recipes.items() if one.minus is None or one.minus in recipes})

    @cached_property
    def _places(self) -> dict[str, int]:
        return {name: row for row, name in enumerate(self.shapes)}

    @cached_property
    def _halves(self) -> NDArray[np.int64]:
        """Which shapes (h, 2) are corrected half way, and by which."""
        pairs = [(self._places[name], self._places[half]) for name, half in self.notes.halves.items()
                 if name in self._places and half in self._places]
        return np.array(pairs, np.int64).reshape(-1, 2)

    @cached_property
    def _motion(self) -> sparse.csr_array:
        """How the coordinates (3 n, k), mm, move in each shape: few vertices do in most."""
        rows, values = [], []
        for moves in self._file.shapes.values():
            moving = np.flatnonzero(np.asarray(moves).any(axis=1))
            rows.append((3 * moving[:, None] + np.arange(3)).ravel())
            values.append(self.notes.vectors(np.asarray(moves, np.float64)[moving]).ravel())
        columns = np.repeat(np.arange(len(rows)), [len(one) for one in rows])
        shape = (self._mesh.vertices.size, len(rows))
        return sparse.csr_array((np.concatenate(values), (np.concatenate(rows), columns)), shape=shape)

    @cached_property
    def _landmarks_on(self) -> sparse.csr_array:
        return placing(self.notes, self._mesh, self.opened)

    def opened(self) -> Array | None:
        """Return how the vertices move when the jaw opens, mm, or None if no shape does that."""
        weights, left = self._made_of.read_off({_WIDEST: 1.0}) if self.known else ({}, {_WIDEST: 1.0})
        if left:
            return None
        return self.pose_shapes(self._by_name(weights)) - self._mesh.vertices

    def _by_name(self, weights: Mapping[str, float]) -> dict[str, float]:
        """Return weights by the file's own names for weights by the shapes that they are."""
        names = {shape: name for name, (shape, _) in self.known.items()}
        return {names[shape]: weight for shape, weight in weights.items()}

    @cached_property
    def _mouth_width(self) -> float:
        corners = [self.notes.landmarks.get(f"mouth_corner_{side}") for side in "LR"]
        return _MOUTH_WIDTH if any(at is None for at in corners) else float(np.linalg.norm(corners[0] - corners[1]))

    @property
    def neck(self) -> Array:
        """Where the head turns (3,), mm."""
        return _PIVOT if self.notes.neck is None else self.notes.neck

    @cached_property
    def eye_centres(self) -> Array | None:
        """Where the left and the right eye turn (2, 3), mm, as far as the file's notes tell: the middle of an eyeball,
        else behind the middle of its corners. None where they do not."""
        centres = []
        for side in "LR":
            balls = [part for part in self.notes.parts(f"eye_{side}") if part in self._mesh.parts]
            corners = [self.notes.landmarks.get(f"eye_{end}_{side}") for end in ("inner", "outer")]
            if balls:
                ball = self._mesh.vertices[self._mesh.part_vertices(balls[0])]
                centres.append((ball.min(axis=0) + ball.max(axis=0)) / 2.0)
            elif all(at is not None for at in corners):
                width = float(np.linalg.norm(corners[0] - corners[1]))
                centres.append((corners[0] + corners[1]) / 2.0 - [0.0, 0.0, _BEHIND_LIDS * width])
            else:
                return None
        return np.array(centres)

    @cached_property
    def neck_weight(self) -> Array:
        """How much of the head's turn each vertex makes (n, 1)."""
        return self._neck_weight(self._mesh)

    def _neck_weight(self, mesh: Mesh) -> Array:
        weight = neck_weight(mesh.vertices, self.neck + _MOVES_ABOVE, self.neck + _RESTS_BELOW)
        for part in set(self.notes.parts("body")) & set(mesh.parts):
            weight[mesh.part_vertices(part)] = 0.0
        return weight


def _beyond(found: Resolution, table: Any) -> Deformation | None:
    """Return the raw movement in a deformation beyond its units, without the head's; a clip may hold both."""
    whole = found.deformation
    rest = whole
    if found.units:
        made = weighted_sum([(value, table.basis[name]) for name, value in table.coefficients(found.units).items()])
        rest = whole - made             # sums are exact to the last bit: what units alone make leaves nothing
    rest = _headless(rest)
    return rest if rest else None


def _headless(one: Deformation) -> Deformation:
    """Return a movement without the head's, which no shape makes: it turns on its neck."""
    return replace(one, head={}) if one.head else one


@cache
def _moving_units() -> frozenset[str]:
    """Shapes of units that move something."""
    return frozenset(shape_of(name) for name, one in load_units().basis.items() if one and not is_head(name))


@cache
def _closures() -> dict[str, tuple[float, float]]:
    """Member of the unit table -> how much of the left and the right eye it closes, lids that follow the gaze too."""
    face, found = load_face(), {}
    for name, one in load_units().basis.items():
        lids = face.controls(one, strict=False).lids
        if lids.any():
            found[name] = float(lids[:2].sum()), float(lids[2:].sum())
    return found


def held(members: Mapping[str, float]) -> dict[str, float]:
    """Return coefficients of units that close no eye twice: lids that meet stop, blendshapes would pass each other."""
    held = dict(members)
    for side in (0, 1):
        closing = {name: value * _closures()[name][side] for name, value in held.items() if name in _closures()}
        beyond = sum(closing.values()) - 1.0
        strong = {name: share for name, share in closing.items() if share and _closures()[name][side] >= _CLOSERS}
        total = sum(strong.values())
        if beyond > _TOUCH and total > 0.0:
            for name in strong:
                held[name] *= max(0.0, 1.0 - beyond / total)
    return held
