"""One page of the studio: its work, its history, its picture and its panels.

A panel is told when the work changes (`Panel.refresh`) and changes it through `Page.change`; it never talks to another.
All that a browser sends arrives in `Page.calls`: one at a time, faults told to the person and never to viser.
"""

from __future__ import annotations

import functools
import inspect
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

from facegen.errors import FacegenError
from facegen.facs.expression_table import Person
from facegen.facs.expressions import Resolution
from facegen.studio.desk import Desk
from facegen.studio.history import History
from facegen.studio.stage import Stage
from facegen.studio.steps import Steps
from facegen.studio.work import FaceWork, Work

log = logging.getLogger("facegen.studio")

FACE = "face"
"""The figure that shows the page's face."""

_DRAWN = 0.1            # seconds
_CLOSES = 8.0           # seconds until a notice goes
_AGAIN = 4.0            # seconds until the same may be said again: a drag asks for it sixty times a second


class Panel(Protocol):
    """What `Page` asks of a panel; made by ``Kind(page)`` inside its tab."""

    def refresh(self, work: Work) -> None:
        """Show a work that may have changed; called with the page's lock held."""

    def close(self) -> None:
        """Stop what runs: the page is closed."""


class Page:
    """``client``: viser's handle; ``name``: of the work; ``desk``; ``stage``; ``rig``: the face that is shown.

    panels: title of the tab -> what makes its panel from the page. changed: called with the page and its work after
    each change that was made here, the page's lock held.
    """

    def __init__(self, client: Any, name: str, desk: Desk, panels: dict[str, Callable[[Page], Panel]],
                 changed: Callable[[Page, Work], None] = lambda page, work: None) -> None:
        self.client, self.name, self.desk = client, name, desk
        self._tell = changed
        self.lock = threading.RLock()
        self.closed = False
        self._said = "", "", 0.0
        work, told = desk.store.load(name)
        self.history = History(work)
        self.stage = Stage(client, self.fault)
        self.rig: Any = None
        self._shown: FaceWork | None = None
        self._meant: tuple[Any, Resolution] | None = None
        self._panels: list[Panel] = []
        client.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large",
                                   brand_color=(176, 92, 72))
        client.gui.main_panel.dock_right()
        if told:
            self.say(told, "Your work could not be read", colour="red", closes=None)
        with self.lock:
            self._set_face(work.face)
            self._steps = Steps(self)
            tabs = client.gui.add_tab_group()
            for title, make in panels.items():
                with tabs.add_tab(title):
                    self._panels.append(make(self))
            self._refresh()

    @property
    def work(self) -> Work:
        """The work as it is."""
        return self.history.work

    # -- changes ------------------------------------------------------------------------------------------------
    def change(self, label: str, *, thing: str | None = None, **sections: Any) -> None:
        """Replace sections of the work, say what was done, and show it.

        label: for the undo button. thing: what was changed; see `History.change`. InputError if a section will not do:
        the work then stays as it was.
        """
        with self.lock:
            for section in sections.values():
                section.checked()
            work = replace(self.work, **sections)
            if work.face.person != self.work.face.person:
                self.desk.person(work.face.person, self.name)
            if work.face.rig != self.work.face.rig:
                self.desk.face(work.face.rig, self.name, wait=lambda why: self.say(why, "One moment"))
            if self.history.change(label, work, thing=thing):
                self._changed()

    def undo(self) -> None:
        """Take back one step."""
        with self.lock:
            self.history.undo()
            self._changed()

    def redo(self) -> None:
        """Do again one step."""
        with self.lock:
            self.history.redo()
            self._changed()

    def refresh(self) -> None:
        """Have all panels show the work: what they choose beside it has changed."""
        with self.lock:
            self._refresh()

    def faces_changed(self) -> None:
        """Show the page's face anew, and the names of the others: files of faces have changed."""
        with self.lock:
            self._shown = None
            self._set_face(self.work.face)
            self._refresh()

    def follow(self) -> None:
        """Take over what was changed on another page of the same work: what is saved last holds on all."""
        with self.lock:
            work, _ = self.desk.store.load(self.name)
            if self.history.change("a change in another window", work, thing="another window"):
                self._set_face(work.face)
                self._refresh()

    def _changed(self) -> None:
        if self.closed:         # a Task that ends late: the page that was loaded since has the work
            return
        self.desk.store.save(self.name, self.work)
        self._set_face(self.work.face)
        self._refresh()
        self._tell(self, self.work)

    def _refresh(self) -> None:
        self._steps.refresh(self.history)
        for panel in self._panels:
            panel.refresh(self.work)

    # -- the picture --------------------------------------------------------------------------------------------
    def _set_face(self, face: FaceWork) -> None:
        """Show a face's work, another rig if need be."""
        if self._shown is None or face.rig != self._shown.rig or self.rig is None:
            try:
                self.rig = self.desk.face(face.rig, self.name, wait=lambda why: self.say(why, "One moment"))
            except FacegenError as error:           # a rigged avatar whose file went away
                self.say(f"{error}; the base face is shown instead.", "That face is gone", colour="red")
                self.rig = self.desk.face(FaceWork().rig, self.name)
            self.stage.put(FACE, self.rig.mesh(), colours=self.rig.colours)
            self._shown = None
        if face != self._shown:
            self._shown = face
            self.show_face()

    def show_face(self) -> None:
        """Show the work's expression on the page's face; what a clip showed there ends."""
        rig, face = self.rig, self.work.face
        person = self.person()
        self.stage.request(FACE, lambda: rig.pose(face.meaning(person, rig)))

    def person(self) -> Person | None:
        """Return the person of the page's face as their file is now; nobody, with a notice, if it will not do."""
        try:
            return self.desk.person(self.work.face.person, self.name)
        except FacegenError as error:           # a person whose table went away or is broken
            self.say(f"{error}; the common table is used instead.", "That person is gone", colour="red")
            return None

    def meaning(self) -> Resolution:
        """Return what the page's face shows."""
        asked = self.work.face, self.person(), self.rig
        if self._meant is None or self._meant[0] != asked:
            self._meant = asked, self.work.face.meaning(*asked[1:])
        return self._meant[1]

    # -- the person ---------------------------------------------------------------------------------------------
    def calls(self, function: Callable[..., None]) -> Callable[[Any], None]:
        """Return a callback for viser that calls ``function(event)``, or ``function()`` if it takes nothing.

        What the program itself set calls nothing; a fault is told to the person.
        """
        takes = len(inspect.signature(function).parameters)

        @functools.wraps(function)
        def called(event: Any) -> None:
            if event.client is None:
                return
            with self.lock:
                try:
                    function(*(event,)[:takes])
                except Exception as error:
                    self.fault(error)
                    self._refresh()                 # what is shown is what is
            # The next value of a slider that is dragged is taken when this one is drawn: who works out values that
            # nobody sees takes the time of those that are seen. Not for long: a clip that plays never rests.
            self.stage.settle(_DRAWN)

        return called

    def fault(self, error: Exception) -> None:
        """Tell a fault: what was asked for cannot be, or facegen's own."""
        if isinstance(error, FacegenError):
            self.say(str(error), "That did not work", colour="red")
            return
        log.error("work %s: %s: %s", self.name, type(error).__name__, error, exc_info=error)
        self.say(f"{type(error).__name__}: {error}", "A fault of facegen's own; please report it", colour="red")

    def say(self, text: str, title: str = "", *, colour: str | None = None, closes: float | None = _CLOSES) -> None:
        """Show a notice; what was just said is not said again."""
        now = time.monotonic()
        if self._said[:2] != (title, text) or now - self._said[2] > _AGAIN:
            self._said = title, text, now
            self.client.add_notification(title, text, color=colour, auto_close_seconds=closes)

    def close(self) -> None:
        """End what runs and save."""
        self.closed = True
        for panel in self._panels:
            panel.close()
        self.stage.close()
        self.desk.store.flush()
