"""Anybody's avatar as a file: read it, and write it again with shapes. The one door to all formats."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import FileError, InputError, nearest
from facegen.fileio.gltf_animate import Keys, with_animation
from facegen.fileio.gltf_file import GltfFile, glb_bytes, gltf_bytes
from facegen.fileio.gltf_neck import Neck
from facegen.fileio.gltf_new import new_file
from facegen.fileio.gltf_read import GltfScene, read_scene, scene_of
from facegen.fileio.gltf_write import foreign_names, name_taken, with_targets
from facegen.fileio.mtl import read_colours
from facegen.fileio.obj import ObjFile, read_obj
from facegen.fileio.obj_sequence import check_names, save_sequence
from facegen.fileio.scans import read_scan
from facegen.fileio.textfile import check_place, whole_file
from facegen.fileio.vrm import check_expressions, is_vrm0
from facegen.geometry.mesh import Mesh

READABLE = (".obj", ".glb", ".gltf", ".vrm", ".ply", ".stl")
WRITABLE = (".glb", ".vrm", ".gltf", ".npz")
ANIMATED = (".glb", ".vrm", ".gltf")
_EMPTY: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class AvatarFile:
    """A neutral avatar as its file shows it.

    path, kind: where it came from: "obj", "glb" (also .vrm), "gltf", "ply" or "stl". mesh: the whole scene as
    triangles, in rest, in the file's own axes and units; of an OBJ file vertex i is the i-th ``v`` line, of a glTF file
    each POSITION accessor stands once for each node that shows it, in the order of the nodes. colours: sRGB 0..255 of
    each material that has a known one. vertex_colours: (n, 3) sRGB 0..255, or None. shapes: the morph targets that the
    file has, as displacements (n, 3). notes: what facegen wrote into the file. digest: SHA-256 of the file and of its
    buffers.
    """

    path: Path
    kind: str
    mesh: Mesh
    colours: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    vertex_colours: NDArray[np.float64] | None = None
    shapes: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    notes: Mapping[str, Any] = field(default_factory=dict)
    digest: str = ""
    source: GltfScene | ObjFile | None = field(default=None, repr=False)      # what is kept when it is written again

    @property
    def is_vrm0(self) -> bool:
        """Whether it is a VRM 0.x avatar: those look to -z, and their expressions are none that facegen writes."""
        return is_vrm0(getattr(getattr(self.source, "file", None), "json", {}))


def load_avatar(path: str | os.PathLike[str]) -> AvatarFile:
    """Read a .obj, .glb, .vrm, .gltf, .ply or .stl file. Raises FileError that says what is wrong with it and where.

    ::

        avatar = facegen.load_avatar("cat.glb")
        avatar.mesh.parts, list(avatar.shapes)
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in READABLE:
        raise FileError(f"{path}: expected an avatar, a file that ends in {', '.join(READABLE)}, "
                        f"got {suffix or 'no suffix'}{nearest(suffix, READABLE) if suffix else ''}")
    if suffix == ".obj":
        found = read_obj(path)
        return AvatarFile(path, "obj", found.mesh, read_colours(path, found.libraries), found.colours,
                          digest=hashlib.sha256(found.raw).hexdigest(), source=found)
    if suffix in (".ply", ".stl"):
        mesh, colours, raw = read_scan(path)
        return AvatarFile(path, suffix[1:], mesh, {}, colours, digest=hashlib.sha256(raw).hexdigest())
    scene = read_scene(path)
    return AvatarFile(path, scene.file.kind, scene.mesh, scene.colours, scene.vertex_colours, scene.shapes,
                      scene.notes, scene.file.digest, scene)


def save_avatar(avatar: AvatarFile, path: str | os.PathLike[str], shapes: Mapping[str, ArrayLike], *,
                notes: Mapping[str, Any] = _EMPTY, normals: bool = True, quantise: bool = False,
                expressions: Mapping[str, Mapping[str, float]] = _EMPTY) -> Path:
    """Write an avatar with shapes, each a displacement (n, 3) of its mesh; return the path.

    .glb, .vrm, .gltf: a glTF file gets morph targets appended and stays otherwise as it is; any other avatar becomes a
    new file with materials. .npz: ``neutral``, ``faces``, ``names`` and ``deltas`` (k, n, 3) float32. No suffix: a
    folder of OBJ files, ``neutral.obj`` and one a shape. Everything appears whole or not at all.

    notes: kept in the file for facegen. normals: write how normals change, so that shapes are shaded right.
    quantise: steps of 1/32767 unit of the mesh instead of float32 (KHR_mesh_quantization), a third smaller.
    expressions: of a VRM 1.0 avatar, names and the weights of shapes. Raises InputError or FileError.
    """
    shapes = _checked(avatar, shapes)
    path = _checked_place(path, shapes)
    check_expressions(expressions, [*shapes, *avatar.shapes])
    notes = _plain(notes)
    suffix = path.suffix.lower()
    if not suffix:
        return save_sequence(path, avatar.mesh, avatar.source if isinstance(avatar.source, ObjFile) else None, shapes)
    if suffix == ".npz":
        return _save_npz(avatar, path, shapes, notes)
    scene, rows = (avatar.source, None) if isinstance(avatar.source, GltfScene) else _as_scene(avatar, shapes, quantise)
    if rows is not None:
        shapes = {name: np.take(shape, rows, axis=0) for name, shape in shapes.items()}
    found, data = with_targets(scene, shapes, notes=notes, normals=normals, quantise=quantise,
                               expressions=expressions)
    return _save_gltf(path, found, data, scene.file.rest)


def with_shapes(avatar: AvatarFile, shapes: Mapping[str, ArrayLike], *, notes: Mapping[str, Any] = _EMPTY
                ) -> tuple[AvatarFile, NDArray[np.int64]]:
    """Return what `load_avatar` would read of a GLB file that `save_avatar` wrote of a mesh that is none, without
    writing it, and which vertex of the mesh each of its vertices is."""
    shapes = _checked(avatar, shapes)
    scene, rows = _as_scene(avatar, shapes, quantise=False)
    found, data = with_targets(scene, {name: shape[rows] for name, shape in shapes.items()}, notes=_plain(notes),
                               normals=True, quantise=False, expressions={})
    scene = scene_of(GltfFile(avatar.path, "glb", found, (data,), b"", ""))
    return AvatarFile(avatar.path, "glb", scene.mesh, scene.colours, scene.vertex_colours, scene.shapes, scene.notes,
                      "", scene), rows


def save_animated(avatar: AvatarFile, path: str | os.PathLike[str], keys: Keys, *, neck: Neck | None = None
                  ) -> tuple[Path, bool]:
    """Write a glTF avatar with an animation of its shapes; return the path, and whether the head turns in it.

    path: .glb, .vrm or .gltf. Everything that was in the file stays, other animations too. neck: where the head turns,
    for a file that has no joint for it. Raises FileError for the path, InputError for an avatar that is no glTF file.
    """
    path = check_place(path, ANIMATED)
    if not isinstance(avatar.source, GltfScene):
        raise InputError(f"avatar: expected a glTF file (.glb, .gltf, .vrm), got {avatar.path}")
    found, data, turned = with_animation(avatar.source, keys, neck)
    return _save_gltf(path, found, data, avatar.source.file.rest), turned


def _save_gltf(path: Path, found: dict[str, Any], data: bytes, rest: bytes) -> Path:
    pieces = gltf_bytes(found, data) if path.suffix.lower() == ".gltf" else glb_bytes(found, data, rest)
    with whole_file(path, "the avatar ") as draft, open(draft, "wb") as file:
        file.writelines(pieces)
    return path


def check_output(avatar: AvatarFile, path: str | os.PathLike[str], names: Iterable[str]) -> Path:
    """Return the path if shapes of these names can be written there; ask before long work.

    Raises FileError for the path, InputError for a name that the avatar uses for a morph target of its own.
    """
    path = _checked_place(path, names)
    if isinstance(avatar.source, GltfScene) and path.suffix.lower() not in ("", ".npz"):
        for name in sorted(foreign_names(avatar.source).intersection(names)):
            raise name_taken(avatar.source, name)
    return path


def _checked_place(path: str | os.PathLike[str], names: Iterable[str]) -> Path:
    path = Path(path)
    if path.suffix:
        return check_place(path, WRITABLE)
    check_names(names)
    if path.exists() and not path.is_dir():
        raise FileError(f"{path}: is a file, expected a folder for the OBJ files, or a name that ends in "
                        f"{', '.join(WRITABLE)}")
    if not path.parent.is_dir():
        raise FileError(f"{path}: the folder {path.parent} does not exist; make it first")
    return path


def _checked(avatar: AvatarFile, shapes: Mapping[str, ArrayLike]) -> dict[str, NDArray[np.float64]]:
    """Return the shapes as finite arrays (n, 3)."""
    result = {}
    for name, shape in shapes.items():
        if not isinstance(name, str) or not name.strip():
            raise InputError(f"shapes: expected names, got {name!r}")
        try:
            array = np.asarray(shape, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(f"shapes: '{name}' is no array of numbers") from None
        if array.shape != avatar.mesh.vertices.shape:
            raise InputError(f"shapes: '{name}' has shape {array.shape}, expected {avatar.mesh.vertices.shape}, a "
                             "displacement for each vertex of the avatar")
        if not np.isfinite(array).all():
            bad = int((~np.isfinite(array).all(axis=1)).sum())
            raise InputError(f"shapes: '{name}' is NaN or infinite at {bad} vertices")
        result[name] = array
    return result


def _plain(notes: Mapping[str, Any]) -> dict[str, Any]:
    """Return notes as JSON holds them: arrays as lists."""
    def simple(value: Any) -> Any:
        if isinstance(value, Mapping):
            return dict(value)
        if isinstance(value, (np.ndarray, np.generic)):
            return value.tolist()
        raise TypeError(f"{type(value).__name__} is no JSON value")

    try:
        return json.loads(json.dumps(dict(notes), default=simple, allow_nan=False))
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"notes: cannot be written as JSON: {str(error)[:120]}") from None


def _as_scene(avatar: AvatarFile, shapes: Mapping[str, NDArray[np.float64]], quantise: bool
              ) -> tuple[GltfScene, NDArray[np.int64]]:
    """Return an avatar that is no glTF file as if it were one, and which of its vertices each vertex is."""
    # Quantised motion reaches from -1 to 1: the nodes scale by the power of two that is just enough.
    largest = max((float(np.abs(shape).max(initial=0.0)) for shape in shapes.values()), default=0.0) if quantise else 0
    scale = 2.0 ** math.ceil(math.log2(largest)) if largest > 0 else 1.0
    file, rows = new_file(avatar.path, avatar.mesh, avatar.colours, avatar.vertex_colours, scale=scale)
    return scene_of(file), rows


def _save_npz(avatar: AvatarFile, path: Path, shapes: Mapping[str, NDArray[np.float64]], notes: Mapping[str, Any]
              ) -> Path:
    """Write plain arrays that NumPy reads."""
    deltas = np.zeros((len(shapes), *avatar.mesh.vertices.shape), np.float32)
    for i, shape in enumerate(shapes.values()):
        deltas[i] = shape
    with whole_file(path, "the shapes ") as draft, open(draft, "wb") as file:
        np.savez(file, neutral=avatar.mesh.vertices, faces=avatar.mesh.faces, names=np.array(list(shapes), dtype=str),
                 deltas=deltas, notes=np.array(json.dumps(notes)))
    return path


