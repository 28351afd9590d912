"""What a page may do by its messages: set a value that fits, send a file of a size that it told, and not too fast.

viser 1.1.1 sets whatever attribute a message names and keeps every byte that is sent.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from facegen.facs.yamlfile import SUFFIXES
from facegen.studio.limits import MEBIBYTE, Limits
from facegen.studio.wire import FAR, GuiUpdate, Kept, Refused, UploadPart, UploadStart, read

PART = 512 * 1024           # bytes of each part but the last of a file, as viser's page cuts it
_SHARE = 128 * 1024         # a message of so many bytes more counts as one more


@dataclass(frozen=True)
class Element:
    """What is known of an element of the panel.

    value: what it stands at. least, most: bounds, one or one a number. options: what can be chosen. files: where it
    takes files, and nothing else, what they may end in: nothing for any; None where it takes none.
    """

    value: Any = None
    least: float | Sequence[float] | None = None
    most: float | Sequence[float] | None = None
    options: Sequence[Any] | None = None
    files: tuple[str, ...] | None = None


def check_value(value: Any, element: Element, limits: Limits) -> None:
    """Refuse a value that does not fit an element: viser would set it all the same."""
    now = element.value
    if element.files is not None:
        fits = False
    elif isinstance(now, bool):
        fits = isinstance(value, bool)
    elif isinstance(now, (int, float)):
        fits = _is_number(value, element.least, element.most)
    elif isinstance(now, str):
        fits = isinstance(value, str) and len(value) <= limits.text
    elif isinstance(now, (tuple, list)):
        fits = (isinstance(value, list) and len(value) == len(now)
                and all(_is_number(one, _of(element.least, i), _of(element.most, i)) for i, one in enumerate(value)))
    else:
        fits = False
    if not fits:
        raise Refused("a value that does not fit its element")
    if element.options is not None and value not in element.options:
        raise Refused("a choice that is not offered")


def _of(bound: float | Sequence[float] | None, i: int) -> float | None:
    return bound if bound is None or isinstance(bound, (int, float)) else bound[i]


def _is_number(value: Any, least: float | None, most: float | None) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not -FAR <= value <= FAR:
        return False
    # A slider's last step may stand a rounding beyond its end.
    slack = 1e-6 * max(abs(least or 0.0), abs(most or 0.0), 1.0)
    return (least is None or value >= least - slack) and (most is None or value <= most + slack)


@dataclass
class Budget:
    """Bytes of uploads under way, of all pages together."""

    most: int
    taken: int = 0


@dataclass
class _Upload:
    element: str
    size: int
    parts: int
    came: set[int] = field(default_factory=set)


@dataclass
class Gate:
    """What one page has sent: its messages are checked here one by one, in order.

    element: looks up an element of this page by its uuid, None where there is none. budget: shared by all pages.
    """

    limits: Limits
    element: Callable[[str], Element | None]
    budget: Budget
    clock: Callable[[], float] = time.monotonic
    _uploads: dict[str, _Upload] = field(default_factory=dict)
    _due: float = 0.0

    def check(self, raw: bytes | str) -> Any:
        """Return a message that may go on to viser; raise Refused."""
        message = read(raw)
        if isinstance(message, GuiUpdate):
            self._update(message)
        elif isinstance(message, UploadStart):
            self._start(message)
        elif isinstance(message, UploadPart):
            self._part(message)
        elif isinstance(message, Kept) and len(message.value or "") + len(message.error or "") > self.limits.text:
            raise Refused("a text that is too long")
        return message

    def wait(self, size: int) -> float:
        """Return for how many seconds a message of so many bytes has to wait: a page that sends more than its share a
        second is heard later, and the others are heard in between."""
        now = self.clock()
        share = (1 + size // _SHARE) / self.limits.messages
        self._due = max(self._due, now - 1.0) + share        # a second's worth may come at once
        return max(self._due - now, 0.0)

    def close(self) -> None:
        """The page went: its uploads under way count no more."""
        for name in list(self._uploads):
            self._drop(name)

    def _update(self, message: GuiUpdate) -> None:
        if set(message.updates) != {"value"}:
            raise Refused(f"an update of {', '.join(sorted(ascii(name)[:40] for name in message.updates)) or 'nothing'}"
                          ", where only a value may be")
        element = self.element(message.uuid)
        if element is None:
            raise Refused("an update of an element that is not there")
        check_value(message.updates["value"], element, self.limits)

    def _start(self, message: UploadStart) -> None:
        limits, size = self.limits, message.size_bytes
        element = self.element(message.source_component_uuid)
        if element is None or element.files is None:
            raise Refused("an upload to an element that takes none")
        if message.transfer_uuid in self._uploads:
            raise Refused("an upload that is under way already", closes=True)
        if message.part_count != -(-size // PART):
            raise Refused("an upload whose parts do not make its size", closes=True)
        suffix = PurePath(message.filename).suffix.lower()
        if element.files and suffix not in element.files:
            raise Refused("an upload of another kind", f"{message.filename[:80]}: expected a file that ends in "
                                                       f"{', '.join(element.files)}.")
        most = limits.data_bytes if suffix in SUFFIXES else limits.file_bytes
        if size > most:
            raise Refused("an upload that is too large",
                          f"{message.filename[:80]} has {size / MEBIBYTE:.1f} MiB; the studio opens such files up to "
                          f"{most / MEBIBYTE:.1f} MiB.")
        under_way = sum(upload.size for upload in self._uploads.values())
        if (len(self._uploads) >= limits.uploads or under_way + size > limits.upload_bytes
                or self.budget.taken + size > self.budget.most):
            raise Refused("too many uploads at once", "Too much is being sent at once: try again in a moment.")
        if size:        # an empty file has no parts, and viser is done with it at once
            self._uploads[message.transfer_uuid] = _Upload(message.source_component_uuid, size, message.part_count)
            self.budget.taken += size

    def _part(self, message: UploadPart) -> None:
        upload = self._uploads.get(message.transfer_uuid)
        if upload is None:      # those of a file that was refused: viser's page sends them without waiting for a word
            raise Refused("a part of an upload that is not under way", counts=False)
        last = message.part_index == upload.parts - 1
        size = upload.size - (upload.parts - 1) * PART if last else PART
        if (message.part_index >= upload.parts or message.part_index in upload.came or len(message.content) != size
                or message.source_component_uuid != upload.element):
            # viser keeps what came so far until the page goes.
            raise Refused("a part that is not what was announced", closes=True)
        upload.came.add(message.part_index)
        if len(upload.came) == upload.parts:
            self._drop(message.transfer_uuid)

    def _drop(self, name: str) -> None:
        self.budget.taken -= self._uploads.pop(name).size
