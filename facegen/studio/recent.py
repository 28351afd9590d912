"""What was loaded lately, kept: the least recently used gives way."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

T = TypeVar("T")


class Recent(Generic[T]):
    """So many things at most, by a key. Safe to call from several threads; none is made twice at the same time.

    held: says of a key whether it is in use and stays however many there are.
    """

    def __init__(self, most: int, held: Callable[[Hashable], bool] = lambda key: False) -> None:
        self._most, self._held = most, held
        self._kept: dict[Hashable, T] = {}          # the latest used last
        self._making: weakref.WeakValueDictionary[Hashable, threading.Lock] = weakref.WeakValueDictionary()
        self._lock = threading.Lock()

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what has a key, made if it is not there; who asks second waits and finds it."""
        with self._lock:
            if key in self._kept:
                return self._used(key)
            making = self._making.setdefault(key, threading.Lock())
        with making:
            with self._lock:
                if key in self._kept:
                    return self._used(key)
            made = make()
            self.put(key, made)
        return made

    def put(self, key: Hashable, one: T) -> None:
        """Keep something."""
        with self._lock:
            self._kept.pop(key, None)
            self._kept[key] = one
            for old in list(self._kept):
                if len(self._kept) <= self._most:
                    break
                if old != key and not self._held(old):
                    del self._kept[old]

    def forget(self, true: Callable[[Hashable], bool] = lambda key: True) -> None:
        """Drop what has a key of which something is true; by default everything."""
        with self._lock:
            self._kept = {key: one for key, one in self._kept.items() if not true(key)}

    def __len__(self) -> int:
        return len(self._kept)

    def _used(self, key: Hashable) -> T:
        self._kept[key] = one = self._kept.pop(key)
        return one
