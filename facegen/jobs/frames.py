"""Clips, recordings and turns of the camera as films: frames over processes, taken up again where a run stopped.

Frames are PNG files in a folder, each whole or not there. A stamp in the folder holds a fingerprint of all that the
frames depend on, so that only frames of the same film are kept; a film's frames lie in a hidden folder beside it until
the film is whole.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen import __version__
from facegen.animation.animated import save_animation
from facegen.animation.clip import Clip
from facegen.animation.easing import min_jerk
from facegen.animation.motion import Motion, Shown, Timed, frame_time
from facegen.animation.performance import Performance
from facegen.animation.playback import Playback
from facegen.data import tables_dir
from facegen.errors import FileError, InputError, TableError
from facegen.face.face import load_face
from facegen.face.named import is_face_name
from facegen.face.rig import Rig
from facegen.facs.deformation import Deformation
from facegen.facs.expressions import Resolution, resolve
from facegen.facs.yamlfile import read_data
from facegen.fileio.avatar import ANIMATED
from facegen.fileio.images import without_full_alpha, write_whole
from facegen.fileio.sound import Sound
from facegen.fileio.textfile import make_folder, save_text
from facegen.fileio.video import FORMATS, check_film, save_video
from facegen.geometry.camera import Camera, check_view, frame
from facegen.jobs.digests import digest_of, face_digest, file_digest
from facegen.jobs.runner import Report, run, shared
from facegen.progress import Progress, silent, within
from facegen.render.backends import choose, warm
from facegen.render.dress import portrait
from facegen.render.render import Renderer
from facegen.render.request import check_look, check_size, neutral_mesh

STAMP = ".facegen.json"
_TRIES = 400                # poses looked at, at most, to see how far a clip reaches
_LEVEL = 1                  # of PNG compression: frames are read once and removed


@dataclass(frozen=True)
class Shot:
    """All that the frames of a film depend on; pickled for every worker.

    what: the part of a motion that all frames share, or for a turn one pose. cameras: one for all frames, or one each.
    """

    what: Shown | Resolution
    fps: float
    frames: int
    face: str
    detail: int
    background: str | tuple[float, float, float]
    renderer: str
    cameras: tuple[Camera, ...]

    @cached_property
    def fingerprint(self) -> str:
        """A digest of everything here, and of the tables and the mesh."""
        files = [file_digest(path) for path in sorted(tables_dir().glob("*.yaml"))]
        return digest_of([__version__, _plain(self), files, face_digest(self.face, fresh=True)])

    def prepare(self) -> Callable[[Any], NDArray[np.uint8]]:
        """Return what draws the frame of a cue, which is the frame's number for a turn; made once in a worker."""
        face = load_face(self.face)

        def renderer(camera: Camera) -> Renderer:
            return Renderer(face, detail=self.detail, background=self.background, renderer=self.renderer, camera=camera)

        if isinstance(self.what, Resolution):
            vertices = face.pose(self.what, detail=self.detail)
            return lambda k: renderer(self.cameras[k]).draw(vertices)
        only, pose = renderer(self.cameras[0]), self.what.on(face, detail=self.detail)
        return lambda cue: only.draw(pose(cue))


@dataclass(frozen=True)
class FrameTask:
    """One frame (counted from 0) as a PNG file. ``cue``: what it shows, as the shot's `prepare` takes it."""

    shot: Shot
    index: int
    cue: Any
    output: Path
    group: str

    def finished(self) -> bool:
        """Return whether the frame is there; the folder's stamp says that it is of this film."""
        return self.output.exists()

    def make(self) -> None:
        """Draw it."""
        from PIL import Image

        pixels = without_full_alpha(shared(self.group, self.shot.prepare)(self.cue))
        write_whole(Image.fromarray(pixels), self.output, "frame", compress_level=_LEVEL)


def save_clip(clip: Motion | Performance, path: str | os.PathLike[str], *, fps: float = 25.0,
              size: int | tuple[int, int] = 512, view: tuple[float, float] = (0.0, 0.0),
              face: str | os.PathLike[str] = "akimoto", detail: int | None = None, background: Any = "plain",
              renderer: str = "auto", workers: int = 1, step: Callable[[], None] | None = None,
              progress: Progress = silent) -> Report:
    """Draw a clip, or a recording, into a film or into a folder of numbered pictures, and say what was done.

    clip: a `Clip`, a `Performance`, or a `Playback` of one. path: .mp4, .webm, .gif, .webp, .apng or .png; a name
    without suffix is a folder that gets ``frame_00001.png`` and so on; .glb, .gltf or .vrm becomes an animation of
    blendshapes, see `facegen.animation.animated.save_animation`, for which the camera's options do not count. face: a
    face's name or path. workers: processes that draw; in a script, more than 1 needs the usual
    ``if __name__ == "__main__":``. step: called once a frame. progress: called with what is done and the
    share that is behind; what it raises stops the work as Ctrl-C does. The rest is as for `Renderer`; the camera stands
    still and shows all that the clip reaches.

    The same call after a stop goes on where it stopped. Raises InputError, or FileError for the path, before work
    starts. ::

        facegen.save_clip(facegen.load_clip("greeting.yaml"), "greeting.mp4")
    """
    size, view = check_size(size), check_view(view)
    clip = as_motion(clip)
    count = clip.frames(fps)
    if Path(path).suffix.lower() in ANIMATED:
        return Report(save_animation(clip, path, face=face, fps=fps, detail=detail, progress=progress).keys, 0)
    rig, name, mesh, level, chosen = _prepared(face, size, view, detail, background, renderer, count)
    clip.check(rig)                     # a point that this face lacks is said now
    target = _Target(Path(path), size, fps)
    head = portrait(rig, mesh.vertices)
    progress("looking how far it reaches", 0.0)
    camera = frame(head, _reach(rig, clip, frame(head, size=size, view=view)), size=size, view=view)
    shot = Shot(clip.shown, float(fps), count, name, level, background, chosen, (camera,))
    cues = [clip.cue(frame_time(k, fps)) for k in range(count)]
    return target.fill(shot, cues, workers, step, sound=getattr(clip, "sound", None), progress=progress)


def as_motion(clip: Motion | Performance) -> Motion:
    """Return what is to be filmed, a performance as its playback; InputError for anything else."""
    if isinstance(clip, Performance):
        return Playback(clip)
    if not isinstance(clip, Timed):
        raise InputError("clip: expected a Clip, as load_clip and morph make them, or a Performance, as "
                         f"load_performance reads them, got {type(clip).__name__}")
    return clip


def save_turn(what: Any, path: str | os.PathLike[str], *, seconds: float = 4.0, fps: float = 25.0,
              turn: tuple[float, float] | None = None, pitch: float = 0.0, size: int | tuple[int, int] = 512,
              face: str | os.PathLike[str] = "akimoto", person: Any = None, detail: int | None = None,
              background: Any = "plain", renderer: str = "auto", workers: int = 1,
              step: Callable[[], None] | None = None) -> Report:
    """Draw one pose with the camera going round it; arguments as for `save_clip`.

    what: anything that a face's ``pose`` takes. turn: None goes once round; (from, to) swings between two yaws and
    back, degrees. pitch: how high the camera stands, degrees. The film can be shown round and round.
    """
    size, (_, pitch) = check_size(size), check_view((0.0, pitch))
    pose = what if isinstance(what, Resolution) else resolve(what, person=person)
    count = Clip((), seconds).frames(fps)
    yaws = [360.0 * k / count for k in range(count)]
    if turn is not None:
        try:
            start, end = (float(yaw) for yaw in turn)
        except (TypeError, ValueError):
            raise InputError(f"turn: expected two yaws in degrees, (from, to), got {turn!r}") from None
        for yaw in (start, end):
            check_view((yaw, pitch))
        yaws = [start + (end - start) * min_jerk(1.0 - abs(1.0 - 2.0 * k / count)) for k in range(count)]
    rig, name, mesh, level, chosen = _prepared(face, size, (yaws[0], pitch), detail, background, renderer, count)
    posed = rig.pose(pose, detail=level)
    target = _Target(Path(path), size, fps)
    reach = np.concatenate([portrait(rig, mesh.vertices), portrait(rig, posed)])
    cameras = _orbit(reach, size, [(yaw, pitch) for yaw in yaws])
    return target.fill(Shot(pose, float(fps), count, name, level, background, chosen, cameras), range(count), workers,
                       step)


def _prepared(face: object, size: tuple[int, int], view: tuple[float, float], detail: int | None, background: Any,
              renderer: str, count: int) -> tuple[Rig, str, Any, int, str]:
    """Return the checked face, its name, its neutral mesh, the level of detail and the renderer to use."""
    if not isinstance(face, (str, os.PathLike)):
        raise InputError(f"face: expected a name or a path, which every process can load, got {type(face).__name__}")
    chosen = choose(renderer, pictures=count, pixels=size[0] * size[1])
    check_look(background=background)
    name = os.fspath(face)
    rig = load_face(name)
    if not is_face_name(name):
        name = str(Path(name).resolve())        # workers may have another folder
    mesh, level = neutral_mesh(rig, detail=detail, size=size, view=view, orthographic=False, flat=False, camera=None)
    return rig, name, mesh, int(level or 0), chosen


def _reach(rig: Rig, clip: Motion, camera: Camera) -> NDArray[np.float64]:
    """Return the vertices (k, 3) that go farthest left, right, up and down in the picture during a clip."""
    count = min(_TRIES // 2, 10 * int(clip.duration) + 10)
    times = [*np.linspace(0.0, clip.duration, count), *clip.corners[:: 1 + len(clip.corners) // (_TRIES // 2)]]
    found, pose = [], clip.shown.on(rig, detail=0)
    for t in times:
        vertices = portrait(rig, pose(clip.cue(float(t))))
        points = camera.project(vertices)[:, :2]
        found.append(vertices[np.concatenate([points.argmin(axis=0), points.argmax(axis=0)])])
    return np.concatenate(found)


def _orbit(vertices: NDArray[np.float64], size: tuple[int, int], views: Sequence[tuple[float, float]]
           ) -> tuple[Camera, ...]:
    """Return a camera for each view, all of one scale and offset, so that the head turns in its place."""
    cameras = [replace(frame(vertices, size=size, view=view), scale=1.0, offset=(0.0, 0.0)) for view in views]
    spread = np.array([(p.min(axis=0), p.max(axis=0)) for p in (c.project(vertices)[:, :2] for c in cameras)])
    low, high = spread[:, 0].min(axis=0), spread[:, 1].max(axis=0)
    whole = np.array(size, float)
    scale = float((0.9 * whole.min() / (high - low) * whole / whole.min()).min())
    x, y = whole / 2 - scale * (low + high) / 2
    return tuple(replace(camera, scale=scale, offset=(float(x), float(y))) for camera in cameras)


class _Target:
    """Where frames go: a film with a work folder, or a folder of frames."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        self.path, self.fps = path, fps
        if path.suffix.lower() in FORMATS and path.is_dir():
            raise FileError(f"{path}: is a folder, expected a file")
        self.is_film = bool(path.suffix) and not path.is_dir()
        if self.is_film:
            check_film(path, size=size, fps=fps)
            self.folder = path.with_name(f".{path.name}.frames")
            return
        self.folder = path
        if path.exists() and not path.is_dir():
            raise FileError(f"{path}: is a file; a name without a suffix means a folder of frames")
        if not path.parent.is_dir():
            raise FileError(f"{path}: the folder {path.parent} does not exist; make it first")
        if not (path / STAMP).exists() and any(path.glob("frame_*.png")):
            raise FileError(f"{path}: holds frames that facegen did not make here; choose another folder or remove "
                            "them")

    def fill(self, shot: Shot, cues: Sequence[Any], workers: int, step: Callable[[], None] | None, *,
             sound: Sound | None = None, progress: Progress = silent) -> Report:
        """Draw what is missing and put the film together, with a sound if its kind can have one.

        cues: of every frame.
        """
        self._open(shot)
        paths = [self.folder / f"frame_{k:05d}.png" for k in range(1, shot.frames + 1)]
        tasks = [FrameTask(shot, k, cue, path, shot.fingerprint)
                 for k, (cue, path) in enumerate(zip(cues, paths, strict=True))]
        if workers > 1:
            warm(shot.renderer, coloured=load_face(shot.face).mesh(shot.detail).colours is not None)
        drawing = _Steps(within(progress, 0.0, 0.9 if self.is_film else 1.0), len(tasks), step)
        report = run(tasks, workers=workers, step=drawing.step)
        if self.is_film:
            heard = sound if FORMATS[self.path.suffix.lower()].sound else None
            save_video(_Frames(paths), self.path, fps=self.fps, sound=heard,
                       progress=within(progress, 0.9, 1.0))
            shutil.rmtree(self.folder, ignore_errors=True)
        return report

    def _open(self, shot: Shot) -> None:
        """Make the folder ready: frames of another film are removed, never mixed in."""
        make_folder(self.folder)
        stamp = self.folder / STAMP
        try:
            known = read_data(stamp) if stamp.exists() else None
        except (FileError, TableError):
            known = None
        if not isinstance(known, dict) or known.get("fingerprint") != shot.fingerprint:
            # Old frames go before the new stamp comes: a stop in between leaves fewer frames, never wrong ones.
            try:
                for old in self.folder.glob("frame_*.png"):
                    old.unlink()
            except OSError as error:
                raise FileError(f"{self.folder}: old frames cannot be removed: {error.strerror or error}") from error
            text = json.dumps({"fingerprint": shot.fingerprint, "frames": shot.frames, "fps": shot.fps})
            save_text(text + "\n", stamp)


class _Steps:
    """Counts the frames that are drawn, and tells of them."""

    def __init__(self, progress: Progress, count: int, step: Callable[[], None] | None) -> None:
        self.progress, self.count, self.also, self.done = progress, count, step, 0
        progress("drawing", 0.0)

    def step(self) -> None:
        self.done += 1
        if self.also is not None:
            self.also()
        self.progress(f"drawing, {self.done} of {self.count}", self.done / self.count)


class _Frames(Sequence):
    """Frame files as pictures, read when asked for. All have alpha if the first has."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths = paths
        self.mode = "RGB"
        if any(self._mode(path) == "RGBA" for path in paths):
            self.mode = "RGBA"

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, k: int) -> ArrayLike:
        from PIL import Image

        with Image.open(self.paths[k]) as picture:
            return np.asarray(picture.convert(self.mode))

    @staticmethod
    def _mode(path: Path) -> str:
        from PIL import Image

        with Image.open(path) as picture:       # reads the head of the file only
            return picture.mode


def _plain(value: Any) -> Any:
    """Return data as JSON knows them, every number with all its digits."""
    if isinstance(value, Deformation):
        return value.as_dict()
    if isinstance(value, Resolution):
        return [_plain(value.units), _plain(value.deformation), _plain(value.more), _plain(value.own)]
    if is_dataclass(value):
        return {one.name: _plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, (set, frozenset)):
        return sorted(value)
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    return value.tolist() if hasattr(value, "tolist") else value
