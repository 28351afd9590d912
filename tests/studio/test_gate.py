"""The gate by itself: what a message may be, how much may be under way, and how fast."""

from __future__ import annotations

import contextlib
import math

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from studio_raw import CAMERA
from viser import _messages

from facegen.studio.gate import PART, Budget, Element, Gate, check_value
from facegen.studio.limits import Limits
from facegen.studio.wire import Refused, read

UPLOAD = Element(files=())
texts = st.text(max_size=20)
plain = st.recursive(st.none() | st.booleans() | st.integers(-2**63, 2**64 - 1) | st.floats() | texts
                     | st.binary(max_size=9),
                     lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4),
                     max_leaves=9)


def _gate(**options) -> Gate:
    limits = Limits(**options)
    return Gate(limits, {"open": UPLOAD, "smile": Element(0.5, 0.0, 1.0)}.get, Budget(4 * limits.upload_bytes))


@settings(deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(data):
    with contextlib.suppress(Refused):
        read(data)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from([CAMERA, {"type": "GuiUpdateMessage", "uuid": "smile", "updates": {"value": 0.5}},
                        {"type": "FileTransferStartUpload", "source_component_uuid": "open", "transfer_uuid": "t",
                         "filename": "a", "mime_type": "", "part_count": 1, "size_bytes": 3}]),
       st.data())
def test_a_message_with_one_thing_changed_is_read_or_refused(message, data):
    """What is let through, viser reads without a fault or a warning, and every number in it is finite."""
    changed = dict(message)
    name = data.draw(st.sampled_from(sorted(message)) | texts)
    value = data.draw(plain)
    changed[name] = value
    raw = msgspec.msgpack.encode(changed)
    try:
        _gate().check(raw)
    except Refused:
        return
    found = _messages.Message.deserialize(raw)
    for one in vars(found).values():
        for number in one if isinstance(one, tuple) else (one,):
            assert not isinstance(number, float) or math.isfinite(number)


@settings(deadline=None)
@given(plain, st.sampled_from([Element(0.5, 0.0, 1.0), Element(3, 1, 9), Element("a"), Element("a", options=("a", "b")),
                               Element(True), Element((1.0, 2.0), (0.0, 0.0), (5.0, 9.0)), Element((1, 2, 3)), UPLOAD,
                               Element(None)]))
def test_a_value_that_is_let_through_is_one_that_viser_takes(value, element):
    try:
        check_value(value, element, Limits(text=10))
    except Refused:
        return
    now = element.value
    cast = tuple(type(now[0])(one) for one in value) if isinstance(now, tuple) else type(now)(value)
    assert element.files is None
    assert now is not None
    for one in cast if isinstance(cast, tuple) else (cast,):
        assert not isinstance(one, float) or math.isfinite(one)
    if element.options:
        assert cast in element.options
    if isinstance(element.least, float):
        assert element.least <= cast <= element.most
    assert not isinstance(cast, str) or len(cast) <= 10


def _start(size, name="t", **more):
    return msgspec.msgpack.encode({
        "type": "FileTransferStartUpload", "source_component_uuid": "open", "transfer_uuid": name, "filename": "a.glb",
        "mime_type": "", "part_count": -(-size // PART), "size_bytes": size, **more})


def _part(index, content, name="t"):
    return msgspec.msgpack.encode({"type": "FileTransferPart", "source_component_uuid": "open", "transfer_uuid": name,
                                   "part_index": index, "content": content})


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 3 * PART), st.randoms())
def test_uploads_balance(size, random):
    gate = _gate()
    gate.check(_start(size))
    assert gate.budget.taken == size
    parts = [(i, b"x" * min(PART, size - i * PART)) for i in range(-(-size // PART))]
    random.shuffle(parts)
    for index, content in parts:
        gate.check(_part(index, content))
    assert gate.budget.taken == 0
    assert not gate._uploads


def test_pages_share_a_budget():
    limits = Limits(file_bytes=10 * PART, upload_bytes=10 * PART)
    budget = Budget(15 * PART)
    first, second = (Gate(limits, {"open": UPLOAD}.get, budget) for _ in range(2))
    first.check(_start(10 * PART))
    with pytest.raises(Refused, match="too many uploads"):
        second.check(_start(10 * PART))
    second.check(_start(5 * PART))
    first.close()
    assert budget.taken == 5 * PART
    first.check(_start(10 * PART))


def test_a_page_has_its_share_and_no_more():
    now = [100.0]
    gate = Gate(Limits(messages=10.0), lambda uuid: None, Budget(0), clock=lambda: now[0])
    assert [gate.wait(10) for _ in range(10)] == [0.0] * 10          # a second's worth at once
    pauses = 0.0
    for _ in range(50):
        pause = gate.wait(10)
        pauses += pause
        now[0] += pause
    assert pauses == pytest.approx(5.0)
    now[0] += 60.0
    assert gate.wait(10) == 0.0
    assert gate.wait(PART) == 0.0                   # a part counts as five
    for _ in range(3):
        gate.wait(PART)
    assert gate.wait(10) > 1.0
