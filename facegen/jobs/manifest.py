"""What a finished data set says of itself: ``manifest.json``, ``pictures.jsonl`` and ``pictures.csv``."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from facegen import __version__
from facegen.errors import JobError
from facegen.face.face import load_face
from facegen.fileio.textfile import save_text, whole_file
from facegen.jobs.digests import face_digest, table_digests
from facegen.jobs.picture import PictureTask
from facegen.jobs.spec import Settings

MANIFEST, LINES, TABLE = "manifest.json", "pictures.jsonl", "pictures.csv"
_COLUMNS = ("file", "mask", "name", "pose", "units", "person", "intensity", "face", "light", "background", "width",
            "height", "yaw", "pitch")
_ABOUT = {
    "axes": "world: millimetres, +x the subject's left, +y up, +z forward; left and right are the subject's",
    "camera": "extrinsics: 3x4, world to camera, [R | t] @ (x, y, z, 1); camera axes: x to the picture's right, "
              "y down, z away from the viewer. intrinsics: 3x3, K @ (X/Z, Y/Z, 1) is in pixels; where projection is "
              "orthographic, K @ (X, Y, 1)",
    "pixels": "x to the right, y down; the centre of the first pixel is (0.5, 0.5)",
    "view": "yaw and pitch of the camera round the head, degrees; positive yaw goes to the subject's left, pitch up",
    "landmarks": "xy: pixels; xyz: the posed place, world; visible: inside the picture and not behind a surface",
    "mask": "grey PNG: each pixel is a number of mask_parts",
}


def write_manifest(folder: Path, tasks: Sequence[PictureTask], settings: Settings) -> Path:
    """Write the three files from the labels of all pictures and return the manifest's path.

    The manifest is written last: where it is, the data set is complete. Labels are read one by one, so a million
    cost time, not memory.
    """
    (folder / MANIFEST).unlink(missing_ok=True)
    # newline="" and "\n": the same bytes on every system.
    with whole_file(folder / LINES) as lines, whole_file(folder / TABLE) as table, \
            open(lines, "w", encoding="utf-8", newline="\n") as to_lines, \
            open(table, "w", encoding="utf-8", newline="") as to_table:
        rows = csv.writer(to_table, lineterminator="\n")
        rows.writerow(_COLUMNS)
        for label in _labels(tasks):
            to_lines.write(json.dumps(label, ensure_ascii=False) + "\n")
            rows.writerow(_row(label))
    faces = list(dict.fromkeys(task.picture.face for task in tasks))
    header: dict[str, Any] = {
        "facegen": __version__, "pictures": len(tasks), "labels": LINES, "table": TABLE, "format": settings.format,
        "renderer": settings.renderer, "about": _ABOUT,
        "faces": {face: {"digest": face_digest(face), "landmarks": list(load_face(face).landmarks),
                         **({"mask_parts": _parts(face)} if settings.masks else {})} for face in faces},
        "tables": table_digests(),
    }
    return save_text(json.dumps(header, indent=2, ensure_ascii=False) + "\n", folder / MANIFEST)


def _labels(tasks: Sequence[PictureTask]) -> Iterator[dict[str, Any]]:
    for task in tasks:
        try:
            label = json.loads(task.output.read_bytes())
        except (OSError, ValueError) as error:
            raise JobError(f"{task.output}: cannot be read though it was written ({error}): does another program, or a "
                           "second run, change the folder?") from error
        yield {key: value for key, value in label.items() if key != "bytes"}


def _row(label: dict[str, Any]) -> list[Any]:
    pose = label["pose"]
    background = label["background"]
    flat = {**label, "pose": pose["name"] if pose["kind"] != "deformation" else pose["said"],
            "units": pose.get("script", ""), "width": label["size"][0], "height": label["size"][1],
            "yaw": label["view"][0], "pitch": label["view"][1],
            "background": background if isinstance(background, str) else ",".join(f"{c:g}" for c in background)}
    return [flat[name] for name in _COLUMNS]


def _parts(face: str) -> dict[str, int]:
    return {"nothing": 0, **{name: i + 1 for i, name in enumerate(load_face(face).mesh(0).parts)}}
