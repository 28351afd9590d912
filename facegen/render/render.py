"""The one door from a mesh or a face to a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.geometry.camera import Camera, check_view, frame
from facegen.geometry.mesh import Mesh
from facegen.render.backends import choose, load
from facegen.render.dress import dressed, portrait
from facegen.render.overlay import Wireframe, check_wireframe, draw_wireframe
from facegen.render.request import Rig, check_in_front, check_look, check_size, neutral_mesh, posed_vertices
from facegen.render.scene import Scene


class Renderer:
    """Draws many poses of one face in one view; all that does not change is prepared once.

    thing: a Mesh, or a face or other rig.
    size: pixels, one number for a square or (width, height), 32..4096.
    view: (yaw, pitch) of the camera round the head in degrees; positive yaw goes to the subject's left, positive
        pitch up.
    detail: subdivision level of a rig, 0..3; None takes the level whose triangles cover a few pixels (0 if flat).
    background: "plain" (light grey), "transparent" or an sRGB colour (r, g, b).
    shading: "smooth" interpolates normals, "flat" shows the triangles as pictures of 1986 often did.
    occlusion: how far each vertex sees out, from each "posed" mesh (right for open mouths), once from the "neutral"
        (quickest), or "off".
    orthographic: parallel projection instead of the portrait lens.
    shadows: whether the key light casts shadows: nose on cheek, brow on eye, chin on neck.
    wireframe: True draws the triangles' edges over the picture; a `Wireframe` says how.
    camera: a ready camera instead of size, view and orthographic. scene: other lights and materials.
    around: vertices (k, 3) that must be in the picture too, such as all frames of a clip.
    renderer: "auto", or one of `facegen.render.RENDERERS` by name. All draw the same picture.
    threads: how many of this process's threads may work on one picture; None is one a core. Give 1 where several
        processes draw.

    ``camera``, ``mesh`` (the neutral), ``detail`` and ``renderer`` (the name of the one chosen) can be read. One caller
    at a time: each thread needs its own.

    Raises InputError. ::

        renderer = facegen.Renderer(face, size=512)
        frames = [renderer.draw(vertices) for vertices in poses]
    """

    def __init__(self, thing: Mesh | Rig, *, size: int | tuple[int, int] = 512,
                 view: tuple[float, float] = (0.0, 0.0), detail: int | None = None,
                 background: str | Sequence[float] = "plain", shading: str = "smooth", occlusion: str = "posed",
                 orthographic: bool = False, camera: Camera | None = None, scene: Scene | None = None,
                 around: ArrayLike | None = None, renderer: str = "auto", threads: int | None = None,
                 shadows: bool = False, wireframe: bool | Wireframe = False) -> None:
        size, view = check_size(size), check_view(view)
        look = check_look(background=background, shading=shading, occlusion=occlusion, threads=threads, shadows=shadows)
        name = choose(renderer)
        self.thing = thing
        self.mesh, self.detail = neutral_mesh(thing, detail=detail, size=size, view=view, orthographic=orthographic,
                                              flat=look.flat, camera=camera)
        self.camera = camera or frame(portrait(thing, self.mesh.vertices), around, size=size, view=view,
                                       orthographic=orthographic)
        self.renderer = name
        self._lines = check_wireframe(wireframe, thing, self.mesh, self.detail)
        self._backend = load(name)(self.mesh, self.camera, dressed(scene or Scene(), thing, self.mesh), look)

    def draw(self, pose: Any = None, *, person: Any = None, intensity: float = 1.0) -> NDArray[np.uint8]:
        """Return the picture (height, width, 4) uint8, sRGB with straight alpha, of a pose.

        pose: vertices (n, 3) of ``mesh``, or for a rig anything its ``pose`` takes; None is the neutral.
        """
        vertices = posed_vertices(self.thing, pose, self.mesh, self.detail, person=person, intensity=intensity)
        check_in_front("pose", vertices, self.mesh.faces, self.camera)
        return _with_lines(self._backend.draw(vertices), vertices, self.mesh, self.camera, self._lines)


def render(thing: Mesh | Rig, pose: Any = None, *, size: int | tuple[int, int] = 512,
           view: tuple[float, float] = (0.0, 0.0), detail: int | None = None,
           background: str | Sequence[float] = "plain", person: Any = None, intensity: float = 1.0,
           shading: str = "smooth", occlusion: str = "posed", orthographic: bool = False,
           camera: Camera | None = None, scene: Scene | None = None, renderer: str = "auto",
           threads: int | None = None, shadows: bool = False, wireframe: bool | Wireframe = False) -> NDArray[np.uint8]:
    """Return one picture as (height, width, 4) uint8, sRGB with straight alpha.

    pose: for a rig anything its ``pose`` takes ("happiness", "6C+12D", ...) or vertices (n, 3); for a mesh
        vertices (n, 3). None is the neutral.
    person, intensity: passed to the rig's ``pose``.
    Everything else: see `Renderer`, which draws many poses faster.

    Raises InputError. ::

        pixels = facegen.render(facegen.load_face(), "happiness", size=512, view=(30, 0))
    """
    size, view = check_size(size), check_view(view)
    look = check_look(background=background, shading=shading, occlusion=occlusion, threads=threads, shadows=shadows)
    name = choose(renderer, pictures=1, pixels=size[0] * size[1], now=True)
    mesh, level = neutral_mesh(thing, detail=detail, size=size, view=view, orthographic=orthographic,
                               flat=look.flat, camera=camera)
    lines = check_wireframe(wireframe, thing, mesh, level)
    vertices = posed_vertices(thing, pose, mesh, level, person=person, intensity=intensity)
    camera = camera or frame(portrait(thing, mesh.vertices), portrait(thing, vertices), size=size, view=view,
                             orthographic=orthographic)
    check_in_front("pose", vertices, mesh.faces, camera)
    backend = load(name)(mesh, camera, dressed(scene or Scene(), thing, mesh), look)
    return _with_lines(backend.draw(vertices), vertices, mesh, camera, lines)


def _with_lines(picture: NDArray[np.uint8], vertices: NDArray, mesh: Mesh, camera: Camera,
                lines: tuple[Wireframe, NDArray[np.bool_]] | None) -> NDArray[np.uint8]:
    """Return the picture of a pose, with the mesh's edges over it if they were asked for."""
    return picture if lines is None else draw_wireframe(picture, mesh.with_vertices(vertices), camera, *lines)
