"""facegen: facial expressions from a name or a FACS script.

::

    import facegen

    face = facegen.load_face()
    vertices = face.pose("happiness")                        # (n, 3) millimetres
    pixels = facegen.render(face, "6C+12D", size=512)        # (512, 512, 4) uint8
    facegen.save_image(pixels, "smile.png")

Left and right are the subject's own. +x is the subject's left, +y up, +z forward.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from facegen.animation.clip import Clip
    from facegen.animation.performance import Performance
    from facegen.animation.playback import Playback
    from facegen.animation.script import load_clip, morph
    from facegen.animation.speech_script import say, speech_clip
    from facegen.animation.streams.files import load_performance, save_performance
    from facegen.blendshapes.recipes import Recipe, shape_set
    from facegen.codec.decoder import Decoder
    from facegen.codec.encoder import Encoder
    from facegen.codec.recording import decode_packets, encode_performance
    from facegen.errors import FacegenError, FileError, InputError, JobError, NotationError, TableError
    from facegen.face.avatar import AvatarFace
    from facegen.face.convert import Conversion, convert
    from facegen.face.face import Controls, Face, load_face
    from facegen.face.gaze import look_at
    from facegen.face.named import face_names
    from facegen.facs.blend import blend
    from facegen.facs.chance import random_expression
    from facegen.facs.deformation import Deformation, load_deformation
    from facegen.facs.expression_table import people
    from facegen.facs.expressions import Resolution, presets, resolve
    from facegen.facs.notation import canonical, parse
    from facegen.facs.tables import load_expressions, load_person, load_units
    from facegen.fileio.avatar import AvatarFile, load_avatar, save_avatar
    from facegen.fileio.images import contact_sheet, save_image
    from facegen.fileio.video import save_video
    from facegen.fitting.files import fit_files
    from facegen.fitting.fit import Fitted, fit_landmarks, fit_markers, fit_meshes
    from facegen.fitting.views import Pinhole, WeakCamera
    from facegen.geometry.mesh import Mesh
    from facegen.jobs.adopting import adopt
    from facegen.jobs.batch import run_batch
    from facegen.jobs.frames import save_clip, save_turn
    from facegen.jobs.rigging import rig
    from facegen.landmarking.propose import Proposer, propose_landmarks
    from facegen.render import Renderer, Wireframe, render, render_passes, save_passes
    from facegen.render.live import Live
    from facegen.transfer.rig import Rigging, avatar_names

__version__ = "0.1.0"

__all__ = [
    "AvatarFace",
    "AvatarFile",
    "Clip",
    "Controls",
    "Conversion",
    "Decoder",
    "Deformation",
    "Encoder",
    "Face",
    "FacegenError",
    "FileError",
    "Fitted",
    "InputError",
    "JobError",
    "Live",
    "Mesh",
    "NotationError",
    "Performance",
    "Pinhole",
    "Playback",
    "Proposer",
    "Recipe",
    "Renderer",
    "Resolution",
    "Rigging",
    "TableError",
    "WeakCamera",
    "Wireframe",
    "adopt",
    "avatar_names",
    "blend",
    "canonical",
    "contact_sheet",
    "convert",
    "decode_packets",
    "encode_performance",
    "face_names",
    "fit_files",
    "fit_landmarks",
    "fit_markers",
    "fit_meshes",
    "load_avatar",
    "load_clip",
    "load_deformation",
    "load_expressions",
    "load_face",
    "load_performance",
    "load_person",
    "load_units",
    "look_at",
    "morph",
    "parse",
    "people",
    "presets",
    "propose_landmarks",
    "random_expression",
    "render",
    "render_passes",
    "resolve",
    "rig",
    "run_batch",
    "save_avatar",
    "save_clip",
    "save_image",
    "save_passes",
    "save_performance",
    "save_turn",
    "save_video",
    "say",
    "shape_set",
    "speech_clip",
]

# Where each name lives. Read on first use (PEP 562), so that `import facegen` costs nothing.
_HOMES = {
    "facegen.animation.clip": ("Clip",),
    "facegen.animation.performance": ("Performance",),
    "facegen.animation.playback": ("Playback",),
    "facegen.animation.script": ("load_clip", "morph"),
    "facegen.animation.speech_script": ("say", "speech_clip"),
    "facegen.animation.streams.files": ("load_performance", "save_performance"),
    "facegen.blendshapes.recipes": ("Recipe", "shape_set"),
    "facegen.codec.decoder": ("Decoder",),
    "facegen.codec.encoder": ("Encoder",),
    "facegen.codec.recording": ("decode_packets", "encode_performance"),
    "facegen.errors": ("FacegenError", "FileError", "InputError", "JobError", "NotationError", "TableError"),
    "facegen.face.avatar": ("AvatarFace",),
    "facegen.face.convert": ("Conversion", "convert"),
    "facegen.face.face": ("Controls", "Face", "load_face"),
    "facegen.face.gaze": ("look_at",),
    "facegen.face.named": ("face_names",),
    "facegen.facs.blend": ("blend",),
    "facegen.facs.chance": ("random_expression",),
    "facegen.facs.deformation": ("Deformation", "load_deformation"),
    "facegen.facs.expression_table": ("people",),
    "facegen.facs.expressions": ("Resolution", "presets", "resolve"),
    "facegen.facs.notation": ("canonical", "parse"),
    "facegen.facs.tables": ("load_expressions", "load_person", "load_units"),
    "facegen.fileio.avatar": ("AvatarFile", "load_avatar", "save_avatar"),
    "facegen.fileio.images": ("contact_sheet", "save_image"),
    "facegen.fileio.video": ("save_video",),
    "facegen.fitting.files": ("fit_files",),
    "facegen.fitting.fit": ("Fitted", "fit_landmarks", "fit_markers", "fit_meshes"),
    "facegen.fitting.views": ("Pinhole", "WeakCamera"),
    "facegen.geometry.mesh": ("Mesh",),
    "facegen.jobs.adopting": ("adopt",),
    "facegen.jobs.batch": ("run_batch",),
    "facegen.jobs.frames": ("save_clip", "save_turn"),
    "facegen.jobs.rigging": ("rig",),
    "facegen.landmarking.propose": ("Proposer", "propose_landmarks"),
    "facegen.render.live": ("Live",),
    "facegen.render.overlay": ("Wireframe",),
    "facegen.render.passes": ("render_passes",),
    "facegen.render.passfiles": ("save_passes",),
    "facegen.render.render": ("Renderer",),
    "facegen.transfer.rig": ("Rigging", "avatar_names"),
    "facegen": ("render",),                 # the package itself: calling it draws
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'facegen' has no attribute {name!r}")
    from importlib import import_module

    if _HOME[name] == __name__:
        return import_module(f"{__name__}.{name}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
