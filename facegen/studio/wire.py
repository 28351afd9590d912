"""What a page may say: every message of viser's page, and nothing else.

viser 1.1.1 ends a connection's task where a field is missing, and takes NaN for a place. Here a message is one of a
list, and its fields are of their type and in bounds.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import msgspec

FAR = 1e9                  # beyond it no scene is; NaN and infinity are beyond too
_NAME = 500                 # characters of a name, a uuid, a file's name

Number = Annotated[float, msgspec.Meta(ge=-FAR, le=FAR)]
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
    near: Annotated[float, msgspec.Meta(gt=0.0, le=FAR)]
    far: Annotated[float, msgspec.Meta(gt=0.0, le=FAR)]
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
