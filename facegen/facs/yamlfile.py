"""Read a YAML or JSON file into plain dicts, lists, texts and numbers: strictly, safely, quickly.

A table needs little of YAML, so little is accepted: one document; no tags, anchors or aliases (nothing can be
built or blown up); no key twice; at most ``MAX_DEPTH`` levels and ``MAX_BYTES`` bytes. Keys are always text,
so ``12:`` and ``"12":`` are one key. Only ``true`` and ``false`` are booleans and only decimal numbers are
numbers: ``no``, ``1:30`` and ``0x1F`` stay the text they look like.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path

from facegen.errors import FileError, TableError

MAX_BYTES = 4_000_000  # the largest table of ours is a twentieth of this
MAX_DEPTH = 24  # ours need 6; deeper nesting is an accident or an attack
SUFFIXES = (".yaml", ".yml", ".json")

_INTEGER = re.compile(r"[-+]?(?:0|[1-9][0-9]{0,14})", re.ASCII)
_DECIMAL = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII)
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False, ".inf": float("inf"),
          "-.inf": float("-inf"), ".nan": float("nan")}
_NUMBER_STARTS = frozenset("0123456789-+.")


def read_data(path: str | Path) -> object:
    """Return the content of a ``.json`` file, or of any other file read as YAML.

    Raises FileError (missing, unreadable, too large, not UTF-8) or TableError (malformed; names line and
    key).
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            raw = file.read(MAX_BYTES + 1)
    except FileNotFoundError as error:
        raise FileError(f"{path}: there is no such file") from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = "it is a folder" if path.is_dir() else error
        raise FileError(f"{path}: cannot be read ({reason})") from error
    return parse_bytes(raw, str(path))


def parse_bytes(raw: bytes, source: str) -> object:
    """Return the data of a file's bytes: JSON if its name, ``source``, ends so, or YAML. Raises as `read_data`."""
    if len(raw) > MAX_BYTES:
        raise FileError(f"{source}: larger than {MAX_BYTES // 1_000_000} MB, which no table or pose needs")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError(f"{source}: not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    return parse_json(text, source) if source.lower().endswith(".json") else parse_yaml(text, source)


def parse_json(text: str, source: str) -> object:
    """Return the data of a JSON text; ``source`` names it in errors."""

    def unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
        result = dict(pairs)
        if len(result) < len(pairs):
            seen: set[str] = set()
            twice = next(key for key, _ in pairs if key in seen or seen.add(key))
            raise TableError(f"{source}: the key '{twice}' is given twice in one object")
        return result

    try:
        return json.loads(text, object_pairs_hook=unique)
    except TableError:
        raise
    except json.JSONDecodeError as error:
        raise TableError(f"{source}: line {error.lineno}, column {error.colno}: {error.msg}") from error
    except (RecursionError, ValueError) as error:  # ValueError: an integer of thousands of digits
        raise TableError(f"{source}: nested too deeply or a number too long") from error


def parse_yaml(text: str, source: str) -> object:
    """Return the data of a YAML text; ``source`` names it in errors."""
    import yaml

    base = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        loader = base(text)
    except yaml.YAMLError as error:
        raise TableError(f"{source}: {_describe(error)}") from error
    try:
        return _build(loader, yaml, source)
    except yaml.YAMLError as error:
        raise TableError(f"{source}: {_describe(error)}") from error
    finally:
        loader.dispose()


def line_of(text: str, keys: Sequence[str]) -> int:
    """Return the line, from 1, on which a path of keys stands in a YAML or JSON text that can be read; where a key is
    not there, the line of what holds it."""
    import yaml

    node, line = yaml.compose(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader)), 1
    for key in keys:
        inner = {one.value: (one, value) for one, value in node.value} if node.id == "mapping" else {}
        if key not in inner:
            break
        mark, node = inner[key]
        line = mark.start_mark.line + 1
    return line


def _describe(error: Exception) -> str:
    """Return a YAML error on one line, with the place where it was noticed."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    what = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
    where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
    if "nesting depth" in str(what):  # libyaml's own limit, met while it scans ahead of our first event
        return f"{where}nested deeper than {MAX_DEPTH} levels"
    return f"{where}not valid YAML: {' '.join(str(what).split())}"


def _scalar(value: str) -> object:
    """Return the value of an unquoted scalar."""
    if value[:1] in _NUMBER_STARTS:
        if _INTEGER.fullmatch(value):
            return int(value)
        if _DECIMAL.fullmatch(value):
            return float(value)
    return _WORDS.get(value, value)


_NO_KEY = object()


def _build(loader, yaml, source: str) -> object:
    """Return the data of the loader's events. No recursion, so depth cannot exhaust the stack.

    Each open container is a frame [container, pending key]; a list's pending key is its length.
    """
    frames: list[list] = []
    root: list = []  # the finished document

    def fail(event, message: str) -> TableError:
        line = event.start_mark.line + 1 if event.start_mark else "?"
        keys = [str(len(box) if isinstance(box, list) else key) for box, key in frames if key is not _NO_KEY]
        return TableError(f"{source}: line {line}: {'.'.join(keys) + ': ' if keys else ''}{message}")

    def place(value: object) -> None:
        if not frames:
            root.append(value)
            return
        frame = frames[-1]
        if isinstance(frame[0], list):
            frame[0].append(value)
        else:
            frame[0][frame[1]] = value
            frame[1] = _NO_KEY

    while True:
        event = loader.get_event()
        kind = type(event)
        if kind is yaml.ScalarEvent:
            if event.anchor or not (event.implicit[0] or event.implicit[1]):
                raise fail(event, "tags (!...) and anchors (&...) are not used in facegen's files")
            if frames and frames[-1][1] is _NO_KEY:
                key = event.value
                if key in frames[-1][0]:
                    raise fail(event, f"the key '{key}' is given twice")
                frames[-1][1] = key
            else:
                place(_scalar(event.value) if event.implicit[0] else event.value)
        elif kind is yaml.MappingStartEvent or kind is yaml.SequenceStartEvent:
            if event.anchor or event.tag:
                raise fail(event, "tags (!...) and anchors (&...) are not used in facegen's files")
            if frames and frames[-1][1] is _NO_KEY:
                raise fail(event, "a key must be plain text, not a list or a mapping")
            if len(frames) >= MAX_DEPTH:
                raise fail(event, f"nested deeper than {MAX_DEPTH} levels")
            frames.append([{}, _NO_KEY] if kind is yaml.MappingStartEvent else [[], 0])
        elif kind is yaml.MappingEndEvent or kind is yaml.SequenceEndEvent:
            box = frames.pop()[0]
            place(box)
        elif kind is yaml.AliasEvent:
            raise fail(event, "aliases (*name) are not used in facegen's files; write the value out")
        elif kind is yaml.DocumentStartEvent:
            if root:
                raise fail(event, "one document a file, please: remove the second '---'")
        elif kind is yaml.StreamEndEvent:
            return root[0] if root else None
