"""Choices about how expressions go over: seen at once on what they change."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from facegen.studio.avatar_checks import LID_CLOSURE, OPENING
from facegen.studio.page import Page
from facegen.studio.work import AvatarWork
from facegen.transfer.solve import OURS, Weights

LOOKS = {"The face's expression": None, "Jaw open": "27D", "Eyes shut": "43E", "Happiness": "happiness",
         "Surprise": "surprise", "Anger": "anger"}
"""What can be looked at while tuning: label -> expression, None for the page's."""

_WEIGHTS = {
    "gradients": "How the skin stretches and turns",
    "landmarks": "How far the points of step 2 move",
    "anchor": "How far everything else moves",
    "smooth": "How evenly it moves",
    "identity": "How strongly it stays as it is",
}
_MOST = 1000.0


class TuningView:
    """The controls, made where the panel stands. ``look``: the expression that shows what is tuned, or None."""

    def __init__(self, page: Page) -> None:
        self.page = page
        gui, calls = page.client.gui, page.calls
        self.told = gui.add_markdown("")
        self._look = gui.add_dropdown("Look at", tuple(LOOKS), initial_value=next(iter(LOOKS)))
        self._look.on_update(calls(lambda: page.refresh()))
        self._opening = gui.add_slider("Mouth opens", *OPENING, 0.05, initial_value=1.0,
                                       hint="How far the jaw opens; 1 is as far as facegen thinks right.")
        self._closure = gui.add_slider("Lids close", *LID_CLOSURE, 0.05, initial_value=1.0,
                                       hint="How far lids close; at 1 they meet.")
        self._opening.on_update(calls(lambda: self._tuned("opening", self._opening, "Jaw open")))
        self._closure.on_update(calls(lambda: self._tuned("lid_closure", self._closure, "Eyes shut")))
        with gui.add_folder("Weights of the transfer", expand_by_default=False):
            gui.add_markdown("For those who know the energies: see docs/transfer.md. Larger counts more.")
            self._weights = {}
            for one in fields(Weights):
                box = gui.add_number(one.name.capitalize(), initial_value=getattr(OURS, one.name), min=0.0, max=_MOST,
                                     step=0.001, hint=_WEIGHTS[one.name])
                box.on_update(calls(self._weighed))
                self._weights[one.name] = box
            self._ours = gui.add_button("Back to ours", color="gray")
            self._ours.on_click(calls(lambda: self._change("weights", {})))

    @property
    def look(self) -> str | None:
        """What is looked at."""
        return LOOKS[self._look.value]

    def refresh(self, work: AvatarWork) -> None:
        """Show a work."""
        self._opening.value, self._closure.value = work.opening, work.lid_closure
        for name, box in self._weights.items():
            box.value = float(work.weights.get(name, getattr(OURS, name)))
        self._ours.visible = bool(work.weights)

    def _tuned(self, name: str, slider: Any, shows: str) -> None:
        # A neutral face would show nothing of it.
        if self.look is None and not self.page.work.face.units:
            self._look.value = shows
        self._change(name, float(slider.value))

    def _weighed(self) -> None:
        given = {name: float(box.value) for name, box in self._weights.items()}
        self._change("weights", {name: value for name, value in given.items() if value != getattr(OURS, name)})

    def _change(self, name: str, value: Any) -> None:
        self.page.change(f"tune {name.replace('_', ' ')}", thing=f"avatar {name}",
                         avatar=replace(self.page.work.avatar, **{name: value}))
