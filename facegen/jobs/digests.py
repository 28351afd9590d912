"""Digests of the data that decide what a picture shows, so that a data set can be made again, or seen to be stale."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any

from facegen.data import tables_dir
from facegen.face.face import AVATARS, load_face
from facegen.face.named import face_file
from facegen.facs.yamlfile import read_data

TABLES = ("action_units.yaml", "deformations.yaml", "expressions.yaml", "lights.yaml", "vocabularies.yaml")


def digest_of(data: Any) -> str:
    """Return the SHA-256 of plain data."""
    text = json.dumps(data, sort_keys=True, ensure_ascii=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def table_digests() -> dict[str, str]:
    """Return file name -> SHA-256 of the tables."""
    return {name: file_digest(tables_dir() / name) for name in TABLES}


def face_digest(face: str, *, fresh: bool = False) -> str:
    """Return the SHA-256 of a face's files. A parametric face's are read once, unless a ``fresh`` look is asked for."""
    if Path(face).suffix.lower() in AVATARS:
        return load_face(face).digest               # with the buffers of a .gltf, as the reader knows them
    return _read(face) if fresh else kept_digest(face)


def _read(face: str) -> str:
    return digest_of([file_digest(one) for one in face_files(face)])


kept_digest = cache(_read)


def face_files(face: str) -> list[Path]:
    """Return the files of a parametric face, by name or path: its ``face.yaml`` and all that it names."""
    path = face_file(face)
    data = read_data(path)
    named = {data["cage"], data.get("landmarks", "landmarks.yaml"), *(part["file"] for part in data.get("parts", ())),
             *filter(None, [data.get("surface")])}
    files = [path, *(path.parent / name for name in sorted(named))]
    return [one for one in files if one.is_file()]


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a text file."""
    # Line ends are a matter of the checkout, not of the data.
    return hashlib.sha256(path.read_bytes().replace(b"\r\n", b"\n")).hexdigest()
