"""A person's table, changed and saved: only what was changed is written anew, so comments of its owner stay."""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from facegen.errors import FileError, InputError
from facegen.facs.expression_table import HABITS, Person, check_movements, person_from_data
from facegen.facs.yamlfile import parse_bytes, parse_yaml
from facegen.facs.yamltext import entry_lines, yaml_text
from facegen.fileio.textfile import check_place, save_text

_SUFFIXES = (".yaml", ".yml")


@dataclass(frozen=True)
class Change:
    """A table about to be saved: ``path``; ``before``, the file's text ("" if there is none), and ``after``;
    ``person`` as the new text is read; ``kept``: whether all comments stay."""

    path: Path
    before: str
    after: str
    person: Person
    kept: bool

    @property
    def diff(self) -> str:
        """The change as a unified diff; empty if nothing changes."""
        before, after = self.before.splitlines(keepends=True), self.after.splitlines(keepends=True)
        lines = difflib.unified_diff(before, after, self.path.name if self.before else "(new)", self.path.name)
        return "".join(line if line.endswith("\n") else line + "\n" for line in lines)

    def save(self) -> Path:
        """Write the file, whole, and return its path.

        Raises InputError if somebody else changed it since, FileError if it cannot be written.
        """
        if _text(self.path) != self.before:
            raise InputError(f"{self.path}: the file was changed meanwhile; look at the difference again, then save")
        return save_text(self.after, self.path)


def person_change(data: Mapping[str, Any], path: str | os.PathLike[str]) -> Change:
    """Return what saving a person's table, as plain data (docs/tables.md), to a .yaml file would change.

    Nothing is written before `Change.save`. Raises TableError for data that are no person's, FileError for the path. ::

        change = person_change({**data, "units": {"12": {"scale": 0.5}}}, "ada.yaml")
        print(change.diff)
        change.save()
    """
    path = check_place(path, _SUFFIXES)
    before = _text(path)
    after, kept = changed_text(before, data)
    return Change(path, before, after, person_from_data(parse_yaml(after, str(path)), str(path), name=path.stem), kept)


def read_person_data(content: bytes, name: str, *, most: int | None = None) -> dict[str, Any]:
    """Return the plain data of a person's table, given its file's content and name; InputError if it is none.

    most: habits that it may have, see `check_count`.
    """
    data = parse_bytes(content, name)
    if most is not None:
        check_count(data, most, name)
    check_movements(person_from_data(data, name), content.decode("utf-8-sig"), name)
    return data


def check_count(data: object, most: int, source: str = "person") -> None:
    """Raise InputError for a person's table, as plain data, with more habits (expressions, words for them, units) than
    so many: each takes a moment to read."""
    entries = [entry for key in HABITS for entry in _inner(data, key).items()]
    count = len(entries) + sum(len(_inner(one, "also", list)) for _, one in entries)
    if count > most:
        raise InputError(f"{source}: has {count:,} habits (expressions, other words for them, units); expected up to "
                         f"{most:,}")


def _inner(data: object, key: str, kind: type = dict) -> Any:
    """Return what stands under a key, empty where it is of another kind: whoever reads the table says so."""
    found = data.get(key) if isinstance(data, dict) else None
    return found if isinstance(found, kind) else kind()


def changed_text(text: str, data: Mapping[str, Any]) -> tuple[str, bool]:
    """Return the text of a YAML file whose data are changed to others, and whether its comments could stay.

    Only lines of what differs are written anew. Where that cannot be done, the whole file is.
    """
    try:
        old = parse_yaml(text, "text")
        if isinstance(old, Mapping) and old:
            lines = text.splitlines()
            # From the end on, so that lines before keep their numbers; of two at one line the inner one stands first.
            for start, end, new in sorted(_edits(_root(text), old, data, ""), key=lambda one: one[0])[::-1]:
                lines[start:end] = new
            made = "\n".join(lines) + "\n"
            if parse_yaml(made, "text") == parse_yaml(yaml_text(data), "text"):
                return made, True
    except (InputError, _NotInPlace):
        pass
    return yaml_text(data), "#" not in text


class _NotInPlace(Exception):
    """The file is written in a way that cannot be changed line by line."""


_Edit = tuple[int, int, list[str]]


def _edits(node: Any, old: Mapping[str, Any], new: Mapping[str, Any], indent: str) -> list[_Edit]:
    """Return (first line, line after the last, new lines) of what differs in a block mapping."""
    found: list[_Edit] = []
    entries = {str(key.value): (key, value) for key, value in node.value}
    if list(entries) != list(old):
        raise _NotInPlace
    last = 0
    for name, (key, value) in entries.items():
        first, last = key.start_mark.line, _last_line(value) + 1
        if name not in new:
            found.append((first, last, []))
        elif old[name] == new[name]:
            continue
        elif _is_block(value) and isinstance(new[name], Mapping) and new[name] and old[name]:
            found += _edits(value, old[name], new[name], " " * value.value[0][0].start_mark.column)
        else:
            found.append((first, last, entry_lines(name, new[name], indent)))
    added = [line for name in new if name not in old for line in entry_lines(name, new[name], indent)]
    if added:
        found.append((last, last, added))
    return found


def _is_block(node: Any) -> bool:
    return node.id == "mapping" and not node.flow_style and bool(node.value)


def _last_line(node: Any) -> int:
    """Return the last line that a value has something on."""
    if node.id != "scalar" and not node.flow_style and node.value:
        inner = node.value[-1]
        return _last_line(inner[1] if node.id == "mapping" else inner)
    end = node.end_mark
    return end.line if end.column > 0 or end.line == node.start_mark.line else end.line - 1


def _root(text: str) -> Any:
    import yaml

    root = yaml.compose(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    if not _is_block(root):
        raise _NotInPlace
    return root


def _text(path: Path) -> str:
    """Return a file's text, "" if there is none."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        return ""
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: cannot be read ({error})") from error
