"""The OpenGL renderer: pyrender draws, with our own shaders, the picture that the others draw.

Everything to know about pyrender is in this one file. What it does here: the context (EGL without a display on
Linux, the native one elsewhere), scene, draw calls. What is ours: the shaders (`facegen.render.glsl`), a framebuffer
of linear light in half floats - four samples a pixel must be averaged before sRGB, not after - and vertices that are
replaced in place.

A process has ONE context: ending one of two EGL contexts of a device ends the other's display too. All backends
share it; those of one size share their framebuffers, those of one scene their program. A lock lets one thread in at
a time, and a context that the caller had current is current again afterwards, so any thread may draw, but two never
draw at once: for speed use processes. A process forked from one that has drawn cannot draw (the driver's threads do
not survive a fork) and is told so.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import sys
import threading
import types
import warnings
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.geometry.camera import Camera
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import face_normals, vertex_normals
from facegen.render.glsl import fragment_shader, vertex_shader
from facegen.render.request import Look
from facegen.render.scene import Scene
from facegen.render.shading import material_rows, to_srgb, vertex_albedo
from facegen.render.soft import background_rows
from facegen.render.vertexlight import VertexLight

SAMPLES = 4
# Attributes of a pyrender primitive after position and normal, with their floats: they carry the light shares and
# the material's index.
_SLOTS = (("tangents", 4), ("texcoord_0", 2), ("texcoord_1", 2), ("color_0", 4))
MAX_LIGHTS = sum(size for _, size in _SLOTS) - 2
# The bits of 1 as a half float; those of all values 0..1 come before, in order.
_ONE = 0x3C00
_OTHERS = 'the other renderers need no OpenGL, for example renderer="auto"'


def _import_pyrender() -> types.ModuleType:
    """Return pyrender, imported so that it needs no display; InputError says what to install."""
    if sys.flags.optimize:
        raise InputError("renderer: 'gl' does not work under python -O, which drops the EGL calls that pyrender "
                         f"makes within assert statements; {_OTHERS}")
    if sys.platform.startswith("linux"):
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")       # read when OpenGL is imported and a context made
    # The window viewer takes half of the import and asks for a display; nothing here opens a window.
    stub = None if "pyrender" in sys.modules else types.ModuleType("pyrender.viewer")
    try:
        if stub is not None:
            stub.Viewer = None
            sys.modules["pyrender.viewer"] = stub
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")                     # deprecations within packages that have stood still
            import pyrender
            import pyrender.renderer
            import pyrender.shader_program
        return pyrender
    except ModuleNotFoundError as error:
        raise InputError(f"renderer: 'gl' needs pyrender, and {error.name} is not installed: "
                         f'pip install "facegen[gl]"; {_OTHERS}') from error
    except Exception as error:                                  # ImportError, OSError, AttributeError: no library
        raise InputError(_no_opengl(error)) from error
    finally:
        if stub is not None:
            sys.modules.pop("pyrender.viewer", None)            # who wants the window can still import it
            vars(sys.modules.get("pyrender", stub)).pop("viewer", None)


def _no_opengl(error: Exception) -> str:
    why = " ".join(str(error).split()) or type(error).__name__
    mend = ("install its libraries, on Debian or Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri"
            if sys.platform.startswith("linux") else "it needs a driver and a session with a display")
    return f"renderer: 'gl' cannot start OpenGL ({why[:200]}); {mend}; {_OTHERS}"


pyrender = _import_pyrender()
from OpenGL import GL  # noqa: E402 - only after pyrender has chosen the platform
from OpenGL.raw.GL.VERSION.GL_1_0 import glReadPixels as _read_pixels  # noqa: E402 - PyOpenGL's own knows no halves

# -- the process's one context ------------------------------------------------------------------------------------

_lock = threading.RLock()
_shared: _Context | None = None
# What to delete when the context is next current. Garbage is collected in any thread and at any time, also while
# another context is current, whose objects of the same numbers would go.
_waste: list[Callable[[], object]] = []


class _Context(pyrender.OffscreenRenderer):
    """pyrender's context; it ends at exit, never by garbage collection."""

    def __init__(self) -> None:
        super().__init__(1, 1)
        self.process = os.getpid()
        self.largest = min(int(GL.glGetIntegerv(GL.GL_MAX_RENDERBUFFER_SIZE)),
                           *(int(side) for side in GL.glGetIntegerv(GL.GL_MAX_VIEWPORT_DIMS)))
        self.framebuffers: weakref.WeakValueDictionary[tuple[int, int], _Framebuffer] = weakref.WeakValueDictionary()
        self.programs: weakref.WeakValueDictionary[tuple[str, str], _Program] = weakref.WeakValueDictionary()

    def __del__(self) -> None:
        pass


@contextmanager
def _current() -> Iterator[_Context]:
    """Make the context current, started if need be, and delete what waits for it."""
    with _lock, _caller_restored():
        context = _started()
        context._platform.make_current()
        while _waste:
            _waste.pop()()
        yield context


def _started() -> _Context:
    global _shared
    if _shared is None:
        try:
            _shared = _Context()
        except Exception as error:         # pyrender asserts, PyOpenGL and pyglet have errors of their own
            raise InputError(_no_opengl(error)) from error
        atexit.register(_end)
    if _shared.process != os.getpid():
        raise InputError("renderer: OpenGL had started before this process was forked and does not survive that; start "
                         'processes with multiprocessing.get_context("spawn"), or use another renderer')
    return _shared


@contextmanager
def _caller_restored() -> Iterator[None]:
    """Make the caller's EGL context current again afterwards, or none, so that any thread may be next."""
    if os.environ.get("PYOPENGL_PLATFORM") != "egl":
        yield
        return
    from OpenGL import EGL

    before = (EGL.eglGetCurrentDisplay(), EGL.eglGetCurrentSurface(EGL.EGL_DRAW),
              EGL.eglGetCurrentSurface(EGL.EGL_READ), EGL.eglGetCurrentContext())
    try:
        yield
    finally:
        display = before[0] or (_shared is not None and _shared._platform._egl_display)
        if display:
            EGL.eglMakeCurrent(display, *before[1:])


def _end() -> None:
    """Free everything while the interpreter still stands."""
    if _shared is not None and _shared.process == os.getpid():
        with _lock:
            _shared.delete()


# -- what pyrender has otherwise ----------------------------------------------------------------------------------

class _Framebuffer:
    """Linear light in half floats and a depth buffer, four samples a pixel, and the average of the four."""

    def __init__(self, width: int, height: int) -> None:
        self.size = width, height
        self.samples, self.averaged = (int(name) for name in GL.glGenFramebuffers(2))
        buffers = [int(name) for name in GL.glGenRenderbuffers(3)]
        weakref.finalize(self, _waste.append, partial(_delete_framebuffers, (self.samples, self.averaged), buffers))
        colour, depth, average = buffers
        self._attach(self.samples, GL.GL_COLOR_ATTACHMENT0, colour, GL.GL_RGBA16F, SAMPLES)
        self._attach(self.samples, GL.GL_DEPTH_ATTACHMENT, depth, GL.GL_DEPTH_COMPONENT24, SAMPLES)
        self._attach(self.averaged, GL.GL_COLOR_ATTACHMENT0, average, GL.GL_RGBA16F, 0)

    def _attach(self, framebuffer: int, place: int, buffer: int, kind: int, samples: int) -> None:
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
        GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, samples, kind, *self.size)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, place, GL.GL_RENDERBUFFER, buffer)

    def read(self) -> NDArray[np.float16]:
        """Return the averages (h, w, 4)."""
        width, height = self.size
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self.samples)
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self.averaged)
        GL.glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self.averaged)
        pixels = np.empty((height, width, 4), np.float16)
        _read_pixels(0, 0, width, height, GL.GL_RGBA, GL.GL_HALF_FLOAT, pixels.ctypes.data_as(ctypes.c_void_p))
        return pixels


def _delete_framebuffers(framebuffers: tuple[int, int], buffers: list[int]) -> None:
    GL.glDeleteFramebuffers(len(framebuffers), np.array(framebuffers, np.uint32))
    GL.glDeleteRenderbuffers(len(buffers), np.array(buffers, np.uint32))


class _Program(pyrender.shader_program.ShaderProgram):
    """A program of shaders that are given as text."""

    def __init__(self, vertex: str, fragment: str) -> None:
        super().__init__(vertex, fragment)
        self._add_to_context()
        weakref.finalize(self, _waste.append, partial(_delete_program, self._program_id, self._vao_id))

    def _load(self, text: str) -> str:
        return text

    def delete(self) -> None:
        """Leave it to the last who uses it."""


def _delete_program(program: int, vertex_array: int) -> None:
    GL.glDeleteProgram(program)
    GL.glDeleteVertexArrays(1, np.array([vertex_array], np.uint32))


class _Lens(pyrender.Camera):
    """Our camera; its picture is drawn upside down, because OpenGL reads pixels from the lowest row."""

    def __init__(self, camera: Camera) -> None:
        super().__init__(znear=camera.near)
        self.camera = camera

    def hold(self, depth: NDArray) -> None:
        """Set the nearest and farthest depth so that all of it is drawn, as finely resolved as can be."""
        slack = 0.01 * (depth.max() - depth.min()) + 1e-3 * self.camera.distance
        self.zfar = max(depth.max(), self.camera.near) + slack
        self.znear = max(depth.min() - slack, self.camera.near)

    def get_projection_matrix(self, width: int | None = None, height: int | None = None) -> NDArray[np.float64]:
        """Return the matrix (4, 4) from camera axes to clip space."""
        c, near, far = self.camera, self.znear, self.zfar
        across, down = 2 / c.width, 2 / c.height
        x, y = across * c.offset[0] - 1, down * c.offset[1] - 1
        if c.orthographic:
            return np.array([[across * c.scale, 0, 0, x], [0, -down * c.scale, 0, y],
                             [0, 0, 2 / (near - far), (far + near) / (near - far)], [0, 0, 0, 1]])
        focal = c.scale * c.distance
        return np.array([[across * focal, 0, -x, 0], [0, -down * focal, -y, 0],
                         [0, 0, (far + near) / (near - far), 2 * far * near / (near - far)], [0, 0, -1, 0]])


class _Renderer(pyrender.renderer.Renderer):
    """pyrender's drawing with one program of ours, into a framebuffer of ours."""

    def __init__(self, framebuffer: _Framebuffer, program: _Program, camera: Camera) -> None:
        super().__init__(*framebuffer.size)
        # On macOS pyrender doubles every picture and halves it again; ours is not shown on a Retina screen.
        self.dpscale, self._viewport_width, self._viewport_height = 1, *framebuffer.size
        self.framebuffer, self.program = framebuffer, program
        self.lens = np.array([*camera.offset, 0 if camera.orthographic else 1 / (camera.scale * camera.distance)])

    def _configure_main_framebuffer(self) -> None:
        self._main_fb_ms = self.framebuffer.samples

    def _configure_forward_pass_viewport(self, flags: int) -> None:
        super()._configure_forward_pass_viewport(flags)
        GL.glDepthFunc(GL.GL_LEQUAL)                # of two triangles in one place the later is seen, as in soft
        GL.glFrontFace(GL.GL_CW)                    # counter-clockwise, upside down

    def _get_primitive_program(self, primitive, flags, program_flags) -> _Program:
        return self.program

    def _bind_lighting(self, scene, program, node, flags) -> None:
        program.set_uniform("lens", self.lens)      # the lights are constants of the program

    def _read_main_framebuffer(self, scene, flags) -> NDArray[np.float16]:
        return self.framebuffer.read()

    def delete(self) -> None:
        """Free the vertex buffers; framebuffer and program belong to others too."""
        for mesh in self._meshes:
            for primitive in mesh.primitives:
                primitive.delete()
        self._meshes = set()

    def __del__(self) -> None:
        pass


# -- the backend --------------------------------------------------------------------------------------------------

class GlBackend:
    """Draws poses of one mesh for one camera with OpenGL.

    All that is constant stays on the card (or in the driver's memory); a draw replaces the vertices. Raises
    InputError where OpenGL cannot be had, the picture is larger than it can draw, or the scene has more lights than
    `MAX_LIGHTS` (three fewer where vertices have colours).
    """

    def __init__(self, neutral: Mesh, camera: Camera, scene: Scene, look: Look) -> None:
        most = MAX_LIGHTS if neutral.colours is None else MAX_LIGHTS - 3
        if len(scene.lights) > most:
            raise InputError(f"scene: renderer='gl' draws up to {most} lights"
                             f"{'' if most == MAX_LIGHTS else ' where vertices have colours'}, "
                             f"got {len(scene.lights)}; {_OTHERS}")
        self.neutral, self.camera, self.scene, self.look = neutral, camera, scene, look
        self._turn = threading.Lock()
        self._corners, faces, material = _expanded(neutral, look.flat)
        shares = 1 + len(scene.lights)
        albedo = vertex_albedo(neutral)
        tinted = albedo is not None
        slots = _used_slots(shares + 1 + (3 if tinted else 0))
        # Position, normal, light shares, material and what the last attribute has over, as the card reads them.
        self._data = np.zeros((len(self._corners), 6 + sum(size for _, size in slots)), np.float32)
        self._own_light = self._data[:, 6:6 + shares]
        self._data[:, 6 + shares] = material
        if tinted:
            self._data[:, 7 + shares:10 + shares] = albedo[self._corners]
        self._light = VertexLight(neutral, camera, scene, look)
        if self._light.still:
            self._own_light[:] = self._light.of(neutral.vertices, None)[self._corners]
        self._behind = background_rows(look.background, scene, camera.height)
        materials = material_rows(neutral, scene)
        shaders = (vertex_shader([size for _, size in slots], shares, materials, tinted=tinted),
                   fragment_shader(scene, materials[-1, :3], tinted=tinted))
        with _current() as context:
            _check_size(camera, context.largest)
            framebuffer = _kept(context.framebuffers, (camera.width, camera.height), _Framebuffer)
            self._renderer = _Renderer(framebuffer, _kept(context.programs, shaders, _Program), camera)
            self._primitive = pyrender.Primitive(self._data[:, :3], self._data[:, 3:6], indices=faces, material=_BARE,
                                                 **_attributes(self._data, slots))
            self._primitive._add_to_context()
        drawn = pyrender.Mesh([self._primitive])
        self._renderer._meshes.add(drawn)                       # what stands here is not uploaded again
        self._lens = _Lens(camera)
        self._scene = pyrender.Scene(bg_color=np.zeros(4))      # floats: integers would be read as 0..255
        self._scene.add(drawn)
        pose = np.eye(4)
        pose[2, 3] = camera.distance
        self._scene.add(self._lens, pose=pose)
        self._free = weakref.finalize(self, _waste.append, self._renderer.delete)

    def draw(self, vertices: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the picture (h, w, 4) of checked vertices (n, 3)."""
        with self._turn:
            self._fill(vertices)
            with _current():
                GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._primitive._buffers[0])
                GL.glBufferSubData(GL.GL_ARRAY_BUFFER, 0, self._data.nbytes, self._data)
                pixels = self._renderer.render(self._scene, pyrender.RenderFlags.OFFSCREEN)
        return self._finished(pixels)

    def close(self) -> None:
        """Free the OpenGL objects now; otherwise that is done when a later picture is drawn."""
        self._free()
        if _shared is not None:
            with _current():
                pass

    def _fill(self, vertices: NDArray[np.float64]) -> None:
        """Write the vertices of a pose, with their normals and light, into the data to upload."""
        camera, corners, data = self.camera, self._corners, self._data
        # In camera axes from the target: float32 is then fine however far from the origin a mesh lies.
        local = (vertices - camera.target) @ camera.rotation.T
        self._lens.hold(camera.distance - local[:, 2])
        data[:, :3] = local[corners]
        smooth = vertex_normals(vertices, self.neutral.faces) if self._light.posed or not self.look.flat else None
        if self.look.flat:
            data[:, 3:6] = np.repeat(face_normals(vertices, self.neutral.faces) @ camera.rotation.T, 3, axis=0)
        else:
            data[:, 3:6] = (smooth @ camera.rotation.T)[corners]
        if not self._light.still:
            self._own_light[:] = self._light.of(vertices, smooth)[corners]

    def _finished(self, pixels: NDArray[np.float16]) -> NDArray[np.uint8]:
        """Return premultiplied linear light and coverage over the background, in sRGB."""
        picture = _srgb_of_halves().take(pixels.view(np.uint16), mode="clip")
        cover = pixels[..., 3]
        transparent = self.look.background == "transparent"
        if not transparent:
            picture[..., 3] = 255
            np.copyto(picture[..., :3], to_srgb(self._behind)[:, None], where=(cover == 0)[..., None])
        y, x = np.nonzero((cover > 0) & (cover < 1))
        light, part = np.split(pixels[y, x].astype(np.float32), [3], axis=1)
        if transparent:
            light /= part
            picture[y, x, 3] = np.rint(part[:, 0] * 255)
        else:
            light += self._behind[y] * (1 - part)
        picture[y, x, :3] = to_srgb(light)
        return picture


# Both sides are drawn, opaque; all else about a material is in the program.
_BARE = pyrender.MetallicRoughnessMaterial(doubleSided=True, alphaMode="OPAQUE")


@cache
def _srgb_of_halves() -> NDArray[np.uint8]:
    """Return the sRGB bytes of all half floats 0..1 by their bits; beyond the end is 1, so is NaN."""
    return to_srgb(np.arange(_ONE + 1, dtype=np.uint16).view(np.float16).astype(np.float32))


def _kept(store, key, make):
    """Return what is kept under a key as long as somebody uses it, or make it."""
    found = store.get(key)
    if found is None:
        found = store[key] = make(*key)
    return found


def _check_size(camera: Camera, largest: int) -> None:
    if max(camera.width, camera.height) > largest:
        raise InputError(f"size: this OpenGL draws up to {largest} pixels a side, got {camera.width}x{camera.height}; "
                         f"{_OTHERS}")


def _used_slots(floats: int) -> list[tuple[str, int]]:
    """Return the first attributes that together hold so many floats."""
    ends = np.cumsum([size for _, size in _SLOTS])
    return list(_SLOTS[:int(np.searchsorted(ends, floats)) + 1])


def _attributes(data: NDArray[np.float32], slots: list[tuple[str, int]]) -> dict[str, NDArray[np.float32]]:
    ends = 6 + np.cumsum([size for _, size in slots])
    return {name: data[:, end - size:end] for (name, size), end in zip(slots, ends, strict=True)}


def _expanded(mesh: Mesh, flat: bool) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
    """Return the vertices to upload (of the mesh, by index), the triangles (m, 3) of them and each one's material.

    A vertex is there once for each material round it, and flat once for each triangle, whose normal it carries.
    """
    if flat:
        count = mesh.faces.size
        return mesh.faces.ravel(), np.arange(count).reshape(-1, 3), np.repeat(mesh.face_materials, 3)
    kinds = len(mesh.materials)
    pairs, faces = np.unique(mesh.faces.astype(np.int64) * kinds + mesh.face_materials[:, None], return_inverse=True)
    return pairs // kinds, faces.reshape(-1, 3), pairs % kinds
