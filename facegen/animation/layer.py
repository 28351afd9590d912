"""What a clip is laid of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from facegen.animation.clip import Pose


class Layer(Protocol):
    """A `facegen.animation.clip.Track`, or speech (`facegen.animation.coarticulation.SpeechTrack`).

    optional: its raw data are left out on a face that lacks the points for them.
    """

    name: str
    optional: bool

    @property
    def end(self) -> float:
        """When it is over, seconds."""

    @property
    def begins(self) -> float:
        """When the last thing in it begins, seconds."""

    @property
    def corners(self) -> tuple[float, ...]:
        """Times that show how far it reaches, seconds."""

    @property
    def poses(self) -> tuple[Pose, ...]:
        """Every pose in it."""

    def shares(self, t: float) -> list[tuple[float, Pose]]:
        """Return the poses that are there at a time, each with its strength 0..1."""

    def fades(self, t: float) -> list[tuple[str | frozenset[str], float]]:
        """Return which atoms below fade at a time, or "all", and to what share."""

    def mirrored(self) -> Layer:
        """Return the same with left and right changed."""
