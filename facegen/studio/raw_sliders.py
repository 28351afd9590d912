"""The numbers of raw movements beside the points: jaw, lids, eyes, head."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from facegen.face.face import Face
from facegen.studio.raw import Raw, deformation_of, number_of


@dataclass(frozen=True)
class Number:
    """One slider: key of a deformation, what it says, from where to where, in steps of ``step``."""

    kind: str
    key: str
    label: str
    low: float
    high: float
    step: float
    length: bool = False            # in millimetres, which only a parametric face has


NUMBERS = (
    Number("jaw", "open", "Jaw opens (degrees)", 0.0, 30.0, 0.5),
    Number("jaw", "side", "Jaw to the subject's left (mm)", -8.0, 8.0, 0.1, True),
    Number("jaw", "forward", "Jaw forward (mm)", -6.0, 8.0, 0.1, True),
    Number("lids", "upper_L", "Upper lid, left (1 = closed)", -0.6, 1.0, 0.01),
    Number("lids", "upper_R", "Upper lid, right", -0.6, 1.0, 0.01),
    Number("lids", "lower_L", "Lower lid, left", -0.4, 1.0, 0.01),
    Number("lids", "lower_R", "Lower lid, right", -0.4, 1.0, 0.01),
    Number("eyes", "yaw_L", "Left eye to the left (degrees)", -40.0, 40.0, 0.5),
    Number("eyes", "yaw_R", "Right eye to the left", -40.0, 40.0, 0.5),
    Number("eyes", "pitch_L", "Left eye up", -30.0, 30.0, 0.5),
    Number("eyes", "pitch_R", "Right eye up", -30.0, 30.0, 0.5),
    Number("head", "yaw", "Head turns to the left (degrees)", -60.0, 60.0, 0.5),
    Number("head", "pitch", "Head lifts", -45.0, 45.0, 0.5),
    Number("head", "roll", "Head tilts to the left", -45.0, 45.0, 0.5),
    Number("head", "forward", "Head forward (mm)", -40.0, 40.0, 0.5, True),
)


class RawSliders:
    """One slider for each of `NUMBERS`. changed: called with the number and its new value."""

    def __init__(self, gui: Any, calls: Callable[..., Any], changed: Callable[[Number, float], None]) -> None:
        self._sliders = []
        for one in NUMBERS:
            slider = gui.add_slider(one.label, one.low, one.high, one.step, 0.0)
            slider.on_update(calls(self._entered(slider, one, changed)))
            self._sliders.append((one, slider))

    @staticmethod
    def _entered(slider: Any, one: Number, changed: Callable[[Number, float], None]) -> Callable[[], None]:
        return lambda: changed(one, slider.value)

    def show(self, raw: Raw, face: Face | None) -> None:
        """Show raw data. face: None for an avatar, which has no millimetres of its own to say lengths in."""
        found = deformation_of(raw)
        for one, slider in self._sliders:
            slider.disabled = one.length and face is None
            value = min(max(number_of(found, face, one.kind, one.key), one.low), one.high)
            if abs(slider.value - value) > one.step / 100:
                slider.value = value
