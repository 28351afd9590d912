"""What was measured, as files have it: meshes, markers, landmarks (docs/fit.md)."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.animation.streams.formats import Wish
from facegen.animation.streams.tabular import column_of, the_person
from facegen.animation.streams.times import counted, in_order
from facegen.errors import FileError, InputError, nearest
from facegen.face.face import Face
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data
from facegen.fileio.avatar import load_avatar
from facegen.fileio.table import Table, read_table
from facegen.fitting.rigs import Rig

Array = NDArray[np.float64]

MESHES = (".obj", ".ply", ".glb", ".gltf", ".vrm", ".stl")
TABLES = (".csv", ".tsv", ".txt")
ARRAYS = (".npz", ".npy")
DATA = (".yaml", ".yml", ".json")
READABLE = (*MESHES, *TABLES, *ARRAYS, *DATA)

# Numbers in a file of points: an hour of 478 points in space at 60 frames a second is twice this.
_MOST = 150_000_000
_FARTHEST = 1e9
_NUMBERED = re.compile(r"(?:.*?_)??([xyzXYZ])_?([0-9]{1,4})|.*?([0-9]{1,4})_([xyz])", re.ASCII)
_NAMED = re.compile(r"(.+)[_.]([xyz])", re.ASCII)
_TIMES = ("time", "timestamp", "seconds", "t")
_FRAMES = ("frame", "frame_idx", "index")
_FACES = ("face_id", "faceid", "person")


@dataclass(frozen=True, eq=False)
class Measured:
    """Frames of measured places.

    kind: "meshes" (the vertices of a mesh), "markers" (named) or "landmarks" (numbered). values: (n, p, 2 or 3), NaN
    where missing. names: of markers. places: marker -> where it sits, as far as the file says. times: (n,) seconds, or
    None. warnings: what was odd.
    """

    kind: str
    values: Array
    names: tuple[str, ...] = ()
    places: Mapping[str, Any] = field(default_factory=dict)
    times: Array | None = None
    warnings: tuple[str, ...] = ()


def read_measured(paths: Sequence[Path], face: Rig, *, fps: float | None = None, person: str | None = None) -> Measured:
    """Return what files hold: meshes (files, or a folder of them), or one file of markers or landmarks.

    face: whose mesh meshes are. fps: frames a second, before a file's own times. person: which face of a table, by its
    face_id. Raises FileError or InputError.
    """
    files = [path for given in paths for path in (_folder(given) if given.is_dir() else [given])]
    if not files:
        raise InputError("input: expected a file or a folder of meshes, got none")
    for path in files:
        suffix = path.suffix.lower()
        if suffix not in READABLE:
            raise FileError(f"{path}: expected a file that ends in {', '.join(READABLE)}, got {suffix or 'no suffix'}"
                            f"{nearest(suffix, READABLE) if suffix else ''}")
        if not path.is_file():
            raise FileError(f"{path}: there is no such file")
    kinds = {path.suffix.lower() in MESHES for path in files}
    if kinds == {True}:
        return Measured("meshes", np.array([_mesh(path, face) for path in files]))
    if len(files) > 1:
        raise InputError(f"input: expected meshes only, or one file of points, got {len(files)} files "
                         f"({files[0].name}, {files[1].name} ...)")
    path = files[0]
    suffix = path.suffix.lower()
    if suffix in TABLES:
        return _table(path, fps, person)
    return _arrays(path) if suffix in ARRAYS else _data(path)


def _folder(path: Path) -> list[Path]:
    """Return the meshes of a folder in the order of the numbers in their names."""
    found = [one for one in path.iterdir() if one.suffix.lower() in MESHES and one.is_file()]
    if not found:
        raise FileError(f"{path}: expected meshes ({', '.join(MESHES)}), found none")
    suffixes = sorted({one.suffix.lower() for one in found})
    if len(suffixes) > 1:
        raise FileError(f"{path}: expected meshes of one kind, found {', '.join(suffixes)}")

    def natural(one: Path) -> list[tuple[int, int, str]]:
        return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"([0-9]+)", one.stem)]

    return sorted(found, key=natural)


def _mesh(path: Path, face: Rig) -> Array:
    """Return the vertices of a mesh that is the rig's, deformed."""
    mesh, own = load_avatar(path).mesh, face.mesh()
    allowed = {len(own.vertices): own}
    if isinstance(face, Face):
        allowed |= {len(face.mesh(detail).vertices): face.mesh(detail) for detail in range(4)}
    if len(mesh.vertices) not in allowed:
        raise FileError(f"{path}: has {len(mesh.vertices)} vertices, and '{face.name}' "
                        f"{' or '.join(map(str, allowed))}: another mesh, or a tool that merged or split vertices; fit "
                        "markers placed on it instead")
    like = allowed[len(mesh.vertices)]
    if mesh.faces.shape != like.faces.shape or not _same_triangles(mesh.faces, like.faces):
        raise FileError(f"{path}: has the vertices of '{face.name}', but other triangles: their order is not the same")
    if len(mesh.vertices) < len(own.vertices) or like is not own:
        raise FileError(f"{path}: is '{face.name}' at another level of detail; write it with mesh(2)")
    return mesh.vertices


def _same_triangles(one: NDArray, other: NDArray) -> bool:
    """Return whether two lists have the same triangles, wherever each begins and in whatever order they stand."""
    def listed(faces: NDArray) -> NDArray:
        turned = np.array([np.roll(faces, -k, axis=1) for k in range(3)])
        first = turned[faces.argmin(axis=1), np.arange(len(faces))]
        return first[np.lexsort(first.T)]

    return bool((listed(one) == listed(other)).all())


def _table(path: Path, fps: float | None, person: str | None) -> Measured:
    table = read_table(path)
    numbered, named = _numbered(table), {}
    if not numbered:
        named = _named(table)
        if not named:
            raise FileError(f"{path}: expected columns of places: x_0, y_0, x_1 ... for landmarks, or chin_x, chin_y, "
                            f"chin_z ... for markers; got {', '.join(table.columns[:6])} ...")
    found = numbered or named
    axes = "xyz" if all("z" in one for one in found.values()) else "xy"
    for name, one in found.items():
        if missing := [axis for axis in axes if axis not in one]:
            raise FileError(f"{path}: point '{name}' has no column for {', '.join(missing)}")
    values = np.stack([np.column_stack([one[axis] for axis in axes]) for one in found.values()], axis=1)
    success = column_of(table, "success")
    if success is not None:
        values = np.where((success > 0.5)[:, None, None], values, np.nan)       # OpenFace: no face was found
    rows, said = np.ones(len(table), bool), []
    who = next((one for one in (table.find(name) for name in _FACES) if one is not None), None)
    if who is not None:
        people = [f"{value:g}" for value in table.numbers[who].tolist()] if who in table.numbers else table.texts[who]
        rows, _, said = the_person(path, people, Wish(person=person))
    times = column_of(table, *_TIMES) if fps is None else counted(column_of(table, *_FRAMES), len(table), fps)
    picked = np.flatnonzero(rows)
    if times is not None:
        order, odd = in_order(path, np.asarray(times)[picked], table.lines[picked])
        picked, said = picked[order], [*said, *odd]
    told = tuple(f"{path}: {one}" for one in dict.fromkeys((*table.warnings, *said)))
    names = () if numbered else tuple(named)
    return Measured("landmarks" if numbered else "markers", values[picked], names, {},
                    None if times is None else np.asarray(times)[picked], told)


def _numbered(table: Table) -> dict[int, dict[str, Array]]:
    """Return the columns of numbered points, in order; of a table with pixels (x_0) and places (X_0), the pixels."""
    found: dict[bool, dict[int, dict[str, Array]]] = {True: {}, False: {}}
    for name in table.columns:
        match = _NUMBERED.fullmatch(name.strip())
        if match is None or name not in table.numbers or name.lower().startswith(("eye_lmk", "gaze", "pose", "p_")):
            continue
        axis, index = (match[1], match[2]) if match[1] else (match[4], match[3])
        found[axis.islower()].setdefault(int(index), {}).setdefault(axis.lower(), table.numbers[name])
    points = found[True] or found[False]
    if len(points) < 2 or sorted(points) != list(range(len(points))):
        return {}
    if points is found[False]:                              # places in a camera's axes: y down, z away
        points = {index: {axis: one if axis == "x" else -one for axis, one in columns.items()}
                  for index, columns in points.items()}
    return dict(sorted(points.items()))


def _named(table: Table) -> dict[str, dict[str, Array]]:
    found: dict[str, dict[str, Array]] = {}
    for name in table.columns:
        match = _NAMED.fullmatch(name.strip())
        if match and name in table.numbers:
            found.setdefault(match[1], {})[match[2]] = table.numbers[name]
    return {name: one for name, one in found.items() if {"x", "y"} <= set(one)}


def _arrays(path: Path) -> Measured:
    """Return arrays: .npz with `vertices`, or `points` with `names`; .npy of points."""
    try:
        with path.open("rb") as file:
            found = np.load(file, allow_pickle=False)
            data = {name: found[name] for name in found.files} if path.suffix.lower() == ".npz" else {"points": found}
    except Exception as error:      # whatever the decoder stumbled over, the file is not what it should be
        raise FileError(f"{path}: cannot be read as NumPy's: {str(error)[:120]}") from None
    key = "vertices" if "vertices" in data else "points"
    if key not in data:
        raise FileError(f"{path}: expected 'vertices' or 'points', got {', '.join(data) or 'nothing'}")
    values = data[key]
    if values.dtype.kind not in "fiu" or values.ndim not in (2, 3) or values.shape[-1] not in (2, 3) or not values.size:
        raise FileError(f"{path}: {key}: expected numbers of shape (frames, points, 2 or 3), got {values.dtype} "
                        f"{values.shape}")
    values = np.array(values if values.ndim == 3 else values[None], np.float64)
    if values.size > _MOST:
        raise FileError(f"{path}: {key}: more than {_MOST:,} numbers; split the recording")
    times = data.get("times")
    if times is not None and (times.dtype.kind not in "fiu" or times.shape != (len(values),)):
        raise FileError(f"{path}: times: expected {len(values)} seconds, got {times.dtype} {times.shape}")
    if key == "vertices":
        return Measured("meshes", values, times=None if times is None else times.astype(float))
    names = tuple(map(str, data["names"].tolist())) if "names" in data else ()
    if names and len(names) != values.shape[1]:
        raise FileError(f"{path}: names: expected {values.shape[1]}, one for each point, got {len(names)}")
    return Measured("markers" if names else "landmarks", values, names,
                    times=None if times is None else times.astype(float))


def _data(path: Path) -> Measured:
    """Return frames of a YAML or JSON file: named points, or a list of points a frame."""
    found = _json(path) if path.suffix.lower() == ".json" else read_data(path)
    if isinstance(found, list):
        found = {"frames": found}
    top = Entry(found, str(path)).fields(required=("frames",), optional=("markers", "fps", "about", "source"))
    frames = top["frames"].each()
    if not frames:
        raise top["frames"].fail("expected one frame or more, got none")
    fps = top["fps"].number(1e-3, 1e6) if "fps" in top else None
    places = dict(top["markers"].items()) if "markers" in top else {}
    stamps, rows = [], []
    for frame in frames:
        points = frame
        if isinstance(frame.value, Mapping):
            fields = dict(frame.items())
            points = next((fields[key] for key in ("points", "landmarks") if key in fields), None)
            if points is None:
                raise frame.fail("expected the key 'points'")
            stamps.append(fields["time"].number(-_FARTHEST, _FARTHEST) if "time" in fields else None)
        rows.append(dict(points.items()) if isinstance(points.value, Mapping) else
                    {str(k): one for k, one in enumerate(points.each())})
    timed = [stamp for stamp in stamps if stamp is not None]
    if timed and len(timed) != len(rows):
        raise top["frames"].fail("expected a time in every frame or in none")
    numbered = not isinstance(frames[0].value, Mapping) or not isinstance(
        next((dict(frames[0].items())[key].value for key in ("points", "landmarks") if key in dict(frames[0].items())),
             None), Mapping)
    names = tuple(dict.fromkeys([*places, *(name for row in rows for name in row)]))
    sizes = {len(_place(entry)) for row in rows for entry in row.values() if entry.value is not None}
    if len(sizes) != 1:
        raise top["frames"].fail("expected places of two numbers or of three, the same in all frames"
                                 + ("" if sizes else "; got none"))
    size = sizes.pop()
    values = np.full((len(rows), len(names), size), np.nan)
    for k, row in enumerate(rows):
        for name, entry in row.items():
            if entry.value is not None:
                values[k, names.index(name)] = _place(entry)
    times = np.array(timed) if timed else np.arange(len(rows)) / fps if fps else None
    return Measured("landmarks" if numbered else "markers", values, () if numbered else names,
                    {name: entry.value for name, entry in places.items()}, times)


def _place(entry: Entry) -> list[float]:
    """Return two or three numbers of a point written as a list or as x, y, z; NaN is missing."""
    value = entry.value
    if isinstance(value, Mapping):
        value = [value[axis] for axis in "xyz" if axis in value]
    if not isinstance(value, (list, tuple)) or len(value) not in (2, 3) or \
            any(isinstance(one, bool) or not isinstance(one, (int, float)) for one in value):
        raise entry.wrong("a place: two or three numbers")
    return [float(one) if abs(one) <= _FARTHEST else np.nan for one in value]


def _json(path: Path) -> object:
    """Return the content of a JSON file, which may be larger than a table."""
    try:
        return json.loads(path.read_bytes().decode("utf-8-sig"))
    except FileNotFoundError:
        raise FileError(f"{path}: there is no such file") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path}: is no JSON: {str(error)[:120] or 'nested too deeply'}") from None


def read_markers(path: Path) -> dict[str, Any]:
    """Return marker -> where it sits, of a YAML or JSON file with the key `markers` (or `landmarks`)."""
    top = Entry(read_data(path), str(path)).fields(optional=("markers", "landmarks", "mesh", "about", "source"))
    if "markers" not in top and "landmarks" not in top:
        raise FileError(f"{path}: the key 'markers' is missing")
    return {name: entry.value for name, entry in top["markers" if "markers" in top else "landmarks"].items()}
