"""A glTF file that grows at its end: what was there stays where it was, new numbers are appended.

Khronos, "glTF 2.0 Specification", sections 3.6.2.3 (sparse accessors), 3.6.2.4 (alignment) and KHR_mesh_quantization.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError
from facegen.fileio.gltf_file import GltfFile, read_uri
from facegen.fileio.jsontree import Tree

_FLOAT, _BYTE, _SHORT, _U16, _U32 = 5126, 5121, 5122, 5123, 5125
_ARRAY_BUFFER = 34962
_OF_VERTICES = " of vertices"
# Bytes from one vertex to the next, by the kind of what is kept of them.
_STEPS = {f"VEC3{_OF_VERTICES}": 12, f"VEC4{_OF_VERTICES}": 16, f"joints{_OF_VERTICES}": 4}
STEPS = 32767                                       # of a normalised short between 0 and 1
_IMAGE_TYPES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp",
                b"\xabKTX": "image/ktx2"}
# The mark of our accessors: what bears it may be replaced when the file is written again.
MARK = {"facegen": True}


class Appended:
    """A copy of a file's JSON, with one buffer, to which accessors are added. ``json`` may be changed."""

    def __init__(self, file: GltfFile) -> None:
        self.json: dict[str, Any] = _copied(file.json)
        self._pieces: list[bytes] = []
        self._size = 0
        self._kinds: dict[str, tuple[int, list[bytes], int]] = {}      # open bufferViews: index, bytes, size
        self._zeros: dict[int, int] = {}
        self._gather(file)

    def _gather(self, file: GltfFile) -> None:
        """Make all buffers one, the first in front, and take in the pictures that lie in files beside."""
        starts = []
        for i, data in enumerate(file.buffers):
            if data is None:
                raise FileError(f"{file.path}: buffers[{i}]: has no data in this file, so it cannot be written again")
            starts.append(self._push(data))
        for i, view in enumerate(self.json.get("bufferViews", [])):
            tree = Tree(view, file.path, f"bufferViews[{i}]")
            number = tree["buffer"].index(len(starts), "buffer")
            if number:
                offset = tree["byteOffset"].integer() if tree.get("byteOffset") else 0
                view.update(buffer=0, byteOffset=offset + starts[number])
        for i, image in enumerate(self.json.get("images", [])):
            uri = Tree(image, file.path, f"images[{i}]").get("uri")
            if uri and not uri.text().startswith("data:"):
                self._take_in(image, uri)

    def _take_in(self, image: dict[str, Any], uri: Tree) -> None:
        try:
            data = read_uri(uri)
        except FileError:
            return                                  # not there when the file was read either: the link stays as it is
        kind = next((kind for head, kind in _IMAGE_TYPES.items() if data.startswith(head)), None)
        if kind:
            del image["uri"]
            view = self._view(self._push(data), len(data))
            image.update(bufferView=self._new(self.json.setdefault("bufferViews", []), view), mimeType=kind)

    def _push(self, data: bytes) -> int:
        """Append bytes to the buffer and return where they begin, a multiple of four."""
        start = self._size
        self._pieces += [data, bytes(-len(data) % 4)]
        self._size += len(data) + -len(data) % 4
        return start

    @staticmethod
    def _view(start: int, size: int, **more: int) -> dict[str, Any]:
        return {"buffer": 0, **({"byteOffset": start} if start else {}), "byteLength": size, **more}

    @staticmethod
    def _new(items: list[Any], one: Any) -> int:
        items.append(one)
        return len(items) - 1

    def _part(self, kind: str, data: bytes) -> dict[str, int]:
        """Return the bufferView and offset of bytes put into the open bufferView of a kind."""
        if kind not in self._kinds:
            self._kinds[kind] = (self._new(self.json.setdefault("bufferViews", []), {}), [], 0)
        view, pieces, size = self._kinds[kind]
        padding = bytes(-len(data) % 4)
        pieces += [data, padding]
        self._kinds[kind] = (view, pieces, size + len(data) + len(padding))
        return {"bufferView": view, **({"byteOffset": size} if size else {})}

    # -- accessors ------------------------------------------------------------------------------------------
    def accessor(self, one: dict[str, Any]) -> int:
        """Add an accessor as it is and return its index."""
        return self._new(self.json.setdefault("accessors", []), one)

    def zeros(self, count: int) -> int:
        """Return an accessor of ``count`` motions of zero, which takes no bytes."""
        if count not in self._zeros:
            self._zeros[count] = self.accessor({"componentType": _FLOAT, "count": count, "type": "VEC3",
                                                "min": [0, 0, 0], "max": [0, 0, 0], "extras": MARK})
        return self._zeros[count]

    def floats(self, values: NDArray, kind: str, *, bounds: bool = False, vertex: bool = False) -> int:
        """Add an accessor of packed float32 values (n, width) or (n,) and return its index."""
        values = np.ascontiguousarray(values, dtype="<f4")
        where = self._part(f"{kind}{_OF_VERTICES}" if vertex else kind, values.tobytes())
        return self.accessor({**where, "componentType": _FLOAT, "count": len(values), "type": kind,
                              **(_bounds(values) if bounds else {})})

    def joints(self, values: NDArray) -> int:
        """Add an accessor of the joints (n, 4), each below 256, that move vertices and return its index."""
        where = self._part(f"joints{_OF_VERTICES}", np.ascontiguousarray(values, dtype="u1").tobytes())
        return self.accessor({**where, "componentType": _BYTE, "count": len(values), "type": "VEC4"})

    def indices(self, faces: NDArray, count: int) -> int:
        """Add the corners of triangles (m, 3) of ``count`` vertices and return the accessor's index."""
        small = count < 0xFFFF                      # the largest index of a type is reserved
        where = self._part("corners", np.ascontiguousarray(faces, dtype="<u2" if small else "<u4").tobytes())
        return self.accessor({**where, "componentType": _U16 if small else _U32, "count": faces.size,
                              "type": "SCALAR"})

    def motion(self, count: int, rows: NDArray, values: NDArray, *, bounds: bool, quantise: bool) -> int:
        """Add ``count`` motions, zero but for (k, 3) ``values`` at the ascending ``rows``, in the smallest form."""
        if not len(rows):
            return self.zeros(count)
        values = np.rint(values * STEPS).astype("<i2") if quantise else np.ascontiguousarray(values, dtype="<f4")
        index_type = "<u2" if count <= 0x10000 else "<u4"
        # Quantised motion is always sparse: dense vertex data would have to be padded to steps of four bytes.
        if not quantise and len(rows) * (12 + int(index_type[2])) >= count * 12:
            full = np.zeros((count, 3), "<f4")
            full[rows] = values
            index = self.floats(full, "VEC3", bounds=bounds, vertex=True)
            self.json["accessors"][index]["extras"] = MARK
            return index
        low_high = _bounds(values, with_zero=len(rows) < count) if bounds else {}
        return self.accessor({
            "componentType": _SHORT if quantise else _FLOAT, **({"normalized": True} if quantise else {}),
            "count": count, "type": "VEC3", **low_high,
            "sparse": {"count": len(rows),
                       "indices": {**self._part("rows", rows.astype(index_type).tobytes()),
                                   "componentType": _U16 if index_type == "<u2" else _U32},
                       "values": self._part("values", values.tobytes())},
            "extras": MARK})

    def require(self, extension: str) -> None:
        """Say that the file cannot be read without an extension."""
        for key in ("extensionsUsed", "extensionsRequired"):
            if extension not in self.json.setdefault(key, []):
                self.json[key].append(extension)

    def finished(self) -> tuple[dict[str, Any], bytes]:
        """Return the JSON and the one buffer."""
        for kind, (view, pieces, size) in self._kinds.items():
            more = {"byteStride": _STEPS[kind], "target": _ARRAY_BUFFER} if kind in _STEPS else {}
            if kind == "corners":
                more = {"target": _ARRAY_BUFFER + 1}
            self.json["bufferViews"][view] = self._view(self._push(b"".join(pieces)), size, **more)
        self._kinds = {}
        if self._size:
            first = (self.json.get("buffers") or [{}])[0]
            first = {key: value for key, value in first.items() if key != "uri"}
            self.json["buffers"] = [{**first, "byteLength": self._size}]
        return self.json, b"".join(self._pieces)


def _copied(value: Any) -> Any:
    """Return a copy of JSON without members that are null outside extras: to readers they are missing."""
    if isinstance(value, list):
        return [_copied(one) for one in value]
    if not isinstance(value, dict):
        return value
    return {key: copy.deepcopy(one) if key == "extras" else _copied(one) for key, one in value.items()
            if one is not None}


def is_ours(found: dict[str, Any], accessor: Any) -> bool:
    """Return whether facegen wrote an accessor of a file's JSON."""
    accessors = found.get("accessors", [])
    if not isinstance(accessor, int) or not 0 <= accessor < len(accessors):
        return False
    extras = accessors[accessor].get("extras")
    return isinstance(extras, dict) and extras.get("facegen") is True


def _bounds(values: NDArray, *, with_zero: bool = False) -> dict[str, list[float]]:
    low, high = values.min(axis=0), values.max(axis=0)
    if with_zero:
        low, high = np.minimum(low, 0), np.maximum(high, 0)
    return {"min": np.atleast_1d(low).tolist(), "max": np.atleast_1d(high).tolist()}


