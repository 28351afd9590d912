"""What a page may say: every message of viser's page, and nothing else, checked before viser sees it.

viser 1.1.1 sets whatever attribute a message names, keeps every byte that is sent, and ends the connection's task
where a field is missing. Here a message is one of a list, its fields are of their type and in bounds, and a value fits
the element that it is for.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import msgspec

from facegen.studio.limits import MEBIBYTE, Limits

PART = 512 * 1024           # bytes of each part but the last of a file, as viser's page cuts it
_FAR = 1e9                  # beyond it no scene is; NaN and infinity are beyond too
_SHARE = 128 * 1024         # a message of so many bytes more counts as one more
_NAME = 500                 # characters of a name, a uuid, a file's name

Number = Annotated[float, msgspec.Meta(ge=-_FAR, le=_FAR)]
Count = Annotated[int, msgspec.Meta(ge=0, le=1 << 40)]
Name = Annotated[str, msgspec.Meta(max_length=_NAME)]
Vector = tuple[Number, Number, Number]
Pixel = tuple[Number, Number]
Turn = tuple[Number, Number, Number, Number]
# Typed, so that a message of a million small things is refused at the first of them.
Value = bool | int | float | str | Annotated[list[Number], msgspec.Meta(max_length=64)] | None


class Refused(Exception):
    """A message that is not let through.

    tell: a sentence for the person at the page, where it may be theirs. closes: whether the page has to go.
    counts: whether an honest page would not send it.
    """

    def __init__(self, why: str, tell: str = "", *, closes: bool = False, counts: bool = True) -> None:
        super().__init__(why)
        self.tell, self.closes, self.counts = tell, closes, counts


class _Message(msgspec.Struct, tag_field="type", forbid_unknown_fields=True):
    """A message that a page may send; the tag is the name of viser's class."""


class Camera(_Message, tag="ViewerCameraMessage"):
    """Where the page looks from."""

    wxyz: Turn
    position: Vector
    fov: Annotated[float, msgspec.Meta(gt=0.0, lt=math.pi)]
    near: Annotated[float, msgspec.Meta(gt=0.0, le=_FAR)]
    far: Annotated[float, msgspec.Meta(gt=0.0, le=_FAR)]
    image_height: Annotated[float, msgspec.Meta(ge=0, le=1 << 16)]
    image_width: Annotated[float, msgspec.Meta(ge=0, le=1 << 16)]
    look_at: Vector
    up_direction: Vector


class ScenePointer(_Message, tag="ScenePointerMessage"):
    """A click into the scene, or a rectangle drawn over it."""

    event_type: Literal["click", "rect-select"]
    ray_origin: Vector | None
    ray_direction: Vector | None
    screen_pos: Annotated[list[Pixel], msgspec.Meta(max_length=4)]
    modifier: Name | None


class NodeClick(_Message, tag="SceneNodeClickMessage"):
    """A click on an object."""

    name: Name
    instance_index: Count | None
    ray_origin: Vector
    ray_direction: Vector
    screen_pos: Pixel
    modifier: Name | None
    owner: Name = ""


class NodeDrag(_Message, tag="SceneNodeDragMessage"):
    """An object is dragged."""

    phase: Literal["start", "update", "end"]
    name: Name
    instance_index: Count | None
    start_position: Vector
    start_screen_pos: Pixel
    end_position: Vector
    end_screen_pos: Pixel
    button: Literal["left", "middle", "right"]
    modifier: Name | None
    owner: Name = ""


class Control(_Message, tag="TransformControlsUpdateMessage"):
    """A gizmo is moved."""

    name: Name
    wxyz: Turn
    position: Vector
    owner: Name = ""


class ControlStart(_Message, tag="TransformControlsDragStartMessage"):
    """A gizmo is taken."""

    name: Name
    owner: Name = ""


class ControlEnd(_Message, tag="TransformControlsDragEndMessage"):
    """A gizmo is let go."""

    name: Name
    owner: Name = ""


class GuiUpdate(_Message, tag="GuiUpdateMessage"):
    """An element of the panel has another value, or is a button that was pressed."""

    uuid: Name
    updates: Annotated[dict[Name, Value], msgspec.Meta(max_length=8)]


class ButtonHold(_Message, tag="GuiButtonHoldMessage"):
    """A button is held down."""

    uuid: Name
    frequency: Number


class FormSubmit(_Message, tag="GuiFormSubmitMessage"):
    """A form is sent."""

    uuid: Name


class FormDirty(_Message, tag="GuiFormDirtyMessage"):
    """A form was changed."""

    uuid: Name


class Command(_Message, tag="CommandTriggerMessage"):
    """A command of the palette was chosen."""

    uuid: Name


class UploadStart(_Message, tag="FileTransferStartUpload"):
    """A file will come."""

    source_component_uuid: Name
    transfer_uuid: Name
    filename: Name
    mime_type: Name
    part_count: Count
    size_bytes: Count


class UploadPart(_Message, tag="FileTransferPart"):
    """A part of a file."""

    source_component_uuid: Name | None
    transfer_uuid: Name
    part_index: Count
    content: bytes


class Render(_Message, tag="GetRenderResponseMessage"):
    """A picture that was asked for."""

    payload: bytes
    render_uuid: Name


class Kept(_Message, tag="LocalStorageGetItemResponseMessage"):
    """What the browser kept, that was asked for."""

    request_uuid: Name
    value: str | None = None
    error: str | None = None


_ALL = (Camera | ScenePointer | NodeClick | NodeDrag | Control | ControlStart | ControlEnd | GuiUpdate | ButtonHold
        | FormSubmit | FormDirty | Command | UploadStart | UploadPart | Render | Kept)
_DECODER = msgspec.msgpack.Decoder(_ALL)


@dataclass(frozen=True)
class Element:
    """What is known of an element of the panel.

    value: what it stands at. least, most: bounds, one or one a number. options: what can be chosen. files: whether it
    takes files, and nothing else.
    """

    value: Any = None
    least: float | Sequence[float] | None = None
    most: float | Sequence[float] | None = None
    options: Sequence[Any] | None = None
    files: bool = False


def read(raw: bytes | str) -> Any:
    """Return a page's message. Raises Refused for any that viser's page does not send."""
    if not isinstance(raw, bytes):
        raise Refused("text, where bytes are expected")
    try:
        found = _DECODER.decode(raw)
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise Refused(f"no message of viser's page: {str(error)[:120]}") from None
    if isinstance(found, (Camera, Control)) and not 0.5 < math.hypot(*found.wxyz) < 2.0:
        raise Refused("a turn that is none")
    if isinstance(found, Camera) and not any(found.up_direction):
        raise Refused("a camera without an up direction")
    return found


def check_value(value: Any, element: Element, limits: Limits) -> None:
    """Refuse a value that does not fit an element: viser would set it all the same."""
    now = element.value
    if element.files:
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
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not -_FAR <= value <= _FAR:
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
        if element is None or not element.files:
            raise Refused("an upload to an element that takes none")
        if message.transfer_uuid in self._uploads:
            raise Refused("an upload that is under way already", closes=True)
        if message.part_count != -(-size // PART):
            raise Refused("an upload whose parts do not make its size", closes=True)
        if size > limits.file_bytes:
            raise Refused("an upload that is too large",
                          f"{message.filename[:80]} has {size / MEBIBYTE:.1f} MiB; the studio opens files of up to "
                          f"{limits.file_bytes / MEBIBYTE:.1f} MiB.")
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
