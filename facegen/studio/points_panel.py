"""Feature points, the raw level of 1986: shown on the face, dragged, and saved as deformation data."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from facegen.errors import InputError
from facegen.face.face import Face
from facegen.face.reach import Grip
from facegen.facs.deformation import Deformation, read_deformation
from facegen.facs.expressions import resolve
from facegen.facs.yamlfile import parse_bytes
from facegen.facs.yamltext import yaml_text
from facegen.studio import raw as raws
from facegen.studio.page import FACE, Page
from facegen.studio.points_overlay import REGIONS, PointsOverlay, map_of
from facegen.studio.raw_sliders import Number, RawSliders
from facegen.studio.task import Task
from facegen.studio.work import Work

_NONE = "(none)"
_UNITS = {"millimetre": "millimetres", "face": "fractions of the face", "paper": "half head heights (1986)"}
_WHAT = ("what was moved here", "the whole pose, action units too")
_SOURCE = "facegen studio"

_HOW = ("**Drag a point and the skin follows** - the level below action units, as in 1986. What you do here is added "
        "to the expression. Left and right are the subject's.")
_AVATAR = ("**{name} has no feature points.** It is an avatar: it moves by its blendshapes, not by points of a cage. "
           "Choose a face with points to drag them; what you move there is shown on the avatar, too, as well as its "
           "shapes can.")


class PointsPanel:
    """Feature points, the raw level of 1986."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self._overlay: PointsOverlay | None = None
        self._chosen: str | None = None
        self._drag: tuple[Grip, Any] | None = None          # what is dragged, and from the mouse to the point
        self._latest: Any = None
        gui, calls = page.client.gui, page.calls
        self._told = gui.add_markdown(_HOW)
        self._base = gui.add_button("Show the base face", visible=False)
        self._base.on_click(calls(self._to_base))
        self._paper = gui.add_button("Show the face of 1986, with its 15 points", visible=False)
        self._paper.on_click(calls(self._to_paper))
        self._shown = gui.add_checkbox("Show feature points", False)
        self._shown.on_update(calls(self._show))
        self._regions = gui.add_dropdown("Regions", REGIONS, initial_value=REGIONS[0], hint=(
            "Each is bounded by three points, and every place of it moves with those three."))
        self._regions.on_update(calls(self._show_regions))
        self._inner = gui.add_checkbox("Show centre O and the jaw's axis", False)
        self._inner.on_update(calls(self._show_inner))
        self._mirrored = gui.add_checkbox("Both sides together", True, hint="The point on the other side moves as the "
                                          "mirror image; a point in the middle stays there.")
        self._point = gui.add_dropdown("Point", (_NONE,), initial_value=_NONE)
        self._point.on_update(calls(self._choose_listed))
        self._vector = gui.add_vector3("Moved by hand (mm)", (0.0, 0.0, 0.0), step=0.1,
                                       hint="To the subject's left, up, forward.")
        self._vector.on_update(calls(self._entered))
        self._says = gui.add_markdown("")
        self._reset = gui.add_button_group("Put back", ("this point", "all points", "everything here"))
        self._reset.on_click(calls(self._put_back))
        with gui.add_folder("Jaw, lids, eyes and head", expand_by_default=False):
            self._numbers = RawSliders(gui, calls, self._number)
        with gui.add_folder("As a file", expand_by_default=False):
            self._units = gui.add_dropdown(
                "Measured in", tuple(_UNITS.values()), initial_value=_UNITS[raws.FIRST_UNITS],
                hint="Fractions fit any face: they are parts of the face's own distances.")
            self._units.on_update(calls(self._convert))
            self._what = gui.add_dropdown("Save", _WHAT, initial_value=_WHAT[0])
            gui.add_button("Download deformation data").on_click(calls(self._download))
            self._upload = gui.add_upload_button("Open deformation data", mime_type=".yaml,.yml,.json")
            self._upload.on_upload(calls(self._opened))
        self._stop = page.stage.on_shown(FACE, self._ride)

    # -- showing ------------------------------------------------------------------------------------------------
    @property
    def _face(self) -> Face | None:
        """The page's face, if it is one with points."""
        return self.page.rig if isinstance(self.page.rig, Face) else None

    def refresh(self, work: Work) -> None:
        """Show a work."""
        face, raw = self._face, work.face.raw
        self._dress(face)
        for handle in (self._shown, self._regions, self._inner, self._point, self._vector, self._reset, self._units):
            handle.visible = face is not None
        self._base.visible = self._paper.visible = face is None
        self._numbers.show(raw, face)
        if face is None:
            self._told.content, self._says.content = _AVATAR.format(name=work.face.rig), ""
            return
        strange = raws.strangers(raw, face)
        self._told.content = _HOW if not strange else (
            f"{_HOW}\n\n**{len(strange)} of the moved points are not on this face and left out** "
            f"({', '.join(strange[:4])}{' ...' if len(strange) > 4 else ''}); choose another face, or *Put back: all "
            "points*.")
        self._units.value = _UNITS[raws.deformation_of(raw).units]
        point = self._chosen
        vector = raws.vector_of(raw, face, point) if point else np.zeros(3)
        self._vector.disabled = point is None
        if np.abs(np.array(self._vector.value) - vector).max() > 5e-4:
            self._vector.value = tuple(round(float(x), 3) for x in vector)
        moved = frozenset(raws.deformation_of(raw).points)
        self._overlay.choose(point, moved, said(point, face) if point else "")
        self._say(work)

    def close(self) -> None:
        """Nothing runs."""
        self._stop()

    def _dress(self, face: Face | None) -> None:
        """Have an overlay for the page's face."""
        figure = self.page.stage.figures[FACE]
        if self._overlay is not None and (self._overlay.face is not face or self._overlay.figure is not figure):
            self._overlay.remove()
            self._overlay = None
        if self._overlay is None and face is not None:
            self._overlay = PointsOverlay(self.page.client.scene, face, figure, clicked=self.page.calls(self._clicked),
                                          grabbed=self._grabbed)
            self._point.options = (_NONE, *(said(name, face) for name in self._overlay.names))
            if self._chosen not in self._overlay.names:
                self._chosen = None
            self._point.value = said(self._chosen, face) if self._chosen else _NONE
            self._overlay.show_points(self._shown.value)
            self._overlay.show_inner(self._inner.value)
            if self._regions.value != REGIONS[0]:
                self._show_regions()

    def _ride(self, vertices: np.ndarray) -> None:
        overlay = self._overlay
        if overlay is not None and overlay.figure is self.page.stage.figures.get(FACE):
            overlay.ride(vertices)

    def _show(self) -> None:
        self._overlay.show_points(self._shown.value)
        self.refresh(self.page.work)

    def _show_inner(self) -> None:
        self._overlay.show_inner(self._inner.value)

    def _show_regions(self) -> None:
        overlay, how = self._overlay, self._regions.value
        if how == REGIONS[0]:
            overlay.show_regions(how)
            return

        def found(_: object) -> None:
            if self._overlay is overlay:
                overlay.show_regions(self._regions.value)

        Task(self.page, "Where the regions lie", lambda report: map_of(overlay.face), found)

    def _say(self, work: Work) -> None:
        point, face = self._chosen, self._face
        if point is None:
            self._says.content = "Click a point, or drag it." if self._shown.value else \
                "Show the feature points, then click one or drag it."
            return
        if not face.takes_input[list(face.feature_points).index(point)]:
            self._says.content = f"**{said(point, face)}** is fixed, or goes with the jaw alone: it takes no vector."
            return
        by_hand = float(np.linalg.norm(raws.vector_of(work.face.raw, face, point)))
        far = self._from_rest(work, point)
        self._says.content = (f"**{said(point, face)}** lies {far:.1f} mm from rest; {by_hand:.1f} mm were moved by "
                              "hand.")

    def _from_rest(self, work: Work, point: str) -> float:
        face = self._face
        person = self.page.person()
        grip = _grip(face, point)
        rest = face.point_weights()[[grip.row]] @ face.mesh().vertices
        return float(np.linalg.norm(grip.places(raws.controls_of(work.face, face, person), np.zeros(3)) - rest))

    # -- points -------------------------------------------------------------------------------------------------
    def _choose(self, point: str | None) -> None:
        self._chosen = point
        self._point.value = said(point, self._face) if point else _NONE
        self.refresh(self.page.work)

    def _choose_listed(self) -> None:
        names = {said(name, self._face): name for name in self._overlay.names}
        self._choose(names.get(self._point.value))

    def _clicked(self, event: Any) -> None:
        if event.instance_index is not None:
            self._choose(self._overlay.names[event.instance_index])

    def _grabbed(self, event: Any) -> None:
        """Take what the mouse does; viser's threads may bring it out of order, and what is late is passed over."""
        self._latest = event
        self.page.calls(self._dragged)(event)

    def _dragged(self) -> None:
        event, self._latest = self._latest, None
        if event is None:                           # a later one was taken already
            return
        overlay = self._overlay
        if overlay is None or event.instance_index is None:
            return
        name = overlay.names[event.instance_index]
        face, work = self._face, self.page.work.face
        if self._drag is None or self._drag[0].point != name:
            self._choose(name)
            grip = Grip(face, name, mirrored=self._mirrored.value)
            self._drag = grip, overlay.places()[name] - overlay.figure.unplace(event.start_position)
        grip, offset = self._drag
        if event.phase == "end":
            self._drag = None
        target = overlay.figure.unplace(event.end_position) + offset
        person = self.page.person()
        moved = raws.dragged(work, face, person, name, target, mirrored=self._mirrored.value, grip=grip)
        self.page.change(f"drag {name}", thing=f"point {name}", face=replace(work, raw=moved))

    def _entered(self) -> None:
        if self._chosen is not None:
            Grip(self._face, self._chosen)          # refuses a point that takes no vector
            self._raw(f"move {self._chosen}", raws.with_vector(
                self.page.work.face.raw, self._face, self._chosen, self._vector.value, mirrored=self._mirrored.value),
                thing=f"point {self._chosen}")

    def _put_back(self) -> None:
        what, raw = self._reset.value, self.page.work.face.raw
        found = raws.deformation_of(raw)
        if what == "everything here":
            self._raw("put everything back", Deformation(units=found.units).as_dict())
        elif what == "all points":
            self._raw("put all points back", replace(found, points={}).as_dict())
        elif self._chosen is None:
            raise InputError("point: none is chosen; click one, then put it back")
        else:
            self._raw(f"put {self._chosen} back", raws.with_vector(raw, self._face, self._chosen, np.zeros(3),
                                                                   mirrored=self._mirrored.value))

    def _number(self, one: Number, value: float) -> None:
        self._raw(one.label, raws.with_number(self.page.work.face.raw, self._face, one.kind, one.key, value,
                                              mirrored=self._mirrored.value), thing=f"raw {one.kind}.{one.key}")

    def _raw(self, label: str, raw: raws.Raw, *, thing: str | None = None) -> None:
        self.page.change(label, thing=thing, face=replace(self.page.work.face, raw=raw))

    def _to_base(self) -> None:
        self.page.change("base face", face=replace(self.page.work.face, rig="akimoto"))

    def _to_paper(self) -> None:
        self.page.change("face of 1986", face=replace(self.page.work.face, rig="akimoto-1986"))

    # -- files --------------------------------------------------------------------------------------------------
    def _convert(self) -> None:
        units = {text: name for name, text in _UNITS.items()}[self._units.value]
        self._raw(f"measure in {self._units.value}", raws.in_units(self.page.work.face.raw, self._face, units))

    def _download(self) -> None:
        work, face = self.page.work.face, self._face
        deformation = raws.deformation_of(work.raw)
        about = f"Made by hand on the face {work.rig}."
        if self._what.value == _WHAT[1]:
            meaning = self.page.meaning()
            deformation = raws.whole_pose(face, meaning.deformation, *meaning.more, units=deformation.units)
            about = f"{work.script}, and what was moved by hand on the face {work.rig}."
        if not deformation:
            raise InputError("file: nothing is moved here yet, so there is nothing to save")
        text = yaml_text({"about": about, "source": _SOURCE, **deformation.as_dict()})
        self.page.client.send_file_download("deformation.yaml", text.encode(), save_immediately=True)

    def _opened(self) -> None:
        file = self._upload.value
        raw = read_raw(file.name, file.content)
        if self._face is not None:
            raw = raws.with_own_names(raw, self._face)
        self.page.rig.check(resolve(raws.deformation_of(raw)))
        self._raw(f"open {file.name}", raw)
        self.page.say(f"{file.name} is shown, on top of the action units.", "Deformation data opened")


def said(point: str, face: Face) -> str:
    """Return a feature point's name for a reader, with the paper's name.

    >>> from facegen import load_face
    >>> said("mouth_corner_L", load_face())
    'Mouth corner, left (F8)'
    """
    words = point.replace("_", " ")
    for end, side in ((" L", ", left"), (" R", ", right")):
        if words.endswith(end):
            words = words.removesuffix(end) + side
    paper = face.paper_names.get(point)
    return words[0].upper() + words[1:] + (f" ({paper})" if paper else "")


@lru_cache(maxsize=8)
def _grip(face: Face, point: str) -> Grip:
    return Grip(face, point)


def read_raw(name: str, content: bytes) -> raws.Raw:
    """Return the raw data of a deformation file's content; FileError or TableError names file and place."""
    return read_deformation(parse_bytes(content, name), name)[0].as_dict()
