"""One picture of a data set as a task: the picture, its mask, and its label."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from facegen import __version__
from facegen.errors import FileError, InputError
from facegen.face.face import load_face
from facegen.face.rig import Rig
from facegen.facs.deformation import deformation_from_dict
from facegen.facs.expressions import resolve_units
from facegen.facs.notation import canonical
from facegen.fileio.images import save_image, save_mask
from facegen.fileio.textfile import save_text
from facegen.geometry.camera import Camera, frame
from facegen.jobs.digests import digest_of, face_digest, table_digests
from facegen.jobs.runner import shared
from facegen.jobs.spec import Picture, Settings, thawed
from facegen.render.dress import portrait
from facegen.render.lighting import load_light
from facegen.render.passes import Points, render_passes
from facegen.render.passfiles import camera_data
from facegen.render.render import Renderer

IMAGES, MASKS, LABELS = "images", "masks", "labels"
# Tables that a worker itself reads.
DRAWN_BY = ("action_units.yaml", "deformations.yaml", "lights.yaml", "vocabularies.yaml")


@dataclass(frozen=True)
class PictureTask:
    """Draws ``images/NAME``, with ``masks/NAME.png`` if asked, and then writes ``labels/NAME.json``.

    The label comes last and tells that all is there: it holds the fingerprint of all that decides the picture.
    ``data``: digest of the tables and the face where the run was started. ``threads``: how many may draw; no matter
    for the picture.
    """

    folder: Path
    name: str
    picture: Picture
    settings: Settings
    data: str
    threads: int | None = None

    @property
    def output(self) -> Path:
        """The label."""
        return self.folder / LABELS / f"{self.name}.json"

    @property
    def file(self) -> str:
        """The picture, from the data set's folder."""
        return f"{IMAGES}/{self.name}.{self.settings.format}"

    @property
    def mask(self) -> str | None:
        """The mask, from the data set's folder."""
        return f"{MASKS}/{self.name}.png" if self.settings.masks else None

    @property
    def group(self) -> str:
        """One face, camera and light: what a renderer is made for."""
        p = self.picture
        return f"{p.face} {p.size} {p.view} {p.light} {p.background}"

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of all that decides the picture and its label."""
        return digest_of([self.name, asdict(self.picture), asdict(self.settings), self.data, __version__])

    def finished(self) -> bool:
        """Return whether picture, mask and label are there and whole, made from the same data."""
        try:
            label = json.loads(self.output.read_bytes())
            return label["fingerprint"] == self.fingerprint and all(
                (self.folder / file).stat().st_size == size for file, size in label["bytes"].items())
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return False

    def make(self) -> None:
        """Draw, then label."""
        if data_digest(self.picture.face) != self.data:
            raise InputError(f"this worker has other data than the run that sent it: facegen {__version__} with other "
                             "tables or another face; install the same on all machines")
        try:
            self.output.unlink(missing_ok=True)     # while the picture is drawn anew, no old label vouches for it
        except OSError as error:
            raise FileError(f"{self.output}: cannot be replaced: {error.strerror or error}") from error
        p, face = self.picture, load_face(self.picture.face)
        renderer = shared((self.group, self.settings), lambda: self._renderer(face, None))
        pose: Any = dict(p.units) if p.deformation is None else deformation_from_dict(thawed(p.deformation))
        if p.own and p.deformation is None:
            pose = resolve_units(pose, {name: deformation_from_dict(one) for name, one in thawed(p.own).items()})
        vertices = face.pose(pose, detail=renderer.detail)
        camera = frame(portrait(face, renderer.mesh.vertices), portrait(face, vertices), size=p.size, view=p.view,
                       orthographic=self.settings.orthographic)
        if (camera.scale, camera.offset) != (renderer.camera.scale, renderer.camera.offset):
            renderer = self._renderer(face, camera)     # the pose leaves the neutral's frame
        files = [save_image(renderer.draw(vertices), self.folder / self.file)]
        wanted = [*(["part"] if self.mask else []), *(["landmarks"] if face.landmarks else []),
                  *(["feature_points"] if self.settings.feature_points else [])]
        found = render_passes(face, vertices, passes=wanted, detail=renderer.detail, camera=camera) if wanted else {}
        if self.mask:
            files.append(save_mask(found["part"], self.folder / self.mask))
        label = self._label(camera, renderer.detail)
        for name in ("landmarks", "feature_points"):
            if name in found:
                label[name] = _places(found[name])
        label["bytes"] = {file.relative_to(self.folder).as_posix(): file.stat().st_size for file in files}
        label["fingerprint"] = self.fingerprint
        save_text(json.dumps(label, ensure_ascii=False) + "\n", self.output)

    def _renderer(self, face: Rig, camera: Camera | None) -> Renderer:
        p, s = self.picture, self.settings
        return Renderer(face, size=p.size, view=p.view, detail=s.detail, background=p.background,
                        orthographic=s.orthographic, camera=camera, scene=load_light(p.light), renderer=s.renderer,
                        threads=self.threads)

    def _label(self, camera: Camera, detail: int | None) -> dict[str, Any]:
        p = self.picture
        pose: dict[str, Any] = {"said": p.pose, "kind": p.kind, "name": p.caption}
        if p.deformation is None:
            pose |= {"units": dict(p.units), "script": canonical(dict(p.units))}
        else:
            pose["deformation"] = thawed(p.deformation)
        return {"name": self.name, "file": self.file, "mask": self.mask, "pose": pose, "person": p.person,
                "intensity": p.intensity, "face": p.face, "light": p.light, "background": p.background,
                "size": list(p.size), "view": list(p.view), "detail": detail, "camera": camera_data(camera)}


def picture_tasks(folder: Path, names: list[str], pictures: list[Picture], settings: Settings, *,
                  threads: int | None = None) -> list[PictureTask]:
    """Return the tasks of a data set in a folder, whose path is absolute: a worker stands elsewhere."""
    return [PictureTask(folder, name, one, settings, data_digest(one.face), threads)
            for name, one in zip(names, pictures, strict=True)]


def data_digest(face: str) -> str:
    """Return the digest of all data that are read while a picture is drawn."""
    tables = table_digests()
    return digest_of([face_digest(face), [tables[name] for name in DRAWN_BY]])


def _places(points: Points) -> dict[str, dict[str, Any]]:
    """Return name -> pixels, millimetres and whether it is seen, rounded to what means anything."""
    xy, xyz = np.round(points.xy, 3), np.round(points.places, 4)
    return {name: {"xy": xy[i].tolist(), "xyz": xyz[i].tolist(), "visible": bool(points.visible[i])}
            for i, name in enumerate(points.names)}
