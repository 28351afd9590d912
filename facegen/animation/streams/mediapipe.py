"""MediaPipe face blendshapes: categories with scores (google-ai-edge, "Face landmarker"), as JSON and as CSV.

JSON: a list of results, an object with a list of them ("frames"), or one result a line. A result has `faceBlendshapes`
(or `face_blendshapes`): for each face its categories, `categoryName` and `score`; and perhaps
`facialTransformationMatrixes`, of which the head is taken: centimetres, in our axes. CSV: a column a category, a row a
frame. `_neutral` is no shape: it is kept aside.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from facegen.animation.performance import Performance
from facegen.animation.streams import tabular
from facegen.animation.streams.formats import Format, Sample, Wish
from facegen.animation.streams.jsonframes import Frame, frames_of
from facegen.animation.streams.times import counted, in_order
from facegen.animation.streams.turns import head_of, rotation
from facegen.blendshapes.names import match
from facegen.blendshapes.recipes import shape_set
from facegen.errors import FileError, InputError
from facegen.fileio.table import read_table
from facegen.fileio.textfile import whole_file

Array = NDArray[np.float64]

NAME, NAME_CSV = "mediapipe", "mediapipe-csv"
NEUTRAL = "_neutral"

_MILLISECONDS = ("timestamp_ms", "timestampms", "time_ms", "timestamp")
_SECONDS = ("time", "seconds", "t")
_FACES = ("faceblendshapes", "face_blendshapes", "blendshapes")
_MATRICES = ("facialtransformationmatrixes", "facial_transformation_matrixes")
# A middle step below this can be no milliseconds, because nothing films a thousand frames a second.
_LEAST_STEP_MS = 1.0
_CENTIMETRE = 10.0                      # millimetres


def knows_json(sample: Sample) -> bool:
    """Return whether a file is JSON that speaks of blendshapes."""
    words = (*_FACES, "categoryname", "category_name", "browdown")
    return sample.is_json and any(word.encode() in sample.head.lower() for word in words)


def knows_csv(sample: Sample) -> bool:
    """Return whether a file has categories as columns, and `_neutral` or times in milliseconds beside them."""
    return "jawopen" in sample.columns and bool({NEUTRAL, *_MILLISECONDS} & sample.columns)


def read_json(path: Path, wish: Wish) -> Performance:
    """Return the performance of a file. FileError, InputError."""
    frames, said = frames_of(path)
    known = dict.fromkeys(shape_set("arkit"), ())
    which = _person(path, frames, wish, said)
    found: list[dict[str, float]] = []
    times, head, place = [], np.full((len(frames), 3), np.nan), np.full((len(frames), 3), np.nan)
    for k, frame in enumerate(frames):
        faces = _faces(frame)
        found.append(_scores(faces[which]) if which < len(faces) else {})
        times.append(_time(frame))
        matrix = _matrix(frame, which)
        if matrix is not None:
            head[k], place[k] = matrix
    names = list(dict.fromkeys(name for one in found for name in one))
    spelt = match(names, known)
    if not spelt:
        raise FileError(f"{path}: no frame has a category that is a shape of ARKit, such as jawOpen"
                        + (f"; the first are {', '.join(map(repr, names[:5]))}" if names else ""))
    order = [name for name in known if name in spelt.values()]
    back = {shape: name for name, shape in spelt.items()}
    weights = np.array([[one.get(back[shape], np.nan) for shape in order] for one in found])
    lost = ~np.isfinite(weights).any(axis=1)
    if lost.any():
        said.append(f"{int(lost.sum())} of {len(frames)} frames without a face")
    extra = {name: np.array([one.get(name, np.nan) for one in found]) for name in names if name not in spelt}
    strange = [name for name in extra if name != NEUTRAL]
    if strange:
        said.append(f"no shapes of ARKit, kept aside: {', '.join(strange[:5])}{' ...' if len(strange) > 5 else ''}")
    lines = np.array([frame.line for frame in frames])
    rows, odd = in_order(path, _seconds(path, times, len(frames), wish), lines)
    stamps = _seconds(path, times, len(frames), wish)[rows]
    return Performance(stamps, tuple(order), weights[rows], "arkit",
                       head[rows] if np.isfinite(head).any() else None,
                       place[rows] if np.isfinite(place).any() else None,
                       extra={name: column[rows] for name, column in extra.items()},
                       about={"format": NAME, "path": str(path)}, warnings=tuple(f"{path}: {one}" for one in
                                                                                 (*said, *odd)))


def write_json(one: Performance, path: Path) -> None:
    """Write ARKit's shapes as a list of results with their times in milliseconds, one a line."""
    before = tabular.original(one, NAME)
    neutral = before.get(NEUTRAL)
    names = [NEUTRAL, *sorted(one.names)] if neutral is not None else sorted(one.names)
    columns = [neutral if name == NEUTRAL else one.column(name) for name in names]
    values = np.column_stack(columns) if columns else np.empty((len(one), 0))
    with whole_file(path) as draft, draft.open("w", encoding="utf-8", newline="\n") as file:
        file.write('{"frames": [\n')
        for k, (time, row) in enumerate(zip(one.times.tolist(), values.tolist(), strict=True)):
            categories = [{"index": i, "categoryName": name, "score": round(score, 12)}
                          for i, (name, score) in enumerate(zip(names, row, strict=True)) if score == score]
            result: dict[str, Any] = {"timestampMs": round(time * 1000.0, 6),
                                      "faceBlendshapes": [{"categories": categories}] if categories else []}
            if one.head is not None and np.isfinite(one.head[k]).all():
                result["facialTransformationMatrixes"] = [_as_matrix(one, k)]
            file.write(json.dumps(result) + (",\n" if k < len(one) - 1 else "\n"))
        file.write("]}\n")


def read_csv(path: Path, wish: Wish) -> Performance:
    """Return the performance of a file. FileError, InputError."""
    table = read_table(path)
    known = dict.fromkeys(shape_set("arkit"), ())
    spelt = match(table.columns, known)
    if not spelt:
        raise FileError(f"{path}: expected the names of categories as columns, such as jawOpen")
    back = {shape: name for name, shape in spelt.items()}
    weights = {shape: table.column(back[shape]) for shape in known if shape in back}
    said: list[str] = []
    missing = [name for name in known if name not in weights and name != "tongueOut"]
    if missing:
        said.append(f"columns that are missing: {', '.join(missing)}")
    tabular.outside(table, weights, 1.0, said)
    face = tabular.column_of(table, "face_id", "face")
    rows, person, more = tabular.the_person(
        path, ["0"] * len(table) if face is None else [f"{value:g}" for value in face.tolist()], wish)
    stamps = tabular.column_of(table, *_MILLISECONDS)
    times = tabular.column_of(table, *_SECONDS) if stamps is None else _as_seconds(stamps)
    return tabular.performance(table, NAME_CSV, "arkit", weights,
                               tabular.seconds(table, wish, times, tabular.column_of(table, "frame")), rows=rows,
                               person=person if face is not None else "", said=[*said, *more])


def write_csv(one: Performance, path: Path) -> None:
    """Write ARKit's shapes as columns, with times in milliseconds. What a file of its own had is kept."""
    before = tabular.original(one, NAME_CSV)
    made: dict[str, NDArray] = {}
    if not before:
        made |= {"frame": np.arange(float(len(one))), "timestamp_ms": one.times * 1000.0,
                 NEUTRAL: one.extra.get(NEUTRAL, np.where(one.found, 0.0, np.nan))}
    spelling = {shape: name for name, shape in match(before, dict.fromkeys(one.names, ())).items()}
    made |= {spelling.get(name, name): one.column(name) for name in sorted(one.names)}
    stamp = next((name for name in before if name.casefold() in _MILLISECONDS), None)
    if stamp is not None and _as_seconds(before[stamp]).tolist() != one.times.tolist():
        made[stamp] = one.times * 1000.0
    tabular.save_table(path, before | {name: tabular.again(name, now, before) for name, now in made.items()})


def _person(path: Path, frames: Sequence[Frame], wish: Wish, said: list[str]) -> int:
    """Return which face of each frame is meant: they are counted from 0."""
    most = max(len(_faces(frame)) for frame in frames)
    if wish.person is None:
        if most > 1:
            said.append(f"up to {most} faces in a frame; took the first: say which person for another")
        return 0
    if not wish.person.isdecimal() or int(wish.person) >= max(most, 1):
        raise InputError(f"person: {path} has {most} faces, counted from 0; got {wish.person!r}")
    return int(wish.person)


def _faces(frame: Frame) -> list[Any]:
    """Return the faces of a result: each a list of categories, or a mapping of names to scores."""
    found = frame.get(*_FACES)
    if found is None and frame.get("categories") is not None:
        found = [frame.value]
    if found is None and isinstance(frame.value, list):
        return [frame.value] if frame.value else []
    if isinstance(found, Mapping):
        return [found]
    if not isinstance(found, list):
        return []
    if found and isinstance(found[0], Mapping) and _name_of(found[0]) is not None:
        return [found]                                  # the categories of the only face
    return found


def _scores(face: Any) -> dict[str, float]:
    """Return name -> score of a face; what is none is left out."""
    if isinstance(face, Mapping) and isinstance(face.get("categories"), list):
        face = face["categories"]
    pairs: Iterator[tuple[Any, Any]]
    if isinstance(face, Mapping):
        pairs = iter(face.items())
    elif isinstance(face, list):
        pairs = ((_name_of(one), one.get("score")) for one in face if isinstance(one, Mapping))
    else:
        return {}
    return {name: float(score) for name, score in pairs
            if isinstance(name, str) and isinstance(score, (int, float)) and not isinstance(score, bool)
            and abs(score) < 1e6}


def _name_of(category: Mapping) -> Any:
    return category.get("categoryName", category.get("category_name"))


def _time(frame: Frame) -> tuple[str, float] | None:
    """Return the unit and the number of a result's time."""
    for unit, keys in (("ms", _MILLISECONDS), ("s", _SECONDS)):
        value = frame.get(*keys)
        if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e15:
            return unit, float(value)
    return None


def _seconds(path: Path, times: Sequence[tuple[str, float] | None], count: int, wish: Wish) -> Array:
    if wish.fps is not None:
        return counted(None, count, wish.fps)
    if not any(times):
        raise FileError(f"{path}: its frames have no times; say how many frames a second it has (fps)")
    values = np.array([np.nan if time is None else time[1] for time in times])
    return values if next(time for time in times if time)[0] == "s" else _as_seconds(values)


def _as_seconds(stamps: Array) -> Array:
    """Return milliseconds as seconds from the first; seconds, if they cannot be milliseconds."""
    there = stamps[np.isfinite(stamps)]
    if not len(there):
        return stamps
    step = np.median(np.abs(np.diff(there))) if len(there) > 1 else np.inf
    return (stamps - (there[0] if there[0] > 1e9 else 0.0)) / (1000.0 if step >= _LEAST_STEP_MS else 1.0)


def _matrix(frame: Frame, which: int) -> tuple[Array, Array] | None:
    """Return head and place of a result's matrix; None for none, or what is no turn."""
    found = frame.get(*_MATRICES)
    if not isinstance(found, list) or which >= len(found):
        return None
    one = found[which]
    data = one.get("data") if isinstance(one, Mapping) else one
    try:
        matrix = np.array(data, dtype=float)
    except (TypeError, ValueError):
        return None
    if matrix.shape == (16,):                           # by columns, as MediaPipe packs it, unless seen to be by rows
        matrix = matrix.reshape(4, 4)
        by_rows = np.allclose(matrix[3, :3], 0.0) and not np.allclose(matrix[:3, 3], 0.0)
        matrix = matrix if by_rows else matrix.T
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        return None
    scale = np.cbrt(np.linalg.det(matrix[:3, :3]))
    if not 0.01 < scale < 100.0:
        return None
    return head_of(Rotation.from_matrix(matrix[None, :3, :3] / scale))[0], matrix[:3, 3] * _CENTIMETRE


def _as_matrix(one: Performance, k: int) -> dict[str, Any]:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(one.head[k:k + 1]).as_matrix()[0]
    if one.place is not None and np.isfinite(one.place[k]).all():
        matrix[:3, 3] = one.place[k] / _CENTIMETRE
    return {"rows": 4, "columns": 4, "data": [round(value, 9) for value in matrix.T.ravel().tolist()]}


MEDIAPIPE = Format(NAME, "MediaPipe face blendshapes with scores (JSON, or a result a line)",
                   (".json", ".jsonl", ".ndjson"), knows_json, read_json, write_json, "arkit",
                   parts=("head", "place"))
MEDIAPIPE_CSV = Format(NAME_CSV, "MediaPipe face blendshapes as columns, _neutral among them (CSV)", (".csv",),
                       knows_csv, read_csv, write_csv, "arkit", parts=())
