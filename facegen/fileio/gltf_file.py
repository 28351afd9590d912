"""The containers of glTF: .glb (one file of chunks) and .gltf (JSON beside its buffers).

Khronos, "glTF 2.0 Specification", sections 3.6.1 (buffers) and 4 (GLB). Sizes are checked before anything is cut.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from facegen.errors import FileError, InputError
from facegen.fileio.binfile import MOST_BYTES, read_bytes
from facegen.fileio.jsontree import Items, Tree, parse

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942      # "glTF", "JSON", "BIN\0"
_LARGEST_GLB = (1 << 32) - 1                                  # lengths in a GLB have 32 bits

# Extensions that a file may require and that change neither positions nor their order.
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "KHR_xmp", "VRM")
_KNOWN = {"KHR_mesh_quantization", "KHR_node_visibility", "KHR_animation_pointer", "EXT_lights_image_based", "VRM",
          "KHR_node_hoverability", "KHR_node_selectability"}
_LISTS = ("accessors", "animations", "buffers", "bufferViews", "images", "materials", "meshes", "nodes", "samplers",
          "scenes", "skins", "textures")
_COMPRESSED = {"KHR_draco_mesh_compression": "Draco", "EXT_meshopt_compression": "meshopt",
               "KHR_meshopt_compression": "meshopt"}


@dataclass(frozen=True, eq=False)
class GltfFile:
    """A glTF file in parts. ``buffers``: bytes, or None where the file gives none. ``rest``: a GLB's further chunks."""

    path: Path
    kind: str
    json: dict[str, Any]
    buffers: tuple[bytes | None, ...]
    rest: bytes
    digest: str

    @property
    def tree(self) -> Tree:
        """The JSON as a tree that knows its places."""
        return Tree(self.json, self.path)


def read_gltf(path: Path) -> GltfFile:
    """Read a .glb, .vrm or .gltf file with its buffers. FileError names the file and what is wrong with it."""
    raw = read_bytes(path, what="avatar", kind="a glTF file")
    binary = raw[:4] == b"glTF"
    if not binary and path.suffix.lower() != ".gltf":
        raise FileError(f"{path}: is no GLB file (it begins with {raw[:4]!r}, not b'glTF')")
    text, chunk, rest = _chunks(raw, path) if binary else (raw, None, b"")
    found = parse(text, path)
    tree = Tree(found, path)
    if not tree["asset"]["version"].text().startswith("2."):
        raise tree["asset"]["version"].error(f"facegen reads glTF 2, got {tree['asset']['version'].text()[:20]!r}")
    _check_lists(tree)
    refuse_extensions(tree)
    digest = hashlib.sha256(raw)
    buffers = []
    for i, buffer in enumerate(tree.items("buffers")):
        data = _buffer(buffer, chunk if i == 0 else None)
        if data is not None and (buffer.get("uri") and not buffer["uri"].text().startswith("data:")):
            digest.update(data)
        buffers.append(data)
    return GltfFile(path, "glb" if binary else "gltf", found, tuple(buffers), rest, digest.hexdigest())


def _chunks(raw: bytes, path: Path) -> tuple[bytes, bytes | None, bytes]:
    """Return the JSON text, the BIN chunk if there is one, and all chunks after them as they are."""
    if len(raw) < 20:
        raise FileError(f"{path}: a GLB file has 20 bytes at least, got {len(raw)}; it is truncated")
    _, version, length = struct.unpack_from("<III", raw)
    if version != 2:
        raise FileError(f"{path}: facegen reads GLB version 2, got version {version}")
    if length > len(raw):
        raise FileError(f"{path}: says that it has {length:,} bytes, but has {len(raw):,}; it is truncated")
    chunks = []
    at = 12
    while at < length and len(chunks) < 2:
        if at + 8 > length:
            raise FileError(f"{path}: the chunk at byte {at} is cut off")
        size, kind = struct.unpack_from("<II", raw, at)
        if at + 8 + size > length:
            raise FileError(f"{path}: the chunk at byte {at} says that it has {size:,} bytes, "
                            f"but {length - at - 8:,} are left")
        if kind != (_JSON, _BIN)[len(chunks)]:
            break
        chunks.append(raw[at + 8:at + 8 + size])
        at += 8 + size
    if not chunks:
        raise FileError(f"{path}: its first chunk must be JSON")
    return chunks[0], chunks[1] if len(chunks) > 1 else None, raw[at:length]


def _check_lists(tree: Tree) -> None:
    """Raise FileError unless every list at the top of the file is one, of what it must hold."""
    for key in _LISTS:
        if key in tree.value:
            for one in Items(Tree(tree.value[key], tree.path, key)):
                one.members()
    for key in ("extensionsUsed", "extensionsRequired"):
        if key in tree.value:
            for one in Items(Tree(tree.value[key], tree.path, key)):
                one.text()


def refuse_extensions(tree: Tree) -> None:
    """Raise FileError if the file requires an extension that facegen cannot read."""
    for one in tree.items("extensionsRequired"):
        name = one.text()
        if name in _COMPRESSED:
            raise refuse_compressed(one, name)
        if name not in _KNOWN and not name.startswith(_HARMLESS):
            raise one.error(f"facegen cannot read the extension {name!r}, which this file requires; export it without")


def refuse_compressed(tree: Tree, name: str) -> FileError:
    """Return the error for something compressed."""
    return tree.error(f"is compressed with {_COMPRESSED[name]} ({name}), which facegen does not read; save the avatar "
                      "without compression, for example from Blender, or with 'gltf-transform copy in.glb out.glb'")


def compression_of(tree: Tree) -> str | None:
    """Return the name of the extension that compresses this bufferView or primitive, if one does."""
    extensions = tree.get("extensions")
    return next((name for name in _COMPRESSED if extensions and extensions.get(name)), None)


def _buffer(buffer: Tree, chunk: bytes | None) -> bytes | None:
    """Return the bytes of one buffer; None if the file does not say where they are."""
    size = buffer["byteLength"].integer(1)
    uri = buffer.get("uri")
    data = chunk if uri is None else read_uri(uri)
    if data is not None and size > len(data):
        raise buffer["byteLength"].error(f"says {size:,} bytes, but there are {len(data):,}; the file is truncated")
    return data


def read_uri(uri: Tree) -> bytes:
    """Return what a data: URI holds, or the bytes of a file in the folder of this file or below. Raises FileError."""
    text = uri.text()
    if text.startswith("data:"):
        head, comma, data = text.partition(",")
        if not comma:
            raise uri.error("a data: URI needs a comma before its data")
        try:
            if head.endswith(";base64"):
                return base64.b64decode(data, validate=True)
            return unquote(data, "latin-1").encode("latin-1")
        except (binascii.Error, ValueError) as error:
            raise uri.error(f"its data cannot be decoded ({str(error)[:60]})") from None
    return read_bytes(local_path(uri), what=f"{uri.path}: {uri.place}", kind="part of the avatar")


def local_path(uri: Tree) -> Path:
    """Return the path of a file that a URI names, or raise FileError if it lies outside the folder."""
    text = uri.text()
    folder = uri.path.parent
    try:
        away = urlsplit(text).scheme or text.startswith(("/", "\\")) or "\x00" in unquote(text)
        path = folder / unquote(text)
        away = away or not path.resolve().is_relative_to(folder.resolve())
    except (ValueError, OSError, RuntimeError):     # no URI, or links that go round
        away = True
    if away:
        raise uri.error(f"{text[:80]!r} leads out of the avatar's folder; facegen reads only files in it")
    return path


def glb_bytes(found: dict[str, Any], data: bytes, rest: bytes = b"") -> list[bytes]:
    """Return the pieces of a GLB file: its JSON, one binary buffer, and further chunks as they are."""
    text = _text(found)
    text += b" " * (-len(text) % 4)
    pieces = [struct.pack("<II", len(text), _JSON), text]
    if data:
        padding = bytes(-len(data) % 4)
        pieces += [struct.pack("<II", len(data) + len(padding), _BIN), data, padding]
    length = 12 + sum(map(len, pieces)) + len(rest)
    if length > min(_LARGEST_GLB, MOST_BYTES):
        raise InputError(f"shapes: the file would have {length:,} bytes; at most {MOST_BYTES:,} can be read again; "
                         "write fewer shapes")
    return [struct.pack("<III", _MAGIC, 2, length), *pieces, rest]


def gltf_bytes(found: dict[str, Any], data: bytes) -> list[bytes]:
    """Return the pieces of a .gltf file that holds its one buffer as a data: URI."""
    if data:
        uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        found = {**found, "buffers": [{**found["buffers"][0], "uri": uri}]}
    return [_text(found)]


def _text(found: dict[str, Any]) -> bytes:
    """Return JSON as UTF-8."""
    try:
        return json.dumps(found, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
    except UnicodeEncodeError:                      # half a surrogate pair in a name: only an escape can write it
        return json.dumps(found, separators=(",", ":"), allow_nan=False).encode()
