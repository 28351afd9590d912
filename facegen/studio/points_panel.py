"""Feature points, the raw level of 1986."""

from __future__ import annotations

from facegen.studio.page import Page
from facegen.studio.work import Work


class PointsPanel:
    """Feature points, the raw level of 1986."""

    def __init__(self, page: Page) -> None:
        self.page = page

    def refresh(self, work: Work) -> None:
        """Show a work."""

    def close(self) -> None:
        """Nothing runs."""
