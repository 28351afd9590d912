"""The tabs of a page, in their order."""

from __future__ import annotations

from collections.abc import Callable

from facegen.studio.avatar_panel import AvatarPanel
from facegen.studio.clip_panel import ClipPanel
from facegen.studio.face_panel import FacePanel
from facegen.studio.page import Page, Panel
from facegen.studio.points_panel import PointsPanel
from facegen.studio.tables_panel import TablesPanel

PANELS: dict[str, Callable[[Page], Panel]] = {
    "Face": FacePanel,
    "Points": PointsPanel,
    "Timeline": ClipPanel,
    "Avatar": AvatarPanel,
    "Tables": TablesPanel,
}
