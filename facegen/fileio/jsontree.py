"""A value somewhere in a JSON file that knows its file and place: every wrong value is refused by name."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from facegen.errors import FileError

# Because parsed JSON takes up to thirty times its text: enough for a scene of a million nodes, not for a bomb.
MOST_TOKENS = 4_000_000
# Above this a double no longer counts in ones.
_LARGEST = 1 << 53


def parse(text: bytes, path: Path, what: str = "JSON") -> dict[str, Any]:
    """Return the JSON object of a UTF-8 text, or raise FileError. ``what`` names it in the message."""
    if sum(text.count(token) for token in (b"[", b"{", b",")) > MOST_TOKENS:
        raise FileError(f"{path}: its {what} has more than {MOST_TOKENS:,} values, which no avatar needs")

    def refuse(word: str) -> float:
        raise ValueError(f"{word} is no JSON number")

    def finite(word: str) -> float:
        return float(word) if abs(float(word)) < math.inf else refuse(word[:20])

    try:
        found = json.loads(text.decode("utf-8-sig"), parse_constant=refuse, parse_float=finite)
    except (ValueError, RecursionError) as error:
        why = "nested too deeply" if isinstance(error, RecursionError) else str(error)[:120]
        raise FileError(f"{path}: its {what} cannot be read: {why}") from None
    if not isinstance(found, dict):
        raise FileError(f"{path}: its {what} must be an object, got {_shown(found)}")
    return found


class Tree:
    """One value of a parsed JSON file, read as what it must be. ``place`` is its path of keys."""

    __slots__ = ("path", "place", "value")

    def __init__(self, value: Any, path: Path, place: str = "") -> None:
        self.value, self.path, self.place = value, path, place

    def error(self, message: str) -> FileError:
        """Return a FileError that begins with file and place."""
        return FileError(f"{self.path}: {self.place or 'the file'}: {message}")

    def get(self, key: str) -> Tree | None:
        """Return a member of this object, or None if there is none."""
        if not isinstance(self.value, dict):
            raise self.error(f"expected an object, got {_shown(self.value)}")
        if self.value.get(key) is None:
            return None
        return Tree(self.value[key], self.path, f"{self.place}.{key}" if self.place else key)

    def __getitem__(self, key: str) -> Tree:
        found = self.get(key)
        if found is None:
            raise self.error(f"'{key}' is missing")
        return found

    def items(self, key: str) -> Items:
        """Return the elements of a member that is a list; none if it is missing."""
        return Items(self.get(key) or Tree([], self.path))

    def members(self) -> dict[str, Tree]:
        """Return the members of this object by name."""
        if not isinstance(self.value, dict):
            raise self.error(f"expected an object, got {_shown(self.value)}")
        return {key: Tree(value, self.path, f"{self.place}.{key}") for key, value in self.value.items()
                if value is not None}

    def integer(self, low: int = 0, high: int = _LARGEST) -> int:
        """Return a whole number low..high."""
        value = self.value
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            span = f"{low} or more" if high == _LARGEST else f"{low}..{high}"
            raise self.error(f"expected a whole number, {span}, got {_shown(self.value)}")
        return value

    def index(self, count: int, of: str) -> int:
        """Return a whole number that counts one of ``count`` things."""
        if not count:
            raise self.error(f"refers to {of} {_shown(self.value)}, but the file has none")
        value = self.integer()
        if value >= count:
            raise self.error(f"refers to {of} {value}; the last is {count - 1}")
        return value

    def numbers(self, count: int) -> list[float]:
        """Return a list of ``count`` finite numbers."""
        if not isinstance(self.value, list) or len(self.value) != count:
            raise self.error(f"expected {count} numbers, got {_shown(self.value)}")
        return [one.number() for one in Items(self)]

    def number(self) -> float:
        """Return a finite number."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < math.inf:
            raise self.error(f"expected a finite number, got {_shown(value)}")
        return float(value) if abs(value) <= _LARGEST or isinstance(value, float) else math.copysign(_LARGEST, value)

    def text(self) -> str:
        """Return a text."""
        if not isinstance(self.value, str):
            raise self.error(f"expected a text, got {_shown(self.value)}")
        return self.value

    def truth(self) -> bool:
        """Return true or false."""
        if not isinstance(self.value, bool):
            raise self.error(f"expected true or false, got {_shown(self.value)}")
        return self.value


class Items(Sequence[Tree]):
    """The elements of a list, each made when it is asked for."""

    def __init__(self, tree: Tree) -> None:
        if not isinstance(tree.value, list):
            raise tree.error(f"expected a list, got {_shown(tree.value)}")
        self._tree = tree

    def __len__(self) -> int:
        return len(self._tree.value)

    def __getitem__(self, index: int) -> Tree:
        return Tree(self._tree.value[index], self._tree.path, f"{self._tree.place}[{index}]")


def _shown(value: Any) -> str:
    """Return a value as it may stand in a message: short, whatever it is."""
    if isinstance(value, (dict, list)):
        kind = "an object" if isinstance(value, dict) else "a list"
        return f"{kind} of {len(value)}"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > _LARGEST:
        return "a number too large"
    return json.dumps(value)[:60] if value is not None else "nothing"
