"""The renderers that are measured, one small class each: made from a saved head, `draw(frame)` returns a picture.

Nothing is imported before a class is made: start-up is measured too. All draw 4 samples a pixel and return
(h, w, 4) uint8 with the first row on top. The peers get positions and normals as float32 in the shape they like
best; facegen gets float64 positions alone.
"""

from __future__ import annotations

import os
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Missing(Exception):
    """A renderer that cannot be measured here, and why."""


class Contestant(Protocol):
    """Draws frames of one head."""

    def draw(self, frame: int) -> NDArray[np.uint8]:
        """Return the picture (h, w, 4) of a frame of the head's motion."""


class Facegen:
    """One of facegen's own renderers, used through its public door."""

    def __init__(self, head, *, renderer: str, occlusion: str, threads: int | None) -> None:
        from heads import mesh_of

        import facegen
        try:
            self._renderer = facegen.Renderer(mesh_of(head), size=int(head["size"]), renderer=renderer,
                                              occlusion=occlusion, background="transparent", threads=threads)
        except (facegen.FacegenError, ImportError) as error:
            raise Missing(str(error)) from error
        self._poses = head["poses"]

    def draw(self, frame: int) -> NDArray[np.uint8]:
        return self._renderer.draw(self._poses[frame])


# Two-sided Blinn-Phong, three lights from far away; inner sides dim, as facegen draws them.
_VERTEX = """#version 330
uniform mat4 view, projection;
in vec3 position, normal, colour;
out vec3 place, direction, base;
void main() {
    vec4 seen = view * vec4(position, 1);
    gl_Position = projection * seen;
    place = seen.xyz; direction = mat3(view) * normal; base = colour;
}"""
_FRAGMENT = """#version 330
uniform vec3 towards[3], light[3];
in vec3 place, direction, base;
out vec4 pixel;
void main() {
    vec3 n = normalize(gl_FrontFacing ? direction : -direction), v = normalize(-place);
    vec3 diffuse = vec3(0.35), shine = vec3(0);
    for (int i = 0; i < 3; i++) {
        float facing = max(dot(n, towards[i]), 0);
        diffuse += light[i] * facing;
        shine += light[i] * pow(max(dot(n, normalize(towards[i] + v)), 0), 18) * 0.08;
    }
    pixel = vec4(base * diffuse + shine, 1);
}"""


class ModernGL:
    """OpenGL through moderngl: one draw call, the multisampled picture resolved by a blit and read into one buffer."""

    def __init__(self, head) -> None:
        try:
            import moderngl
        except ImportError as error:
            raise Missing("moderngl is not installed") from error
        try:
            self._context = context = moderngl.create_context(standalone=True, backend="egl", require=330)
        except Exception as error:                                                  # glcontext raises bare ones
            raise Missing(f"moderngl finds no EGL: {error}") from error
        size = (int(head["size"]),) * 2
        program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        program["view"].write(head["view"].T.astype(np.float32).tobytes())
        program["projection"].write(head["projection"].T.astype(np.float32).tobytes())
        program["towards"].write(np.ascontiguousarray(head["lights"][:, :3]))
        program["light"].write(np.ascontiguousarray(head["lights"][:, 3:]))
        self._poses, self._normals = head["poses32"], head["normals"]
        self._position = context.buffer(reserve=self._poses[0].nbytes, dynamic=True)
        self._normal = context.buffer(reserve=self._poses[0].nbytes, dynamic=True)
        self._drawing = context.vertex_array(
            program, [(self._position, "3f", "position"), (self._normal, "3f", "normal"),
                      (context.buffer(head["colours"]), "3f", "colour")], context.buffer(head["faces"]))
        self._samples = context.framebuffer(context.renderbuffer(size, 4, samples=4),
                                            context.depth_renderbuffer(size, samples=4))
        self._resolved = context.framebuffer(context.renderbuffer(size, 4))
        self._picture = np.empty((*size, 4), np.uint8)
        context.enable(moderngl.DEPTH_TEST)
        self.info = f"{context.info['GL_RENDERER']}, OpenGL {context.info['GL_VERSION']}"

    def draw(self, frame: int) -> NDArray[np.uint8]:
        # Orphaned first, so that the driver need not wait for the frame before.
        self._position.orphan()
        self._position.write(self._poses[frame])
        self._normal.orphan()
        self._normal.write(self._normals[frame])
        self._samples.use()
        self._samples.clear()
        self._drawing.render()
        self._context.copy_framebuffer(self._resolved, self._samples)
        self._resolved.read_into(self._picture, components=4)
        return self._picture[::-1]


class Vtk:
    """VTK's polygon mapper in an off-screen EGL window; arrays are shared with NumPy and marked as changed."""

    def __init__(self, head) -> None:
        try:
            import vtkmodules.vtkRenderingOpenGL2
            from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
            from vtkmodules.vtkCommonCore import vtkPoints, vtkUnsignedCharArray
            from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
            from vtkmodules.vtkCommonMath import vtkMatrix4x4
            from vtkmodules.vtkRenderingCore import vtkActor, vtkLight, vtkPolyDataMapper, vtkRenderer
        except ImportError as error:
            raise Missing(f"vtk is not installed ({error})") from error
        self._size = int(head["size"])
        self._to_vtk, self._poses, self._all_normals = numpy_to_vtk, head["poses32"], head["normals"]
        self._data, self._points = vtkPolyData(), vtkPoints()
        cells = vtkCellArray()
        faces = head["faces"].astype(np.int64)
        cells.SetData(numpy_to_vtkIdTypeArray(np.arange(0, faces.size + 1, 3), deep=True),
                      numpy_to_vtkIdTypeArray(faces.ravel(), deep=True))
        self._data.SetPolys(cells)
        self._data.SetPoints(self._points)
        colours = numpy_to_vtk((head["colours"] * 255).round().astype(np.uint8), deep=True)
        self._data.GetPointData().SetScalars(colours)
        self._set(0)
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(self._data)
        mapper.SetStatic(True)                                      # the pipeline has nothing to look for upstream
        actor = vtkActor()
        actor.SetMapper(mapper)
        look = actor.GetProperty()
        look.SetInterpolationToPhong()
        look.SetAmbient(0.35)
        look.SetDiffuse(1.0)
        look.SetSpecular(0.08)
        look.SetSpecularPower(18)
        renderer = vtkRenderer()
        renderer.SetBackground(0, 0, 0)
        renderer.SetBackgroundAlpha(0)
        renderer.AddActor(actor)
        renderer.SetAutomaticLightCreation(False)
        for lamp in head["lights"]:
            light = vtkLight()
            light.SetLightTypeToCameraLight()
            light.SetPosition(*lamp[:3])
            light.SetFocalPoint(0, 0, 0)
            light.SetColor(*lamp[3:])
            renderer.AddLight(light)
        camera, view = renderer.GetActiveCamera(), head["view"]
        place = head["target"] + head["distance"] * view[2, :3]
        camera.SetFocalPoint(*head["target"])
        camera.SetPosition(*place)
        camera.SetViewUp(*view[1, :3])
        camera.SetClippingRange(0.5 * head["distance"], 1.5 * head["distance"])
        projection = vtkMatrix4x4()
        projection.DeepCopy(head["projection"].ravel())
        camera.SetExplicitProjectionTransformMatrix(projection)
        camera.UseExplicitProjectionTransformMatrixOn()
        self._window = window = _vtk_window(vtkmodules.vtkRenderingOpenGL2)
        window.SetMultiSamples(4)
        window.SetAlphaBitPlanes(True)
        window.SetSize(self._size, self._size)
        window.AddRenderer(renderer)
        window.SwapBuffersOff()                                     # nobody looks at the window
        self._pixels = vtkUnsignedCharArray()
        self._pixels.SetNumberOfComponents(4)
        self._pixels.SetNumberOfTuples(self._size**2)
        self._picture = vtk_to_numpy(self._pixels).reshape(self._size, self._size, 4)
        window.Render()
        self.info = " ".join(window.ReportCapabilities().split("OpenGL renderer string:")[1].split("\n")[0].split())

    def _set(self, frame: int) -> None:
        positions, normals = self._to_vtk(self._poses[frame]), self._to_vtk(self._all_normals[frame])
        self._points.SetData(positions)
        self._data.GetPointData().SetNormals(normals)
        self._points.Modified()
        self._data.Modified()

    def draw(self, frame: int) -> NDArray[np.uint8]:
        self._set(frame)
        self._window.Render()
        self._window.GetRGBACharPixelData(0, 0, self._size - 1, self._size - 1, 0, self._pixels)
        return self._picture[::-1]


def _vtk_window(module):
    """Return VTK's EGL window where there is one, else the usual one off screen."""
    window = getattr(module, "vtkEGLRenderWindow", module.vtkOpenGLRenderWindow)()
    window.SetOffScreenRendering(True)
    return window


class Pyrender:
    """pyrender's own scene and shaders; the vertices go into the buffer that pyrender made, interleaved as it does.

    A new pyrender.Mesh a frame, its only documented way, is slower still. It always reads the depth back too, and
    PyOpenGL asks for errors after each call: with that switched off its EGL module does not import.
    """

    def __init__(self, head) -> None:
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
        try:
            import pyrender
            from OpenGL import GL
        except ImportError as error:
            raise Missing(f"pyrender is not installed ({error})") from error
        self._gl, self._flags = GL, pyrender.RenderFlags.RGBA
        projection = head["projection"]

        class Fixed(pyrender.Camera):
            def get_projection_matrix(self, width=None, height=None):
                return projection

        self._poses, self._normals = head["poses32"], head["normals"]
        colours = np.column_stack([head["colours"], np.ones(len(head["colours"]), np.float32)])
        material = pyrender.MetallicRoughnessMaterial(metallicFactor=0.0, roughnessFactor=0.6, doubleSided=True,
                                                      baseColorFactor=(1.0, 1.0, 1.0, 1.0))
        self._primitive = pyrender.Primitive(self._poses[0], self._normals[0], color_0=colours, indices=head["faces"],
                                             material=material, mode=4)
        self._scene = pyrender.Scene(bg_color=(0.0, 0.0, 0.0, 0.0), ambient_light=(0.35, 0.35, 0.35))
        self._scene.add(pyrender.Mesh([self._primitive]))
        place = np.linalg.inv(head["view"])
        self._scene.add(Fixed(znear=0.5 * float(head["distance"]), zfar=1.5 * float(head["distance"])), pose=place)
        for lamp in head["lights"]:
            self._scene.add(pyrender.DirectionalLight(color=lamp[3:].astype(float), intensity=2.0),
                            pose=place @ _looking_from(lamp[:3]))
        try:
            self._renderer = pyrender.OffscreenRenderer(int(head["size"]), int(head["size"]))
        except Exception as error:                                  # it asserts, PyOpenGL has errors of its own
            raise Missing(f"pyrender finds no EGL: {error}") from error
        self._rows = np.column_stack([self._poses[0], self._normals[0], colours])
        self._renderer.render(self._scene, self._flags)
        self._renderer._platform.make_current()
        self.info = (GL.glGetString(GL.GL_RENDERER) or b"").decode()

    def draw(self, frame: int) -> NDArray[np.uint8]:
        self._rows[:, :3], self._rows[:, 3:6] = self._poses[frame], self._normals[frame]
        gl = self._gl
        self._renderer._platform.make_current()
        gl.glBindBuffer(gl.GL_ARRAY_BUFFER, self._primitive._buffers[0])
        gl.glBufferSubData(gl.GL_ARRAY_BUFFER, 0, self._rows.nbytes, self._rows)
        return self._renderer.render(self._scene, self._flags)[0]


def _looking_from(towards: NDArray) -> NDArray:
    """Return the pose (4, 4) of a light that shines from a direction: along its own -z."""
    z = towards / np.linalg.norm(towards)
    x = np.cross((0.0, 1.0, 0.0), z)
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    return pose
