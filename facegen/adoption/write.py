"""A face's folder: text files that people can read, written whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import yaml

from facegen.errors import FileError

_LINE_EACH = ("points", "measures", "scales", "jaw", "eyes", "head", "folds", "lid_follow", "colours", "landmarks")
_ROW_EACH = ("regions", "parts")
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)     # ten times as fast, where PyYAML was built with it


def yaml_text(about: str, data: Mapping[str, Any]) -> str:
    """Return a face's data as YAML, one thing a line. about: the comment at the top."""
    lines = [f"# {line}" for line in about.splitlines()]
    for key, value in data.items():
        if key in _LINE_EACH and value:
            lines += [f"{key}:", *(f"  {name}: {_flow(one)}" for name, one in value.items())]
        elif key in _ROW_EACH:
            lines += [f"{key}:", *(f"- {_flow(one)}" for one in value)]
        elif key == "lids":
            lines.append("lids:")
            for side, lid in value.items():
                lines += [f"  {side}:", *(f"    {name}: {_flow(one)}" for name, one in lid.items())]
        else:
            lines.append(f"{key}: {_flow(value)}")
    return "\n".join(lines) + "\n"


def _flow(value: Any) -> str:
    text = yaml.dump(value, Dumper=_DUMPER, default_flow_style=True, width=10**6, sort_keys=False, allow_unicode=True)
    text = text.strip()
    return text.removesuffix("...").strip()


def check_folder(path: str | os.PathLike[str], *, force: bool) -> Path:
    """Return a folder that a face may be written to; FileError if something else is there: ask before long work."""
    path = Path(path)
    if path.name in ("", ".."):
        raise FileError(f"{path}: expected the name of a folder for the face, such as me/")
    if path.suffix.lower() in (".obj", ".glb", ".gltf", ".vrm", ".yaml", ".yml", ".npz"):
        raise FileError(f"{path}: expected the name of a folder, such as {path.stem}/, got one that ends in "
                        f"{path.suffix}")
    if not path.parent.is_dir():
        raise FileError(f"{path}: the folder {path.parent} does not exist; make it first")
    if path.exists() and not path.is_dir():
        raise FileError(f"{path}: is a file, expected a folder or a name that is free")
    if path.is_dir() and any(path.iterdir()):
        if not (path / "face.yaml").is_file():
            raise FileError(f"{path}: holds other files and no face; choose a folder that is new or empty")
        if not force:
            raise FileError(f"{path}: holds a face already; choose another folder, or say that it may be replaced "
                            "(--force)")
    return path


def save_folder(path: Path, files: Mapping[str, str]) -> Path:
    """Write texts as the files of a folder; all appear together. A folder that was there is replaced.

    Raises FileError; what was there is then still there.
    """
    with _whole_folder(path.resolve()) as draft:
        for name, text in files.items():
            (draft / name).write_text(text, encoding="utf-8", newline="\n")
    return path


@contextmanager
def _whole_folder(path: Path) -> Iterator[Path]:
    mark = os.urandom(4).hex()
    draft, old = (path.with_name(f".{path.name}.{mark}.{kind}") for kind in ("part", "old"))
    try:
        try:
            draft.mkdir()
            yield draft
            if path.is_dir():       # a folder is not renamed over another: the old one goes aside for a moment
                os.replace(path, old)
            try:
                os.replace(draft, path)
            except OSError:
                with suppress(OSError):
                    os.replace(old, path)
                raise
        finally:
            for left in (draft, old):
                shutil.rmtree(left, ignore_errors=True)
    except OSError as error:
        raise FileError(f"{path}: the face cannot be written: {error.strerror or error}") from error
