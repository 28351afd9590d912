"""Placing landmarks by clicks: what is asked for, the marks, and what can be done with them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from facegen.face.landmarks import OPTIONAL, REQUIRED
from facegen.studio import picker_words as words
from facegen.studio import picking
from facegen.studio.avatar_scene import AvatarScene
from facegen.studio.guide import SIZE, guide, room_of, view_of
from facegen.studio.landmark_words import ORDER, VIEWS, WORDS
from facegen.studio.latest import Latest
from facegen.studio.markers import BLUE, GREEN, ORANGE, Mark, Markers
from facegen.studio.page import Page
from facegen.studio.picking import place
from facegen.studio.proposing import Advice, Adviser, adviser_of
from facegen.studio.task import Stopped
from facegen.studio.work import AvatarWork, Work

_NEXT = "the next one"
# Of a part's reach, and mm: large enough to be hit, small enough not to hide what it marks.
_BALL, _LARGEST = 0.022, 1.8
# The least certain proposal is still to be seen.
_FAINTEST = 0.3
_EMPTY = np.full((SIZE, SIZE, 3), 236, np.uint8)


class PickerView:
    """The controls of step 2, made where the panel stands."""

    def __init__(self, page: Page, scene: AvatarScene) -> None:
        self.page, self.scene = page, scene
        self.chosen: str | None = None
        self.proposals = Advice()
        self._adviser: Adviser | None = None
        self._known: Any = None                 # what the proposals are of, or will be
        self._asked: tuple[str, ...] = ()       # what the picture was turned to
        self._shown: str | None = None          # whose guide is shown
        self._reach = room_of("whole")[1]
        self._listens = False
        self._stamp: Any = None                 # what is shown
        self._question: Any = None              # what is asked for, and of which work
        self.markers = Markers(
            page.client.scene, lambda name: page.calls(lambda event: self._dragged(name, event)))
        self._thinking = Latest("proposals", page.fault)
        self._drawing = Latest("guide", page.fault)
        self._make(page.client.gui)

    def _make(self, gui: Any) -> None:
        calls = self.page.calls
        self._on = gui.add_checkbox("Place points by clicking", False, hint="Click on the avatar in the picture. Drag "
                                    "beside it to turn the picture, use the wheel to come closer.")
        self._on.on_update(calls(self._switched))
        self._ask = gui.add_markdown("")
        self._guide = gui.add_image(_EMPTY, format="png", visible=False)
        self._bar = gui.add_progress_bar(0.0)
        self._take = gui.add_button("Take this proposal", hint="The orange ball is where this point probably is.")
        self._take.on_click(calls(self._take_one))
        self._all = gui.add_button("Take all proposals", hint="The blue balls become points; each can still be moved.")
        self._all.on_click(calls(self._take_all))
        self._skip = gui.add_button("Skip this point", color="gray",
                                    hint="Optional points make the result better, but need not be.")
        self._skip.on_click(calls(self._skip_one))
        self._rest = gui.add_button("Skip the optional points", color="gray")
        self._rest.on_click(calls(self._skip_rest))
        self._faults = gui.add_markdown("", visible=False)
        labels = [_NEXT, *(WORDS[name].label for name in ORDER)]
        self._point = gui.add_dropdown("Point", labels, initial_value=_NEXT, hint="Choose a point to place it "
                                       "anew. Clicking on a ball in the picture chooses it too.")
        self._point.on_update(calls(self._choose))
        self._remove = gui.add_button("Remove this point", color="gray")
        self._remove.on_click(calls(self._remove_one))
        self._both = gui.add_checkbox("Move both sides together", True, hint="A point that is moved takes its partner "
                                      "on the other side along, mirrored.")
        self._both.on_update(calls(self._symmetric))
        self._follow = gui.add_checkbox("Turn the picture to each point", True)
        self._look = gui.add_button_group("Look at", tuple(VIEWS.values()))
        self._look.on_click(calls(self._looked))
        with gui.add_folder("All points", expand_by_default=False):
            self._list = gui.add_markdown("")

    # -- what is shown ------------------------------------------------------------------------------------------
    @property
    def on(self) -> bool:
        """Whether points are being placed."""
        return self.wishes and self.scene.figure is not None

    @property
    def wishes(self) -> bool:
        """Whether the person wishes to place points, be there an avatar or not."""
        return bool(self._on.value)

    @property
    def _looks(self) -> bool:
        """Whether a face is still being looked for."""
        return self._adviser is None or not self._adviser.ready

    def start(self) -> None:
        """Begin to place points."""
        self._on.value = True

    def stop(self) -> None:
        """Place no more points."""
        self._on.value = False

    def forget(self) -> None:
        """Another avatar has come: nothing is known of it."""
        self.chosen, self._adviser, self._known, self._asked = None, None, None, ()
        self.proposals = Advice()

    def wanted(self, work: AvatarWork) -> str | None:
        """Return the point that is asked for."""
        # Advice that comes later does not change the question that a person is about to answer.
        of = (work.file, work.landmarks, work.skipped, self.chosen)
        if self._question is None or self._question[0] != of:
            self._question = of, picking.wanted(work, chosen=self.chosen, advised=self.proposals.advised)
        return self._question[1]

    def refresh(self, work: Work) -> None:
        """Show a work."""
        self._both.value = work.avatar.symmetric
        stamp = (work.avatar, self.scene.figure, self.on, self.proposals, self.chosen)
        if stamp == self._stamp:                # a slider of the face that is dragged changes nothing of this
            return
        self._stamp = stamp
        self._listen(self.on)
        self._think(work.avatar)
        self.show(work.avatar)

    def show(self, avatar: AvatarWork) -> None:
        """Show points, proposals and what is asked for."""
        on, name = self.on, self.wanted(avatar)
        self._point.value = _NEXT if self.chosen is None else WORDS[self.chosen].label
        self._ask.content = words.question(avatar, name, self.proposals, on=on, looks=self._looks)
        self._bar.value = 100.0 * words.done(avatar) / len(REQUIRED)
        proposed = name in self.proposals.places and name not in avatar.landmarks
        for handle, visible in (
                (self._take, on and proposed), (self._all, on and bool(self._open_proposals(avatar))),
                (self._skip, on and name in OPTIONAL and name not in avatar.landmarks),
                (self._rest, on and name in OPTIONAL), (self._remove, on and name in avatar.landmarks),
                (self._point, on), (self._both, on), (self._follow, on), (self._look, on), (self._bar, on),
                (self._guide, on and name is not None)):
            handle.visible = visible
        self._all.label = f"Take all proposals ({len(self._open_proposals(avatar))})"
        self._faults.content = words.faults(self.proposals)
        self._faults.visible = on and bool(self._faults.content)
        self._list.content = words.listed(avatar, self.proposals.places)
        if on and name is not None and name != self._shown:
            self._shown = name
            self._drawing.ask(lambda: self._draw_guide(name))
        if on:
            self._turn(avatar, name)
        self._show_marks(avatar, name, on)

    def _show_marks(self, avatar: AvatarWork, wanted: str | None, on: bool) -> None:
        marks: dict[str, Mark] = {}
        figure = self.scene.figure
        if on and figure is not None:
            for name, at in self.scene.at(self._open_proposals(avatar)).items():
                sure = _FAINTEST + (1.0 - _FAINTEST) * self.proposals.confidence.get(name, 0.0)
                marks[name] = Mark(figure.place(at), ORANGE if name == wanted else BLUE, sure)
            for name, at in self.scene.at(avatar.landmarks).items():
                marks[name] = Mark(figure.place(at), ORANGE if name == wanted else GREEN)
        self.markers.show(marks, min(_BALL * self._reach, _LARGEST))

    def _open_proposals(self, avatar: AvatarWork) -> dict[str, picking.Place]:
        return {name: one for name, one in self.proposals.places.items()
                if name not in avatar.landmarks and not avatar.skipped.get(name)}

    def _draw_guide(self, name: str) -> None:
        picture = guide(name)
        with self.page.lock:
            if self._shown == name:
                self._guide.image = picture

    # -- the picture --------------------------------------------------------------------------------------------
    def _turn(self, avatar: AvatarWork, name: str | None) -> None:
        """Turn the picture to the part of the point that is asked for, once."""
        # A face that was found is looked at as a whole first.
        whole = name is None or (words.is_found(avatar, self.proposals) and self.chosen is None)
        part = "whole" if whole else WORDS[name].part
        name = None if whole else name
        known = name in avatar.landmarks or name in self.proposals.places
        asked = (part, str(view_of(name)) if name else "", str(known))
        if asked == self._asked or not (self._follow.value or not self._asked):
            return
        self._asked = asked
        self._look_at(part, avatar, name)

    def _look_at(self, part: str, avatar: AvatarWork, name: str | None = None) -> None:
        # Where nothing is known of a point the whole head is looked at: there it is, wherever it is.
        at = self.scene.at({**self.proposals.places, **avatar.landmarks})
        self._reach = self.scene.look(part if name is None or name in at else "whole", at, name)

    def _looked(self) -> None:
        part = next(key for key, label in VIEWS.items() if label == self._look.value)
        self._look_at(part, self.page.work.avatar)
        self.show(self.page.work.avatar)

    def _listen(self, on: bool) -> None:
        """Have clicks in the picture called back, or not: only while points are placed."""
        if on and not self._listens:
            self._clicked_call = self.page.calls(self._clicked)
            self.page.client.scene.on_click()(self._clicked_call)
        elif not on and self._listens:
            self.page.client.scene.remove_click_callback(self._clicked_call)
        self._listens = on

    def _clicked(self, event: Any) -> None:
        """Place what is asked for where the person clicked, or choose the ball that was clicked on."""
        avatar, name = self.page.work.avatar, self.wanted(self.page.work.avatar)
        hit = self.scene.pick(event.ray_origin, event.ray_direction)
        depth = np.inf if hit is None else float(np.linalg.norm(
            self.scene.figure.place(hit.point) - np.asarray(event.ray_origin)))
        ball = self.markers.hit(event.ray_origin, event.ray_direction, depth)
        if ball is not None and ball != name and not (name and picking.may_meet(name, ball)):
            self.chosen = ball
            self.show(avatar)
        elif hit is not None and name is not None:
            self._place(name, place(hit.face, hit.barycentric), "place")

    def _dragged(self, name: str, event: Any) -> None:
        """Move a point over the surface, under the pointer."""
        origin = np.asarray(self.page.client.camera.position, float)
        hit = self.scene.pick(origin, np.asarray(event.end_position, float) - origin)
        if hit is not None:
            self.markers.move(name, self.scene.figure.place(hit.point))
        if event.phase == "end":
            if hit is not None:
                self._place(name, place(hit.face, hit.barycentric), "move")
            else:                                           # beside the avatar: it goes back
                self.show(self.page.work.avatar)

    # -- steps --------------------------------------------------------------------------------------------------
    def _place(self, name: str, one: picking.Place, verb: str) -> None:
        avatar = self.page.work.avatar
        other = self._advise().mirrored(avatar, name, one) if avatar.symmetric else None
        self.chosen = None
        self.page.change(f"{verb} {WORDS[name].label}", avatar=picking.placed(avatar, name, one, other))

    def _take_one(self) -> None:
        avatar, name = self.page.work.avatar, self.wanted(self.page.work.avatar)
        self.chosen = None
        self.page.change(f"take {WORDS[name].label}", avatar=picking.taken(avatar, self.proposals.places, [name]))

    def _take_all(self) -> None:
        self.chosen = None
        self.page.change("take all proposals", avatar=picking.taken(self.page.work.avatar, self.proposals.places))

    def _skip_one(self) -> None:
        name = self.wanted(self.page.work.avatar)
        self.chosen = None
        self.page.change(f"skip {WORDS[name].label}", avatar=picking.skipped(self.page.work.avatar, name))

    def _skip_rest(self) -> None:
        self.chosen = None
        self.page.change("skip the optional points", avatar=picking.skipped_rest(self.page.work.avatar))

    def _remove_one(self) -> None:
        name = self.wanted(self.page.work.avatar)
        self.page.change(f"remove {WORDS[name].label}", avatar=picking.removed(self.page.work.avatar, name))

    def _choose(self) -> None:
        label = self._point.value
        self.chosen = next((name for name in ORDER if WORDS[name].label == label), None)
        self.show(self.page.work.avatar)

    def _symmetric(self) -> None:
        avatar = replace(self.page.work.avatar, symmetric=bool(self._both.value))
        self.page.change("move both sides together", avatar=avatar)

    def _switched(self) -> None:
        self._asked = ()
        self.page.refresh()

    # -- proposals ----------------------------------------------------------------------------------------------
    def _advise(self) -> Adviser:
        if self._adviser is None or self._adviser.mesh is not self.scene.mesh:
            self._adviser = adviser_of(self.scene.mesh, self.scene.opened.path)
        return self._adviser

    def _think(self, avatar: AvatarWork) -> None:
        """Have proposals worked out beside the page, if the points are others than those that they are of."""
        known = (self.scene.opened, avatar.landmarks, avatar.up, avatar.front)
        if not self.on or known == self._known:
            return
        self._known = known
        adviser = self._advise()
        if not adviser.ready:                               # while a face is looked for mirroring says something
            self.proposals = adviser.first(avatar)
        self._thinking.ask(lambda: self._ask_for(avatar, known, adviser))

    def _ask_for(self, avatar: AvatarWork, known: Any, adviser: Adviser) -> None:
        def waits(seconds: float) -> None:
            if self.page.closed or self._adviser is not adviser:    # another avatar has come
                raise Stopped

        with suppress(Stopped):
            self._advised(known, adviser.advice(avatar, waits))

    def _advised(self, known: Any, advice: Advice) -> None:
        """Show advice, if the points are still those that it is of."""
        with self.page.lock:
            if self._known is not known:
                return
            self.proposals = advice
            avatar = self.page.work.avatar
            usual = AvatarWork()
            if (advice.stands and not avatar.landmarks and advice.stands != (avatar.up, avatar.front)
                    and (avatar.up, avatar.front) == (usual.up, usual.front)):
                up, front = advice.stands
                self.page.change("stand the avatar up", avatar=replace(avatar, up=up, front=front))
                self.page.say(f"In this file +{up} is up and it looks to +{front}.".replace("+-", "-"),
                              "The avatar was turned")
            self.refresh(self.page.work)

    def settle(self) -> bool:
        """Wait until proposals are there."""
        return self._thinking.settle(60.0) and self._drawing.settle(60.0)

    def close(self) -> None:
        """End what runs beside the page."""
        self._thinking.close()
        self._drawing.close()
