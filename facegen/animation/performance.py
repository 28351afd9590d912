"""A performance: weights of named shapes over time, as a camera, a sensor or a person recorded them.

What readers of recordings return and writers take. A `facegen.animation.clip.Clip` is composed, in FACS units; a
performance is recorded, in whatever vocabulary its recorder speaks, with gaps where the face was lost.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.blendshapes.recipes import SETS
from facegen.errors import InputError, nearest

VOCABULARIES = (*SETS, "shapes")
"""What the names of a performance are: a set of shapes as everywhere, or "shapes": those of one rig's file."""

_ANGLES = {"head": 3, "place": 3, "gaze": 4}


@dataclass(frozen=True, eq=False)
class Performance:
    """A recording of n frames.

    times: (n,) seconds, ascending. names: (k,) shapes, each once; weights: (n, k), mostly 0..1, NaN where there is
    none, such as in a frame where no face was found. vocabulary: one of `VOCABULARIES`; of "units" the names are codes,
    "12" or "L12".
    head: (n, 3) degrees of yaw (to the subject's left), pitch (up) and roll (to the subject's left shoulder); place:
    (n, 3) millimetres of the head in the recorder's frame, +x to the subject's left, +y up, +z forward; gaze: (n, 4)
    degrees of yaw_L, pitch_L, yaw_R, pitch_R in the head. Each may be None or hold NaN.
    extra: column -> (n,) numbers or text, what else the recording had, so that it can be written again. about: what it
    was made of ("format", "path", "person", ...). warnings: what was odd.
    """

    times: NDArray[np.float64]
    names: tuple[str, ...]
    weights: NDArray[np.float64]
    vocabulary: str
    head: NDArray[np.float64] | None = None
    place: NDArray[np.float64] | None = None
    gaze: NDArray[np.float64] | None = None
    extra: Mapping[str, NDArray] = field(default_factory=dict)
    about: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.vocabulary not in VOCABULARIES:
            raise InputError(f"vocabulary: expected {', '.join(VOCABULARIES)}, got {self.vocabulary!r}"
                             f"{nearest(str(self.vocabulary), VOCABULARIES)}")
        names = tuple(map(str, self.names))
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise InputError(f"names: expected each once, got {', '.join(twice)} more often")
        times = _array("times", self.times, (None,))
        if not len(times):
            raise InputError("times: expected one frame or more, got none")
        back = np.flatnonzero(~(np.diff(times) > 0))
        if not np.isfinite(times).all() or len(back):
            at = int(back[0]) + 1 if len(back) else int(np.flatnonzero(~np.isfinite(times))[0])
            raise InputError(f"times: expected ascending seconds, got {times[at]:g} at frame {at}")
        self._keep("names", names)
        self._keep("times", times)
        self._keep("weights", _array("weights", self.weights, (len(times), len(names))))
        for name, width in _ANGLES.items():
            if getattr(self, name) is not None:
                self._keep(name, _array(name, getattr(self, name), (len(times), width)))
        extra = {str(name): np.asarray(column) for name, column in self.extra.items()}
        for name, column in extra.items():
            if column.shape != times.shape:
                raise InputError(f"extra: {name}: expected shape {times.shape}, got {column.shape}")
        self._keep("extra", MappingProxyType(extra))
        self._keep("about", MappingProxyType(dict(self.about)))

    def __len__(self) -> int:
        return len(self.times)

    def __reduce__(self) -> tuple:                  # mapping proxies cannot be pickled
        return Performance, (self.times, self.names, self.weights, self.vocabulary, self.head, self.place, self.gaze,
                             dict(self.extra), dict(self.about), self.warnings)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return float(self.times[-1] - self.times[0])

    @property
    def rate(self) -> float:
        """Frames a second, by the middle interval; 0 for a single frame."""
        return 1.0 / float(np.median(np.diff(self.times))) if len(self) > 1 else 0.0

    @property
    def found(self) -> NDArray[np.bool_]:
        """Which frames (n,) have any weight."""
        return np.isfinite(self.weights).any(axis=1)

    def column(self, name: str) -> NDArray[np.float64]:
        """Return the weights (n,) of a shape; InputError for one that was not recorded."""
        if name not in self.names:
            raise InputError(f"name: the performance has no '{name}'{nearest(str(name), self.names)}")
        return self.weights[:, self.names.index(name)]

    def frame(self, k: int) -> dict[str, float]:
        """Return shape -> weight of frame k, without those that are missing there."""
        return {name: weight for name, weight in zip(self.names, self.weights[k].tolist(), strict=True)
                if weight == weight}

    def _keep(self, name: str, value: object) -> None:
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(self, name, value)


def _array(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return a copy as numbers of a shape, where None is any length."""
    try:
        result = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected numbers, got {type(values).__name__}: {error}") from None
    if len(result.shape) != len(shape) or any(want not in (None, got) for want, got in zip(shape, result.shape,
                                                                                         strict=True)):
        wanted = ", ".join("n" if want is None else str(want) for want in shape)
        raise InputError(f"{name}: expected shape ({wanted}{',' if len(shape) == 1 else ''}), got {result.shape}")
    if np.isinf(result).any():
        raise InputError(f"{name}: expected finite numbers or NaN, got {int(np.isinf(result).sum())} infinite")
    return result
