"""From vertices to pictures."""

from facegen.render.render import render

__all__ = ["render"]
