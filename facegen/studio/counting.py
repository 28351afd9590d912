"""How many triangles a file says that it has, from its first bytes, before anything is made of it."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path
from typing import Any

_PLY_HEAD = 1 << 16         # bytes in which a PLY header ends
_GLB_HEAD = 20


def triangles(path: Path) -> int | None:
    """Return how many triangles a file has at least, None where its format does not tell. A broken file is not told of
    here: whoever reads it does."""
    count = {".ply": _ply, ".stl": _stl, ".obj": _obj, ".gltf": _gltf, ".glb": _glb, ".vrm": _glb}
    try:
        return count.get(path.suffix.lower(), lambda _: None)(path)
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, struct.error):
        return None


def _ply(path: Path) -> int | None:
    with path.open("rb") as file:
        head = file.read(_PLY_HEAD)
    found = re.search(rb"^element\s+face\s+([0-9]{1,18})\s*$", head.partition(b"end_header")[0], re.M)
    return int(found[1]) if found else None


def _stl(path: Path) -> int | None:
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(84)
    count = struct.unpack_from("<I", head, 80)[0]
    if size == 84 + 50 * count:
        return count
    return None if head[:5].lower() == b"solid" else count


def _obj(path: Path) -> int:
    return len(re.findall(rb"^[ \t]*f[ \t]", path.read_bytes(), re.M))


def _gltf(path: Path) -> int:
    return _of_scene(json.loads(path.read_bytes()))


def _glb(path: Path) -> int:
    with path.open("rb") as file:
        length = struct.unpack_from("<I", file.read(_GLB_HEAD), 12)[0]
        return _of_scene(json.loads(file.read(length)))


def _of_scene(scene: dict[str, Any]) -> int:
    """Add up the primitives of every mesh, once for each node that shows it."""
    accessors, total = scene.get("accessors", []), 0
    own = []
    for mesh in scene.get("meshes", []):
        count = 0
        for primitive in mesh["primitives"]:
            corners = int(accessors[primitive.get("indices", primitive["attributes"]["POSITION"])]["count"])
            mode = primitive.get("mode", 4)
            count += corners // 3 if mode == 4 else max(corners - 2, 0) if mode in (5, 6) else 0
        own.append(count)
    shown = [node["mesh"] for node in scene.get("nodes", []) if "mesh" in node]
    for mesh in shown:
        total += own[mesh]
    return max(total, sum(own))
