"""A face driven as it happens: push a frame of weights, get vertices or a picture. All else is prepared once."""

from __future__ import annotations

import numbers
import time as clock
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.animation.driver import Driver
from facegen.animation.streams.smooth import PER_WEIGHT, Filter, OneEuro
from facegen.blendshapes.recipes import SETS, shape_set
from facegen.errors import InputError, nearest
from facegen.face.face import load_face
from facegen.facs.tables import load_units
from facegen.geometry.mesh import Mesh
from facegen.render.render import Renderer

Array = NDArray[np.float64]
Weights = Mapping[str, float] | ArrayLike
Hook = Callable[[float, Array], Array]

_WIDTHS = {"head": 3, "gaze": 4}
# A level of detail that a picture of 512 pixels shows, for vertices without a picture.
_DETAIL = 2


class Live:
    """One rig, ready for frames.

    rig: a face or what `load_face` takes. vocabulary: what the weights are of: "arkit", "units", "visemes", "vrm",
    "expressions", or "shapes" for an avatar's own. names: the order of the weights in arrays; by default the
    vocabulary's own (of "shapes": the avatar's). size: pixels of the pictures; None: vertices only. smooth: True,
    "1.5,2" or a `OneEuro` for the One Euro filter, or your own ``function(seconds, weights (k,)) -> weights (k,)``.
    detail: of the parametric face; by default what the size takes. occlusion: "neutral" is quick, "posed" is right for
    mouths that open wide. The rest is for the `Renderer`.

    ``names``; ``mesh``: what the vertices belong to; ``warnings``: what the rig cannot show. One caller at a time.
    Raises InputError. ::

        live = facegen.Live("human.glb", "arkit", size=512)
        vertices = live.vertices({"jawOpen": 0.4, "eyeBlinkLeft": 1.0})     # (n, 3), mm
        pixels = live.draw(weights, head=(10, 0, 0))                        # (512, 512, 4) uint8
    """

    def __init__(self, rig: Any = "akimoto", vocabulary: str = "arkit", *, names: Sequence[str] | None = None,
                 size: int | tuple[int, int] | None = None, smooth: OneEuro | str | bool | Hook | None = None,
                 detail: int | None = None, renderer: str = "auto", occlusion: str = "neutral", **look: Any) -> None:
        face = rig if hasattr(rig, "pose") and hasattr(rig, "mesh") else load_face(rig)
        if size is None and look:
            raise InputError(f"{next(iter(look))}: is for pictures, but there are none: give a size")
        self._renderer = None if size is None else Renderer(
            face, size=size, detail=detail, renderer=renderer, occlusion=occlusion, **look)
        level = self._renderer.detail if self._renderer is not None else _DETAIL if detail is None else detail
        self.mesh: Mesh = face.mesh(level)
        names = _names(face, vocabulary) if names is None else tuple(names)
        self._driver = Driver(face, vocabulary, names, detail=level)
        if not names:
            raise InputError("names: expected the shapes that the weights are of, got none")
        self.names = self._driver.names
        self.warnings = self._driver.check()
        self._places = {name: row for row, name in enumerate(self.names)}
        self._last: dict[str, Array] = {"weights": np.zeros(len(self.names))}
        self._hook = smooth if callable(smooth) else None
        euro = None if self._hook else OneEuro.of(smooth)
        self._filters = {} if euro is None else {name: Filter(euro, PER_WEIGHT[name]) for name in ("weights", *_WIDTHS)}
        # The first frame finds all prepared: the matrices, the compiled renderer.
        rest, turned = np.zeros(len(self.names)), {name: np.full(width, 1e-3) for name, width in _WIDTHS.items()}
        vertices = self._driver.vertices(rest, **turned)
        if self._renderer is not None:
            self._renderer.draw(vertices)

    def vertices(self, weights: Weights, *, head: ArrayLike | None = None, gaze: ArrayLike | None = None,
                 time: float | None = None) -> Array:
        """Return the vertices (n, 3) of ``mesh``, mm, of a frame.

        weights: name -> weight, the others being 0, or an array (k,) in the order of ``names``. head: yaw, pitch and
        roll, gaze: yaw_L, pitch_L, yaw_R and pitch_R in degrees; None leaves head and eyes to the weights. What is NaN
        was not seen and stays as it was last. time: when the frame was recorded, seconds, for smoothing; now without.

        Weights are clipped to 0..1 unless the avatar has the shape itself, and angles to what the rig reaches. Raises
        InputError for a name that is not among ``names``, and for what are no numbers.
        """
        when = clock.monotonic() if time is None and (self._filters or self._hook) else time
        frame = {"weights": self._row(weights)}
        for name, values in (("head", head), ("gaze", gaze)):
            if values is not None:
                frame[name] = _numbers(name, values, _WIDTHS[name])
        for name, values in frame.items():
            frame[name] = self._smooth(name, self._seen(name, values), when)
        return self._driver.vertices(**frame)

    def draw(self, weights: Weights, *, head: ArrayLike | None = None, gaze: ArrayLike | None = None,
             time: float | None = None) -> NDArray[np.uint8]:
        """Return the picture (height, width, 4) of a frame, uint8; arguments as for `vertices`."""
        if self._renderer is None:
            raise InputError("size: expected pixels when Live was made, got None: there are vertices only")
        return self._renderer.draw(self.vertices(weights, head=head, gaze=gaze, time=time))

    def _row(self, weights: Weights) -> Array:
        if not isinstance(weights, Mapping):
            return _numbers("weights", weights, len(self.names))
        row = np.zeros(len(self.names))
        for name, weight in weights.items():
            place = self._places.get(name)
            if place is None:
                raise InputError(f"weights: '{name}' is not among the names{nearest(str(name), self.names)}")
            if isinstance(weight, bool) or not isinstance(weight, numbers.Real) or weight in (np.inf, -np.inf):
                raise InputError(f"weights: {name}: expected a finite number or NaN, got {weight!r}")
            row[place] = weight
        return row

    def _seen(self, name: str, values: Array) -> Array:
        """Return values with those that were not seen as they were last, and keep them."""
        missing = np.isnan(values)
        if missing.any():
            values = np.where(missing, self._last.get(name, np.zeros(len(values))), values)
        self._last[name] = values
        return values

    def _smooth(self, name: str, values: Array, when: float | None) -> Array:
        if name in self._filters:
            return self._filters[name].push(when, values)
        if self._hook is None or name != "weights":
            return values
        return _numbers("smooth", self._hook(when, values.copy()), len(self.names), missing=False)


def _names(face: Any, vocabulary: str) -> tuple[str, ...]:
    """Return all names of a vocabulary: the atoms of the units, the shapes of a set, or the avatar's own."""
    if vocabulary == "units":
        return load_units().catalogue.atoms
    if vocabulary == "shapes":
        return tuple(getattr(face, "shapes", ()))
    return tuple(shape_set(vocabulary)) if vocabulary in SETS else ()


def _numbers(name: str, values: ArrayLike, width: int, *, missing: bool = True) -> Array:
    try:
        row = np.array(values, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected {width} numbers, got {type(values).__name__}") from None
    if row.shape != (width,):
        raise InputError(f"{name}: expected shape ({width},), got {row.shape}")
    if np.isinf(row).any() or (not missing and np.isnan(row).any()):
        raise InputError(f"{name}: expected finite numbers{' or NaN' if missing else ''}, got {row.tolist()[:5]}")
    return row
