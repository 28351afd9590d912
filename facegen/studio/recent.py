"""What was loaded lately, kept: the least recently used gives way, what somebody still has is found all the same."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

T = TypeVar("T")


class Recent(Generic[T]):
    """Things by a key: the latest used, so many at most, and each that somebody else still holds, so that nothing is
    there twice. Safe to call from several threads; nothing is made twice at the same time."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: dict[Hashable, T] = {}          # the latest used last
        self._alive: weakref.WeakValueDictionary[Hashable, T] = weakref.WeakValueDictionary()
        self._making: weakref.WeakValueDictionary[Hashable, threading.Lock] = weakref.WeakValueDictionary()
        self._lock = threading.Lock()

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what has a key, made if it is not there; who asks second waits and finds it."""
        with self._lock:
            making = self._making.setdefault(key, threading.Lock())
        with making:
            found = self._alive.get(key)
            if found is None:
                found = make()
            self.put(key, found)
        return found

    def put(self, key: Hashable, one: T) -> None:
        """Keep something."""
        with self._lock:
            self._kept.pop(key, None)
            self._kept[key] = self._alive[key] = one
            while len(self._kept) > self._most:
                del self._kept[next(iter(self._kept))]

    def forget(self, key: Hashable) -> None:
        """Have the next who asks for a key make it anew."""
        with self._lock:
            self._kept.pop(key, None)
            self._alive.pop(key, None)
