"""An expression by hand: named expressions, units, script, gaze; of any face and person."""

from __future__ import annotations

import random
import time
from dataclasses import replace

from facegen.facs.blend import blend
from facegen.facs.chance import random_expression
from facegen.studio.chain_view import ChainView
from facegen.studio.gaze_target import GazeTarget
from facegen.studio.page import Page
from facegen.studio.palette import Palette
from facegen.studio.script_box import ScriptBox
from facegen.studio.take_away import TakeAway
from facegen.studio.unit_sliders import UnitSliders
from facegen.studio.work import FaceWork, Work

_NOBODY = "nobody in particular"
_LISTED = 1.0           # seconds until folders are looked at again
_SEEDS = 10_000         # short to write down


class FacePanel:
    """An expression by hand."""

    def __init__(self, page: Page) -> None:
        self.page = page
        gui, face = page.client.gui, page.work.face
        self._do = gui.add_button_group("Start from", ("by chance", "at rest"),
                                        hint="An expression by chance that looks like one; or the face at rest.")
        self._do.on_click(page.calls(lambda: self._chance() if self._do.value == "by chance" else self._reset()))
        self._seed = gui.add_number("Chance", 0, min=0, max=_SEEDS - 1, step=1, visible=False,
                                    hint="The number of this expression by chance: the same number gives the same.")
        self._seed.on_update(page.calls(lambda: self._chance(self._seed.value)))
        self._intensity = gui.add_slider("Intensity", 0.0, 1.0, 0.01, face.intensity, marks=(),
                                         hint="Of all that moves, the gaze at a point apart.")
        self._intensity.on_update(page.calls(self._scaled))
        self._script = ScriptBox(page)
        self._palette = Palette(page)
        with gui.add_folder("Action units"):
            self._units = UnitSliders(page)
        with gui.add_folder("Where the eyes look"):
            self._gaze = GazeTarget(page)
        self._chain = ChainView(page)
        with gui.add_folder("Face and person"):
            self._rig = gui.add_dropdown("Face", page.desk.face_names(page.name), initial_value=face.rig,
                                         hint="Whose face shows it: a parametric face, or an avatar with blendshapes.")
            self._person = gui.add_dropdown("Person", self._people(), initial_value=face.person or _NOBODY,
                                            hint="Whose habits: what happiness looks like on them.")
        self._rig.on_update(page.calls(self._other_face))
        self._person.on_update(page.calls(self._other_person))
        self._take = TakeAway(page)
        self._listed = -_LISTED
        gui.add_command("Expression by chance").on_trigger(page.calls(self._chance))
        gui.add_command("Face at rest").on_trigger(page.calls(self._reset))

    def _people(self) -> tuple[str, ...]:
        person = self.page.work.face.person
        return tuple(dict.fromkeys([_NOBODY, *self.page.desk.people(self.page.name), *([person] if person else [])]))

    # -- what the person does -----------------------------------------------------------------------------------
    def _chance(self, seed: int | None = None) -> None:
        seed = random.randrange(_SEEDS) if seed is None else int(seed)
        self._seed.value, self._seed.visible = seed, True
        self.page.change(f"by chance, {seed}", thing="chance",
                         face=replace(self.page.work.face, units=random_expression(seed), blend={}, raw={}))

    def _reset(self) -> None:
        face = self.page.work.face
        self.page.change("at rest", face=FaceWork(rig=face.rig, person=face.person, apart=face.apart))

    def _scaled(self) -> None:
        self.page.change("intensity", thing="intensity",
                         face=replace(self.page.work.face, intensity=self._intensity.value))

    def _other_face(self) -> None:
        self.page.change(f"face {self._rig.value}", face=replace(self.page.work.face, rig=self._rig.value))

    def _other_person(self) -> None:
        face = self.page.work.face
        person = None if self._person.value == _NOBODY else self._person.value
        someone = self.page.desk.person(person, self.page.name)
        units = blend(face.blend, person=someone) if face.blend else face.units
        self.page.change(f"person {self._person.value}", face=replace(face, person=person, units=units))

    # -- what is shown ------------------------------------------------------------------------------------------
    def refresh(self, work: Work) -> None:
        """Show a work."""
        face = work.face
        # Other tabs make faces and people.
        if time.monotonic() - self._listed > _LISTED or face.rig not in self._rig.options:
            self._listed = time.monotonic()
            names, people = self.page.desk.face_names(self.page.name), self._people()
            if tuple(self._rig.options) != names:
                self._rig.options = names
            if tuple(self._person.options) != people:
                self._person.options = people
        self._rig.value = face.rig
        self._person.value = face.person or _NOBODY
        self._intensity.value = face.intensity
        self._palette.refresh(work)
        self._units.refresh(face)
        self._gaze.refresh(face)
        self._script.refresh(work)
        self._chain.refresh(work)
        self._take.refresh(work)

    def close(self) -> None:
        """End what runs beside the page."""
        self._palette.close()
        self._chain.close()
