"""Dictionaries and packets: back as they went, and refused when they are not what they were."""

from __future__ import annotations

import contextlib
import zlib
from fractions import Fraction

import pytest
from codec.faces import lively
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.blendshapes.recipes import shape_set
from facegen.codec.dictionary import Dictionary, read_dictionary, step_code
from facegen.codec.packets import KEY, MAGIC, MTU, Packet, Unframer, framed, kind_of, read_packet
from facegen.codec.recording import encode_performance
from facegen.codec.syntax import PacketError
from facegen.errors import InputError

ARKIT = tuple(shape_set("arkit"))
PACKETS = encode_performance(lively(60), frames=8)
ROW = MAGIC + b"".join(map(framed, PACKETS))
FIRST = len(MAGIC) + 3 + len(PACKETS[0])     # where the first packet of motion begins

lines = st.text(st.characters(blacklist_characters="\n", blacklist_categories=["Cs"]), min_size=1, max_size=9)


@st.composite
def dictionaries(draw):
    vocabulary = draw(st.sampled_from(["units", "expressions", "arkit", "visemes", "vrm", "shapes"]))
    names = tuple(draw(st.lists(st.sampled_from(ARKIT) if vocabulary == "arkit" else lines, unique=True, max_size=40)))
    parts = tuple(part for part in ("head", "place", "gaze") if draw(st.booleans()))
    wide = len(names) + sum({"head": 3, "place": 3, "gaze": 4}[part] for part in parts)
    codes = tuple(draw(st.lists(st.integers(0, 255), min_size=wide, max_size=wide)))
    partners = tuple(1 if k % 2 == 0 and k + 1 < len(names) and draw(st.booleans()) else 0 for k in range(len(names)))
    rate = Fraction(draw(st.integers(1, 60_000)), draw(st.integers(60, 1001)))
    return Dictionary(vocabulary, names, rate, draw(st.integers(1, 64)), codes, parts, partners, draw(st.booleans()))


@given(dictionaries())
def test_dictionaries_come_back(one):
    again = read_dictionary(one.data)
    assert again == one
    assert (again.id, again.pairs, again.kinds) == (one.id, one.pairs, one.kinds)


def test_arkit_needs_no_names():
    codes = (100,) * len(ARKIT)
    in_order = Dictionary("arkit", ARKIT, Fraction(25), 16, codes)
    assert len(in_order.data) < 60 < 250 < len(Dictionary("arkit", ARKIT[::-1], Fraction(25), 16, codes).data)


@given(st.floats(0.0011, 64.0))
def test_a_step_is_at_most_as_coarse_as_asked(step):
    found = 64.0 * 2.0 ** (-step_code(step) / 16)
    assert found <= step * (1 + 1e-9)
    assert found >= step * 2.0 ** (-1 / 16) * (1 - 1e-9)


@settings(max_examples=200)
@given(st.binary(max_size=200), st.booleans())
def test_no_bytes_break_the_reader_of_dictionaries(data, packed):
    with contextlib.suppress(PacketError):
        data = zlib.compress(data) if packed else data
        assert read_dictionary(data).data == data


@pytest.mark.parametrize(("change", "message"), [
    (lambda data: data[:5], "expected 10 bytes or more"),
    (lambda data: bytes([data[0] | 16]) + data[1:], "does not know"),
    (lambda data: data[:1] + b"\6" + data[2:], "does not know"),
    (lambda data: data[:4] + b"\0\0" + data[6:], "does not know"),
    (lambda data: data[:2] + b"\0\0" + data[4:], "fps"),
    (lambda data: data[:6] + b"\x41" + data[7:], "frames"),
    (lambda data: data[:7] + b"\0\4" + data[9:], "expected 4 names"),
    (lambda data: data[:7] + b"\xff\xff" + data[9:], "bytes or more"),
    (lambda data: data[:-1] + b"\xff", "utf-8"),
    (lambda data: data[:13] + b"\1\1" + data[15:], "one partner"),
    (lambda data: data[:13] + b"\0\0\5" + data[16:], "one partner"),
])
def test_what_no_dictionary_says_is_refused(change, message):
    data = zlib.decompress(Dictionary("units", ("1", "12", "26"), Fraction(25), 16, (1, 2, 3)).data)
    with pytest.raises(PacketError, match=message):
        read_dictionary(zlib.compress(change(data)))


def test_a_small_packet_does_not_unpack_to_much():
    with pytest.raises(PacketError):
        read_dictionary(zlib.compress(bytes(50_000_000)))


@pytest.mark.parametrize(("options", "message"), [
    ({"names": tuple(map(str, range(513))), "codes": (0,) * 513}, "up to 512"),
    ({"codes": (1,)}, "codes: expected 2"),
    ({"codes": (1, 300)}, "codes: expected"),
    ({"parts": ("gaze", "head")}, "in this order"),
    ({"rate": Fraction(70_001, 70_000)}, "fps"),
])
def test_a_dictionary_says_what_is_wrong(options, message):
    good = {"vocabulary": "units", "names": ("1", "2"), "rate": Fraction(25), "frames": 4, "codes": (1, 2)}
    with pytest.raises(InputError, match=message):
        Dictionary(**good | options)


@given(st.integers(0, 3), st.integers(0, 70_000), st.binary(max_size=MTU - 5), st.binary(min_size=4, max_size=4))
def test_packets_come_back(kind, number, body, stream):
    data = Packet(kind, number, body).bytes(stream)
    assert kind_of(data) == kind
    assert read_packet(data, stream) == Packet(kind, number % 65_536, body)


@given(st.integers(0, 200), st.integers(1, 255))
def test_a_changed_byte_is_noticed(at, change):
    data = bytearray(Packet(KEY, 7, bytes(range(60))).bytes(b"name"))
    data[at % len(data)] ^= change
    with pytest.raises(PacketError):
        read_packet(bytes(data), b"name")


@pytest.mark.parametrize("data", [b"", b"\x11", b"\x21aabb", b"\x14aabb", b"\x11" + bytes(MTU)])
def test_what_can_be_no_packet(data):
    assert kind_of(data) is None


@given(st.lists(st.integers(1, 40), max_size=60))
def test_a_row_of_bytes_in_any_pieces(cuts):
    unframer, found, at = Unframer(), [], 0
    for length in [*cuts, len(ROW)]:
        found += unframer.push(ROW[at:at + length])
        at += length
    assert found + unframer.push(b"", last=True) == PACKETS
    assert unframer.skipped == 0


@settings(deadline=None)
@given(st.integers(FIRST, len(ROW) - 1), st.integers(0, 30), st.binary(max_size=30) | st.just(framed(PACKETS[2])[:20]))
def test_damage_in_a_row_costs_what_it_hits(at, cut, rubbish):
    """Bytes cut out and others put in: all packets before and after are found, and no others."""
    unframer, place, whole = Unframer(), FIRST, PACKETS[:1]
    found = unframer.push(ROW[:at] + rubbish + ROW[at + cut:]) + unframer.push(b"", last=True)
    for packet in PACKETS[1:]:
        end = place + 3 + len(packet)
        whole = [*whole, packet] if end <= at or place >= at + cut else whole
        place = end
    assert [one for one in PACKETS if one in whole] == [one for one in found if one in whole]
    assert set(found) <= set(PACKETS)


@given(st.integers(0, 20))
def test_without_a_dictionary_packets_are_given_as_they_are(cut):
    row = ROW[FIRST:]
    unframer = Unframer()
    assert unframer.push(row[cut:]) + unframer.push(b"", last=True) == PACKETS[1 + (cut > 0):]


def test_an_end_in_the_middle_of_a_packet():
    unframer = Unframer()
    found = unframer.push(ROW[:-3])
    assert found == PACKETS[:-1]
    assert unframer.push(b"", last=True) == []
    assert unframer.skipped > 0
