"""The avatar in the picture, as its file has it: where it stands, and where the camera looks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FacegenError, InputError
from facegen.face.landmarks import REQUIRED
from facegen.geometry.mesh import Mesh
from facegen.studio.avatar_file import Opened, open_avatar
from facegen.studio.figure import Figure, Hit
from facegen.studio.guide import room_of, view_of
from facegen.studio.landmark_words import WORDS
from facegen.studio.page import Page
from facegen.studio.picking import as_landmarks, fits, point
from facegen.studio.placement import box_placement
from facegen.studio.stage import HALF_ANGLE
from facegen.studio.work import AvatarWork
from facegen.transfer.alignment import Similarity, align
from facegen.transfer.landmark_checks import average_face

Array = NDArray[np.float64]

AVATAR = "avatar"
"""The figure of the avatar at rest."""

BESIDE = np.array([300.0, 0.0, 0.0])
"""Where it stands, mm: beside the page's face."""

_ROOM = 1.1             # round what is looked at


class AvatarScene:
    """``opened``: the avatar, or None; ``figure``: it in the scene, or None while it is not shown."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.opened: Opened | None = None
        self.figure: Figure | None = None
        self.placement = Similarity(1.0, np.eye(3), np.zeros(3))
        self._stands: tuple | None = None
        self._gone: str | None = None               # what could not be opened, and was told

    @property
    def mesh(self) -> Mesh:
        """The avatar in its file's axes and units; InputError without one."""
        if self.opened is None:
            raise InputError("There is no avatar yet: open one first")
        return self.opened.avatar.mesh

    def open(self, work: AvatarWork) -> bool:
        """Have the work's avatar; return whether it is another than before. What is gone is told."""
        name = self.opened.name if self.opened else None
        if work.file is None:
            self.opened = None
            return name is not None
        try:
            found = open_avatar(self.page.desk.store.folder_of(self.page.name), work.file)
            if not fits(found.avatar.mesh, work.landmarks):
                raise InputError(f"avatar: '{work.file}' is another mesh than the one that its points were placed on; "
                                 "open it again")
        except FacegenError as error:
            if self._gone != work.file:
                self.page.say(str(error), "That avatar is gone", colour="red")
            self.opened, self._gone = None, work.file
            return name is not None
        self._gone = None
        another = self.opened is None or found.avatar is not self.opened.avatar
        self.opened = found
        self._stands = None if another else self._stands
        return another

    def show(self, work: AvatarWork, visible: bool) -> None:
        """Stand the avatar in the picture, or take it away."""
        if self.opened is None or not visible:
            self.page.stage.remove(AVATAR)
            self.figure = None
            return
        whole = set(REQUIRED) <= set(work.landmarks) and fits(self.mesh, work.landmarks)
        stands = (self.opened.avatar.digest, self.opened.name, work.up, work.front, whole)
        if self.figure is not None and stands == self._stands:
            return
        avatar = self.opened.avatar
        self.placement = self._place(work, whole)
        mesh = replace(avatar.mesh, vertices=self.placement.apply(avatar.mesh.vertices), colours=avatar.vertex_colours)
        self.figure = self.page.stage.put(AVATAR, mesh, colours=avatar.colours, offset=BESIDE)
        self._stands = stands

    def _place(self, work: AvatarWork, whole: bool) -> Similarity:
        if whole:
            try:
                return align(as_landmarks(self.mesh, work.landmarks).points(self.mesh.vertices), average_face())
            except InputError:                  # they do not form a face: the checks say so
                pass
        used = self.mesh.vertices[np.unique(self.mesh.faces)]
        return box_placement(used, work.up, work.front)

    # -- the picture --------------------------------------------------------------------------------------------
    def at(self, places: Mapping[str, Mapping]) -> dict[str, Array]:
        """Return where places are, mm of the figure."""
        return {name: self.placement.apply(point(self.mesh, one)) for name, one in places.items()}

    def pick(self, origin: Array, direction: Array) -> Hit | None:
        """Return the place that a ray of the scene meets."""
        return None if self.figure is None else self.figure.pick(origin, direction)

    def look(self, part: str, at: Mapping[str, Array], name: str | None = None) -> float:
        """Turn the camera to a part. at: points that are known, mm of the figure. name: the point to be seen well.

        Return how far the part reaches, mm.
        """
        middle, reach = room_of(part)
        known = np.array([place for each, place in at.items() if WORDS[each].part == part]).reshape(-1, 3)
        if part == "whole" and self.figure is not None:
            known = self.figure.vertices[np.unique(self.figure.mesh.faces)]
            known = known[np.linalg.norm(known - middle, axis=1) < 2.0 * reach]
        if len(known) >= 3:
            low, high = known.min(axis=0), known.max(axis=0)
            middle = (low + high) / 2
            # A part is hardly smaller than the base face's: few points do not say how large it is.
            reach = max(0.62 * float(np.linalg.norm((high - low)[:2])), 0.85 * reach)
        self.turn(BESIDE + middle, (reach, reach), view=(0.0, 0.0) if name is None else view_of(name))
        return reach

    def turn(self, middle: Array, half: tuple[float, float], view: tuple[float, float] = (0.0, 0.0)) -> None:
        """Turn the camera to a place, so far that half a width and a height, mm, are seen to each side of it."""
        wide = float(getattr(self.page.client.camera, "aspect", 1.0))
        distance = _ROOM * max(half[0] / wide, half[1]) / HALF_ANGLE
        self.page.stage.look(middle, yaw=view[0], pitch=view[1], distance=distance)
