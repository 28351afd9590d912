"""From vertices to pictures. ``facegen.render`` is this package and, called, its door: `render`."""

import sys
from types import ModuleType

from facegen.render.backends import RENDERERS
from facegen.render.overlay import Wireframe
from facegen.render.passes import PASSES, render_passes
from facegen.render.passfiles import save_passes
from facegen.render.render import Renderer, render

__all__ = ["PASSES", "RENDERERS", "Renderer", "Wireframe", "render", "render_passes", "save_passes"]


class _Callable(ModuleType):
    """A package that can be called: ``facegen.render(face, "happiness")``, however it was imported."""

    def __call__(self, thing, pose=None, **options):
        """Draw; see `render`."""
        return render(thing, pose, **options)


sys.modules[__name__].__class__ = _Callable
