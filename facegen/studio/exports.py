"""A clip or a recording as a file: every form that facegen writes, made in a folder that goes away."""

from __future__ import annotations

import shutil
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facegen.animation.animated import save_animation
from facegen.animation.clip import Clip
from facegen.animation.performance import Performance
from facegen.animation.playback import Playback
from facegen.animation.streams import save_performance
from facegen.animation.streams.files import FORMATS
from facegen.codec.link import write_stream
from facegen.codec.recording import encoder_for, in_order, rows
from facegen.codec.sampled import clip_performance
from facegen.errors import InputError, nearest
from facegen.fileio.sound import save_wav
from facegen.fileio.textfile import save_text
from facegen.fileio.video import FORMATS as FILMS
from facegen.jobs.frames import STAMP, save_clip
from facegen.progress import Progress, counted, within
from facegen.render.request import available_cores
from facegen.studio import script_text
from facegen.studio.limits import LIMITS, MEBIBYTE

# Frames that are worth another process: it takes as long to start as so many small ones take to draw.
_WORTH_A_PROCESS = 60
# Bytes of a picture for each pixel of the square that the head stands in: 0.52 at 256 pixels, 0.17 at 1080.
_BYTES = 0.5


@dataclass(frozen=True)
class Form:
    """One kind of file. ``label``: for people; ``kind``: how it is made; ``suffix``; ``name``: of a recording's format.

    films have a size, a rate and a view, animations a rate.
    """

    label: str
    kind: str
    suffix: str
    name: str = ""

    @property
    def is_drawn(self) -> bool:
        """Whether it is made of pictures."""
        return self.kind in ("film", "frames")


def _recordings() -> list[Form]:
    """Return the formats of recordings that are written; a .glb is an animation and stands above."""
    found = []
    for one in FORMATS.values():
        if one.write is not None and one.name != "gltf":
            about = one.about.partition(":")[0].partition(" (")[0]
            found.append(Form(f"Recording: {about} ({one.suffixes[0]})", "recording", one.suffixes[0], one.name))
    return found


FORMS: dict[str, Form] = {one.label: one for one in (
    Form("Film (.mp4)", "film", ".mp4"), Form("Film (.webm)", "film", ".webm"),
    Form("Moving picture (.gif)", "film", ".gif"), Form("Moving picture (.webp)", "film", ".webp"),
    Form("Moving picture (.apng)", "film", ".apng"), Form("Numbered pictures (.zip)", "frames", ".zip"),
    Form("Animated head (.glb)", "animation", ".glb"), *_recordings(),
    Form("Stream of few bits (.fgp)", "stream", ".fgp"), Form("Clip as text (.yaml)", "script", ".yaml"),
    Form("Sound (.wav)", "sound", ".wav"))}
"""What can be saved, by its label."""


@dataclass(frozen=True)
class Wish:
    """How it is made. ``face``: what `facegen.load_face` takes; size: (width, height); view: (yaw, pitch), degrees."""

    face: str = "akimoto"
    size: tuple[int, int] = (512, 512)
    fps: float = 25.0
    view: tuple[float, float] = (0.0, 0.0)
    background: str = "plain"
    renderer: str = "auto"


@dataclass(frozen=True)
class Made:
    """``path`` of what was made; ``warnings``: what is otherwise in it than it was."""

    path: Path
    warnings: tuple[str, ...] = ()


def form_of(label: str) -> Form:
    """Return what a label of `FORMS` stands for; InputError."""
    if label not in FORMS:
        raise InputError(f"format: unknown '{label}'{nearest(label, FORMS)}")
    return FORMS[label]


def check_room(motion: Clip | Playback, form: Form, folder: Path, wish: Wish) -> None:
    """Raise InputError for pictures that the disk or a browser cannot hold, estimated by their number and size, and for
    more frames than a clip may have. A recording's own frames were bounded when it was opened."""
    if form.kind in ("script", "sound") or (not form.is_drawn and isinstance(motion, Playback)):
        return
    frames = motion.frames(wish.fps)
    if not form.is_drawn:
        return
    pictures, zipped = _BYTES * frames * min(wish.size) ** 2, form.kind == "frames"
    free = shutil.disk_usage(folder).free / (4 if zipped else 2)        # packed, they are there twice
    most, why = min((LIMITS.export_bytes, "the studio puts on the disk"), (free, "the disk has room for"),
                    (LIMITS.download_bytes if zipped else np.inf, "a browser takes at once"))
    if pictures > most:
        raise InputError(f"size: {frames:,} pictures of {wish.size[0]} x {wish.size[1]} are about "
                         f"{pictures / MEBIBYTE:,.0f} MB, more than {why} ({most / MEBIBYTE:,.0f}); take a smaller "
                         "size or fewer pictures a second, or use the command facegen animate")


def export(motion: Clip | Playback, form: Form, folder: Path, name: str, wish: Wish, progress: Progress, *,
           script: Any = None) -> Made:
    """Make a file in a folder and return it. script: the clip's own, for "Clip as text".

    What ``progress`` raises stops the work; the folder is its owner's to remove. InputError, FileError; see
    `check_room`.
    """
    check_room(motion, form, folder, wish)
    path = folder / f"{name}{form.suffix}"
    if form.kind == "film":
        save_clip(motion, path, **_drawing(motion, wish), progress=progress)
        sound = getattr(motion, "sound", None)
        silent = sound is not None and not FILMS[form.suffix].sound
        return Made(path, (*motion.warnings, *(["this kind of file holds no sound; .mp4 and .webm do"] if silent
                                               else [])))
    if form.kind == "frames":
        return Made(_zipped(motion, path, wish, progress), motion.warnings)
    if form.kind == "animation":
        made = save_animation(motion, path, face=wish.face, fps=wish.fps, progress=progress)
        return Made(made.path, tuple(dict.fromkeys((*motion.warnings, *made.warnings))))
    if form.kind == "script":
        if not isinstance(motion, Clip):
            raise InputError("format: a recording is no script; save it as one of the recordings")
        save_text(script_text.write(script), path)
        return Made(path)
    if form.kind == "sound":
        if getattr(motion, "sound", None) is None:
            raise InputError("format: this clip has no sound; let it say something under Speech")
        return Made(save_wav(motion.sound, path))
    one = _performance(motion, wish.fps, within(progress, 0.0, 0.7))
    progress("writing", 0.7)
    if form.kind == "stream":
        return _streamed(one, path, wish.fps, within(progress, 0.7, 1.0))
    written = save_performance(one, path, form.name)
    return Made(path, written.warnings)


def _performance(motion: Clip | Playback, fps: float, progress: Progress) -> Performance:
    return clip_performance(motion, fps, progress) if isinstance(motion, Clip) else motion.performance


def _drawing(motion: Clip | Playback, wish: Wish) -> dict[str, Any]:
    workers = max(1, min(available_cores(), motion.frames(wish.fps) // _WORTH_A_PROCESS))
    return {"fps": wish.fps, "size": wish.size, "view": wish.view, "face": wish.face, "background": wish.background,
            "renderer": wish.renderer, "workers": workers}


def _zipped(motion: Clip | Playback, path: Path, wish: Wish, progress: Progress) -> Path:
    folder = path.with_suffix("")
    save_clip(motion, folder, **_drawing(motion, wish), progress=within(progress, 0.0, 0.95))
    frames = sorted(one for one in folder.iterdir() if one.name != STAMP)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as pack:        # PNG files are as small as they get
        for one in counted(within(progress, 0.95, 1.0), "packing", frames):
            pack.write(one, f"{folder.name}/{one.name}")
    return path


def _streamed(one: Performance, path: Path, fps: float, progress: Progress) -> Made:
    one = in_order(one)
    encoder = encoder_for(one, fps=fps)
    with open(path, "wb") as file:
        write_stream(encoder, counted(progress, "encoding", list(rows(one, encoder.dictionary.rate))), file)
    return Made(path, (*one.warnings, *encoder.told()))
