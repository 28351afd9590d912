"""The numbers of a glTF file: accessors over buffer views, interleaved, sparse or quantised.

Khronos, "glTF 2.0 Specification", sections 3.6.2 (accessors), 3.6.2.3 (sparse) and 3.11 (normalised integers).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.gltf_file import GltfFile, compression_of, refuse_compressed
from facegen.fileio.jsontree import Tree

COMPONENTS = {5120: np.dtype("i1"), 5121: np.dtype("u1"), 5122: np.dtype("<i2"), 5123: np.dtype("<u2"),
              5125: np.dtype("<u4"), 5126: np.dtype("<f4")}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
# Because an accessor without data costs the file nothing: no avatar has a tenth of this.
MOST_ELEMENTS = 10_000_000


class Accessors:
    """Reads the accessors of one file, each once."""

    def __init__(self, file: GltfFile) -> None:
        self._buffers = file.buffers
        self._views = file.tree.items("bufferViews")
        self._accessors = file.tree.items("accessors")
        self._cache: dict[tuple[int, bool], NDArray] = {}
        self._made = 0                              # elements that no byte of the file stands for

    def index(self, reference: Tree) -> int:
        """Return the accessor that a value of the JSON refers to, counted from 0."""
        return reference.index(len(self._accessors), "accessor")

    def count(self, reference: Tree) -> int:
        """Return how many elements an accessor says that it has."""
        return self._accessors[self.index(reference)]["count"].integer(1)

    def floats(self, reference: Tree, kind: str, *, count: int | None = None) -> NDArray[np.float32]:
        """Return an accessor's elements (count, width) as finite numbers, normalised integers as -1..1 or 0..1.

        reference: the value that names the accessor. kind: "VEC3", ... count: how many there must be.
        """
        values = self._read(reference, kind, count, decoded=True)
        return values

    def integers(self, reference: Tree, kind: str, *, count: int | None = None) -> NDArray:
        """Return an accessor's elements (count, width) as the unsigned integers they must be."""
        values = self._read(reference, kind, count, decoded=False)
        if values.dtype.kind != "u":
            raise reference.error("refers to an accessor that does not hold unsigned integers")
        return values

    def _read(self, reference: Tree, kind: str, count: int | None, *, decoded: bool) -> NDArray:
        index = self.index(reference)
        tree = self._accessors[index]
        if tree["type"].text() != kind:
            raise reference.error(f"needs {kind}, but accessor {index} holds {tree['type'].text()[:20]}")
        found = tree["count"].integer(1)
        if count is not None and found != count:
            raise reference.error(f"needs {count} elements, but accessor {index} has {found}")
        if (index, decoded) not in self._cache:
            raw = self._elements(tree, WIDTHS[kind], found)
            values = _decoded(raw, tree) if decoded else raw
            if decoded and not np.isfinite(values).all():
                bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
                raise tree.error(f"holds NaN or infinity in {len(bad)} of its elements, the first is number {bad[0]}")
            self._cache[index, decoded] = values
        return self._cache[index, decoded]

    def _elements(self, tree: Tree, width: int, count: int) -> NDArray:
        dtype = _dtype(tree["componentType"])
        if tree.get("bufferView"):
            base = self._slice(tree, dtype, width, count)
        else:
            self._made += count
            if self._made > MOST_ELEMENTS:
                raise tree["count"].error(f"{count:,} elements without data; facegen reads {MOST_ELEMENTS:,} at most")
            base = np.zeros((count, width), dtype)
        sparse = tree.get("sparse")
        if sparse is None:
            return base
        changed = sparse["count"].integer(1, count)
        rows = self._slice(sparse["indices"], _dtype(sparse["indices"]["componentType"]), 1, changed)[:, 0]
        if rows.dtype.kind != "u":
            raise sparse["indices"]["componentType"].error("must be an unsigned integer type")
        if rows.max() >= count:
            raise sparse["indices"].error(f"element {rows.max()} is past the end; there are {count}")
        values = self._slice(sparse["values"], dtype, width, changed)
        full = np.array(base)
        full[rows] = values
        return full

    def _slice(self, tree: Tree, dtype: np.dtype, width: int, count: int) -> NDArray:
        """Return a view (count, width) of the bytes that an accessor, or a part of a sparse one, stands for."""
        data, step = self.view(tree["bufferView"])
        offset = tree["byteOffset"].integer() if tree.get("byteOffset") else 0
        size = dtype.itemsize * width
        step = step or size
        if step < size:
            raise tree.error(f"its elements of {size} bytes overlap: the bufferView steps by {step}")
        if offset + step * (count - 1) + size > len(data):
            raise tree.error(f"{count:,} elements of {size} bytes from byte {offset:,} on do not fit into the "
                             f"bufferView's {len(data):,} bytes")
        return np.ndarray((count, width), dtype, data, offset, (step, dtype.itemsize))

    def view(self, reference: Tree) -> tuple[memoryview, int]:
        """Return the bytes of a bufferView and its step, 0 if it is packed."""
        tree = self._views[reference.index(len(self._views), "bufferView")]
        if name := compression_of(tree):
            raise refuse_compressed(tree, name)
        number = tree["buffer"].index(len(self._buffers), "buffer")
        data = self._buffers[number]
        if data is None:
            raise tree["buffer"].error(f"buffer {number} has no data in this file")
        offset = tree["byteOffset"].integer() if tree.get("byteOffset") else 0
        size = tree["byteLength"].integer(1)
        if offset + size > len(data):
            raise tree.error(f"{size:,} bytes from byte {offset:,} on do not fit into buffer {number}'s {len(data):,}")
        step = tree["byteStride"].integer(4, 252) if tree.get("byteStride") else 0
        return memoryview(data)[offset:offset + size], step


def _dtype(tree: Tree) -> np.dtype:
    number = tree.integer()
    if number not in COMPONENTS:
        raise tree.error(f"expected one of {', '.join(map(str, COMPONENTS))}, got {number}")
    return COMPONENTS[number]


def _decoded(raw: NDArray, tree: Tree) -> NDArray[np.float32]:
    """Return numbers of whatever type as float32: integers as they are, or divided by their largest (3.11)."""
    values = raw.astype(np.float32)                 # exact for 8 and 16 bits
    if raw.dtype.kind in "iu" and tree.get("normalized") and tree["normalized"].truth():
        values /= np.float32(np.iinfo(raw.dtype).max)
        np.maximum(values, np.float32(-1.0), out=values)
    return values
