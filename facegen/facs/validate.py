"""Checked access to a table: every failure names file, path of keys and nearest valid name."""

from __future__ import annotations

import math
import numbers
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from facegen.errors import TableError, nearest


@dataclass(frozen=True, slots=True)
class Entry:
    """One value of a table: ``source`` is the file, ``path`` the keys that lead to the value."""

    value: object
    source: str
    path: str = ""

    def fail(self, message: str) -> TableError:
        """Return the error to raise for this value."""
        return TableError(f"{self.source}: {self.path + ': ' if self.path else ''}{message}")

    def wrong(self, expected: str) -> TableError:
        """Return the error for a value that is not what was expected."""
        if self.value is None:
            return self.fail(f"expected {expected}, got nothing")
        text = repr(self.value)
        return self.fail(f"expected {expected}, got {text if len(text) <= 60 else text[:57] + '...'}")

    def child(self, key: object) -> str:
        """Return the path of a key inside this value."""
        return f"{self.path}.{key}" if self.path else str(key)

    def items(self) -> Iterator[tuple[str, Entry]]:
        """Yield the keys (as text) and entries of a mapping with free keys."""
        if not isinstance(self.value, Mapping):
            raise self.wrong("a mapping (key: value)")
        for key, value in self.value.items():
            if isinstance(key, bool) or not isinstance(key, (str, int)):
                raise self.fail(f"a key must be text, got {key!r}")
            yield str(key), Entry(value, self.source, self.child(key))

    def fields(self, *, required: Collection[str] = (), optional: Collection[str] = ()) -> dict[str, Entry]:
        """Return the entries of a mapping whose keys are known; an unknown or missing key is an error."""
        known = [*required, *optional]
        result = {}
        for key, entry in self.items():
            if key not in known:
                raise self.fail(f"unknown key '{key}'{nearest(key, known)} "
                                f"(known: {', '.join(sorted(known))})")
            result[key] = entry
        for key in required:
            if key not in result:
                raise self.fail(f"the key '{key}' is missing")
        return result

    def each(self) -> list[Entry]:
        """Return the entries of a list."""
        value = self.value.tolist() if hasattr(self.value, "tolist") else self.value
        if not isinstance(value, (list, tuple)):
            raise self.wrong("a list")
        return [Entry(item, self.source, self.child(i)) for i, item in enumerate(value)]

    def text(self) -> str:
        """Return a text that is not empty."""
        if not isinstance(self.value, str) or not self.value.strip():
            raise self.wrong("a text")
        return self.value.strip()

    def texts(self) -> tuple[str, ...]:
        """Return a list of texts."""
        return tuple(entry.text() for entry in self.each())

    def flag(self) -> bool:
        """Return true or false."""
        if not isinstance(self.value, bool):
            raise self.wrong("true or false")
        return self.value

    def number(self, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a finite number in ``low..high``."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise self.wrong("a number")
        try:
            result = float(value)
        except OverflowError:
            result = math.inf
        if not math.isfinite(result):
            raise self.wrong("a finite number")
        if not low <= result <= high:
            raise self.wrong(f"a number in {low:g}..{high:g}")
        return result

    def index(self, count: int, what: str) -> int:
        """Return a whole number in ``0..count - 1``; ``what`` it counts."""
        value = self.number()
        if not 0 <= value < count or value != int(value):
            raise self.wrong(f"{what}, 0..{count - 1}")
        return int(value)

    def vector(self, limit: float) -> tuple[float, float, float]:
        """Return three numbers in ``-limit..limit``."""
        value = self.value.tolist() if hasattr(self.value, "tolist") else self.value
        if not isinstance(value, (list, tuple)) or len(value) != 3:
            raise self.wrong("three numbers [x, y, z]")
        if all(type(v) is float and -limit <= v <= limit for v in value):  # the common case, kept quick
            return tuple(value)
        x, y, z = (Entry(v, self.source, self.child(i)).number(-limit, limit) for i, v in enumerate(value))
        return x, y, z

    def choice(self, valid: Collection[str], kind: str) -> str:
        """Return a text that is one of the valid names; ``kind`` says what they name."""
        name = str(self.value) if type(self.value) is int else self.text()
        if name not in valid:
            raise self.fail(f"unknown {kind} '{name}'{nearest(name, valid)}")
        return name
