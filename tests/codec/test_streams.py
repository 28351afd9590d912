"""Encoder and decoder: small errors, and a stated recovery from whatever happens to packets."""

from __future__ import annotations

import random

import numpy as np
import pytest
from codec.faces import NAMES, idle, lively
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.animation.performance import Performance
from facegen.blendshapes.recipes import shape_set
from facegen.codec.decoder import CONCEALED, Decoder
from facegen.codec.dictionary import Dictionary
from facegen.codec.encoder import Encoder
from facegen.codec.packets import DICTIONARY, END, KEY, MTU, NEXT, Packet, kind_of
from facegen.codec.plan import REACH
from facegen.codec.recording import decode_packets, encode_performance, encoder_for
from facegen.codec.syntax import SIDE
from facegen.errors import InputError

SETTINGS = [{}, {"frames": 1, "key_every": 10}, {"frames": 4, "key_every": 5}, {"frames": 64}]


def split(packets):
    """Return the dictionary's, the motion's and the end's packets."""
    return tuple([one for one in packets if kind_of(one) in kinds] for kinds in ((DICTIONARY,), (KEY, NEXT), (END,)))


def run(decoder, packets):
    return [frame for packet in packets for frame in decoder.push(packet)] + decoder.finish()


# -- errors ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("options", SETTINGS, ids=str)
@pytest.mark.parametrize("quality", [0.2, 0.8, 3.0])
def test_every_value_is_within_its_steps(options, quality):
    truth = lively()
    dictionary = encoder_for(truth, quality=quality).dictionary
    again = decode_packets(encode_performance(truth, quality=quality, **options))
    assert (again.names, again.vocabulary, len(again)) == (truth.names, truth.vocabulary, len(truth))
    assert again.times == pytest.approx(truth.times)
    steps = np.array(dictionary.steps)
    reach = REACH * steps
    for a, b in dictionary.pairs:
        reach[a] = reach[b] = REACH * (steps[a] + steps[b] / 2)
    yaw, pitch = (REACH * (steps[k] + steps[k + 2] / 2) for k in (10, 11))
    assert (abs(again.weights - truth.weights) <= reach[:7] + 1e-9).all()
    assert (abs(again.head - truth.head) <= reach[7:10] + 1e-9).all()
    assert (abs(again.gaze - truth.gaze) <= np.array([yaw, pitch, yaw, pitch]) + 1e-9).all()


def test_finer_is_more_bits_and_less_error():
    truth, sizes, errors = lively(), [], []
    for quality in (0.2, 0.5, 1.0, 2.0, 5.0):
        packets = encode_performance(truth, quality=quality)
        sizes.append(sum(map(len, packets)))
        errors.append(abs(decode_packets(packets).weights - truth.weights).mean())
    assert sizes == sorted(sizes, reverse=True)
    assert errors == sorted(errors)


def test_a_face_at_rest_costs_almost_nothing():
    _, motion, _ = split(encode_performance(Performance(np.arange(160) / 25, NAMES, np.full((160, 7), 0.0), "units")))
    assert all(len(packet) <= 7 for packet in motion)


def test_sides_that_go_together_are_sent_together():
    dictionary = Encoder(NAMES).dictionary
    assert [NAMES[a] + NAMES[b] for a, b in dictionary.pairs] == ["L12R12", "L45R45"]
    assert [kind == SIDE for kind in dictionary.kinds[:7]] == [False, False, False, True, False, False, True]
    pairs = Encoder(tuple(shape_set("arkit")), vocabulary="arkit").dictionary.pairs
    assert len(pairs) == 16             # jaw, mouth and eyes to the side are opposites, or go crosswise
    found = {name for pair in pairs for name in (list(shape_set("arkit"))[pair[0]], list(shape_set("arkit"))[pair[1]])}
    assert not {"jawLeft", "mouthRight", "eyeLookInLeft"} & found


def test_gaps_are_sent_as_gaps():
    truth = lively(lost=True)
    again = decode_packets(encode_performance(truth))
    assert (again.found == truth.found).all()
    assert np.isfinite(again.weights[60]).all()          # one weight missing: the line between its neighbours
    assert again.weights[60, 2] == pytest.approx((truth.weights[59, 2] + truth.weights[61, 2]) / 2, abs=0.3)
    assert again.warnings == ()


def test_nothing_but_gaps():
    truth = Performance(np.arange(40) / 25, NAMES, np.full((40, 7), np.nan), "units")
    for options in SETTINGS:
        assert not decode_packets(encode_performance(truth, **options)).found.any()


def test_other_rates_and_uneven_times_are_made_even():
    times = np.cumsum(np.random.default_rng(0).uniform(0.01, 0.05, 200))
    truth = Performance(times, ("26",), 0.5 + 0.4 * np.sin(3 * times)[:, None], "units")
    again = decode_packets(encode_performance(truth, fps=30, quality=0.1))
    assert again.rate == pytest.approx(30)
    assert again.weights[:, 0] == pytest.approx(0.5 + 0.4 * np.sin(3 * (times[0] + again.times)), abs=0.02)
    late = Performance([0.0, 0.04, 3.0, 3.04], ("26",), np.ones((4, 1)), "units")
    found = decode_packets(encode_performance(late)).found
    assert found[:2].all()
    assert not found[5:70].any()


def test_packets_fit_the_network_whatever_they_hold():
    dice = np.random.default_rng(1)
    names = tuple(f"s{k}" for k in range(80))
    noise = Performance(np.arange(20) / 25, names, dice.uniform(-50, 50, (20, 80)), "shapes")
    encoder = encoder_for(noise, quality=0.02, frames=20)
    packets = [one for row in noise.weights for one in encoder.push(row)] + encoder.finish()
    assert max(map(len, packets)) <= MTU
    assert encoder.told() == ("1 packets were sent coarser than asked, to fit into 1200 bytes",)
    assert len(decode_packets(packets)) == 20


def test_weights_outside_are_clipped_and_told():
    encoder = Encoder(("12", "26"))
    encoder.push([1.5, np.nan])
    encoder.push([0.2, -0.1])
    assert encoder.told() == ("2 weights lie outside 0..1 and were sent as the nearest that does not",)
    rig = Performance([0.0, 0.04], ("wide",), [[-0.7], [1.9]], "shapes")
    assert decode_packets(encode_performance(rig, quality=0.2)).weights[:, 0] == pytest.approx([-0.7, 1.9], abs=0.05)


def test_frame_by_frame():
    encoder, decoder = Encoder(("12",), frames=4, parts=()), Decoder()
    got = [[len(decoder.push(packet)) for packet in encoder.push({"12": k / 10})] for k in range(9)]
    assert got == [[0], [], [], [4], [], [], [], [4], []]       # dictionary first, then a packet for four frames
    rest = [frame for packet in encoder.finish() for frame in decoder.push(packet)]
    assert [frame.number for frame in rest] == [8]
    assert decoder.complete
    assert decoder.finish() == encoder.finish() == []
    with pytest.raises(InputError, match="has ended"):
        encoder.push([0.0])


# -- the way ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("options", SETTINGS[:3], ids=str)
def test_reordered_and_doubled_packets_change_nothing(options):
    packets = encode_performance(lively(), **options)
    clean = decode_packets(packets)
    dice = random.Random(3)
    jumbled = sorted([*enumerate(packets), *((k, one) for k, one in enumerate(packets) if dice.random() < 0.3)],
                     key=lambda one: one[0] + dice.uniform(0, 3))
    again = decode_packets([one for _, one in jumbled])
    assert (again.weights == clean.weights).all()
    assert (again.head == clean.head).all()
    assert "doubled" in again.warnings[0] or "late" in again.warnings[0]
    assert "lost" not in again.warnings[0]


@pytest.mark.parametrize("lost", [[2], [1, 2], [3, 5]])
def test_a_lost_packet_costs_its_own_frames(lost):
    dictionary, motion, end = split(encode_performance(lively(112)))
    clean = decode_packets([*dictionary, *motion, *end])
    again = decode_packets([*dictionary, *(one for k, one in enumerate(motion) if k not in lost), *end])
    assert len(again) == len(clean)
    own = np.isin(np.arange(112) // 16, lost)
    assert (again.weights[~own] == clean.weights[~own]).all()
    first = 16 * lost[0]
    after = next(k for k in range(first, 112) if not own[k])
    line = np.linspace(again.weights[first - 1], again.weights[after], after - first + 2)[1:-1]
    assert again.weights[first:after] == pytest.approx(line)                            # bridged
    assert f"{len(lost)} packet" in again.warnings[0]
    assert "bridged" in again.warnings[0]


def test_packets_that_rest_on_a_lost_one_wait_for_the_next_key():
    dictionary, motion, end = split(encode_performance(lively(100), frames=4, key_every=5))
    clean = decode_packets([*dictionary, *motion, *end])
    decoder = Decoder()
    frames = run(decoder, [*dictionary, *motion[:6], *motion[7:], *end])
    assert (decoder.received.lost, decoder.received.unusable, decoder.received.concealed) == (1, 3, 16)
    assert [frame.number for frame in frames] == list(range(100))
    for frame in frames:
        if not 24 <= frame.number < 40:
            assert not frame.concealed
            assert (frame.weights == clean.weights[frame.number]).all()
        else:
            assert frame.concealed


def test_the_face_holds_still_where_the_end_is_lost():
    dictionary, motion, end = split(encode_performance(lively(64)))
    again = decode_packets([*dictionary, *motion[:3], *end])
    assert len(again) == 64
    assert (again.weights[48:] == again.weights[47]).all()


def test_a_long_gap_is_no_face():
    dictionary, motion, end = split(encode_performance(lively(200)))
    again = decode_packets([*dictionary, *motion[:2], *motion[7:], *end])
    assert CONCEALED < 5 * 16 / 25
    assert not again.found[32:112].any()
    assert again.found[112:].all()
    assert "80 frames missing" in again.warnings[0]


@pytest.mark.parametrize("share", [0.05, 0.2, 0.5])
@pytest.mark.parametrize("options", SETTINGS[:3], ids=str)
def test_a_bad_way_never_costs_more_than_a_bridge(share, options):
    """Loss, doubles and disorder by seed: every frame that has a value is one of the clean ones, or on a line."""
    truth = lively(400, seed=2)
    dictionary, motion, end = split(encode_performance(truth, **options))
    clean = decode_packets([*dictionary, *motion, *end])
    dice = random.Random(7)
    sent = [(k + dice.uniform(0, 2), one) for k, one in enumerate(motion) if dice.random() >= share]
    sent += [(at + dice.uniform(0, 2), one) for at, one in sent if dice.random() < 0.1]
    decoder = Decoder(wait=6)
    frames = run(decoder, [*dictionary, *(one for _, one in sorted(sent)), *end])
    assert [frame.number for frame in frames] == list(range(frames[0].number, frames[0].number + len(frames)))
    low, high = clean.weights.min(axis=0) - 1e-9, clean.weights.max(axis=0) + 1e-9
    for frame in frames:
        if not frame.concealed:
            assert (frame.weights == clean.weights[frame.number]).all()
        elif np.isfinite(frame.weights).all():
            assert ((low <= frame.weights) & (frame.weights <= high)).all()
    assert decoder.received.damaged == 0


def test_who_comes_late_gets_the_dictionary_again():
    encoder = Encoder(NAMES, parts=())
    packets = [packet for row in lively(200).weights for packet in encoder.push(row)]
    decoder = Decoder(wait=2)
    frames = run(decoder, [*packets[5:8], *encoder.introduce(), *packets[8:], *encoder.finish()])
    assert [frame.number for frame in frames] == list(range(64, 200))      # times are the sender's
    assert frames[0].time == pytest.approx(64 / 25)


def test_numbers_go_round():
    encoder = Encoder(("12",), frames=1, parts=())
    encoder._number = 65_530
    packets = [packet for k in range(20) for packet in encoder.push([k / 20])]
    frames = run(Decoder(), packets)
    assert len(frames) == 20
    assert [frame.number for frame in frames] == list(range(65_530, 65_550))


def test_one_packet_of_the_far_future_is_not_believed():
    dictionary, motion, end = split(encode_performance(lively(160)))
    stream = Encoder(NAMES).dictionary.id
    far = Packet(KEY, 30_000, b"").bytes(stream)
    decoder = Decoder()
    frames = run(decoder, [*dictionary, *motion[:4], far, far, *motion[4:], *end])
    assert len(frames) == 160
    assert decoder.received.taken == 10


def test_a_sender_that_begins_anew_goes_on_in_time():
    dictionary, motion, _ = split(encode_performance(lively(280), frames=4))
    decoder = Decoder()
    frames = run(decoder, [*dictionary, *motion, *dictionary, *motion[:10]])
    numbers = [frame.number for frame in frames]
    assert numbers[:280] == list(range(280))
    assert len(numbers) - 280 == 9 * 4            # all but the first, which nothing had confirmed
    assert numbers == sorted(set(numbers))


def test_a_stream_of_another_dictionary_is_foreign():
    mine, other = encode_performance(lively(64)), encode_performance(idle())
    decoder = Decoder()
    frames = run(decoder, [*mine[:3], *other, *mine[3:]])
    assert len(frames) == 64
    assert decoder.received.damaged == len(other)


def test_large_dictionaries_come_in_pieces():
    names = tuple(f"{k:x}{'äöü'[k % 3]}{hash_of(k):x}" for k in range(500))
    encoder = Encoder(names, vocabulary="shapes", parts=())
    pieces = encoder.introduce()
    assert len(pieces) > 3
    assert max(map(len, pieces)) <= MTU
    decoder = Decoder()
    random.Random(1).shuffle(pieces)
    for piece in [*pieces[1:], *pieces]:
        decoder.push(piece)
    assert decoder.dictionary == encoder.dictionary


def hash_of(k):
    return (k * 2_654_435_761_987) % 2**64


# -- hostile ---------------------------------------------------------------------------------------------------------
PACKETS = encode_performance(lively(100), frames=8, key_every=3)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=1400), st.sampled_from(PACKETS),
                          st.tuples(st.sampled_from(PACKETS), st.integers(0, 60)).map(lambda one: one[0][:one[1]]),
                          st.tuples(st.sampled_from(PACKETS), st.integers(0, 60), st.integers(1, 255)).map(
                              lambda one: bytes(b ^ (one[2] if k == one[1] else 0) for k, b in enumerate(one[0])))),
                max_size=40))
def test_no_bytes_break_a_decoder(data):
    decoder = Decoder()
    frames = run(decoder, data)
    numbers = [frame.number for frame in frames]
    assert numbers == sorted(set(numbers))
    assert all(((frame.weights >= 0) & (frame.weights <= 1) | np.isnan(frame.weights)).all() for frame in frames)
    assert all(np.isfinite(frame.head).all() or np.isnan(frame.head).all() for frame in frames)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from([KEY, NEXT, END, DICTIONARY]), st.integers(0, 65_535), st.binary(max_size=300))
def test_no_packet_with_a_right_check_breaks_a_decoder(kind, number, body):
    """As an enemy who knows the stream makes them."""
    decoder = Decoder(wait=0)
    for packet in PACKETS[:4]:
        decoder.push(packet)
    stream = decoder.dictionary.id
    forged = Packet(kind, number, body).bytes(b"" if kind == DICTIONARY else stream)
    frames = decoder.push(forged) + decoder.push(Packet(kind, number + 1, body).bytes(stream))
    assert len(frames) <= 2 * 64 * 8 + 4096
    assert len(decoder.push(PACKETS[4]) + decoder.finish()) <= 3 * 4096


def test_a_widest_packet_of_ones_ends():
    """The most that one packet can ask of a decoder."""
    wide = Dictionary("shapes", tuple(map(str, range(512))), Encoder(("12",)).dictionary.rate, 64, (0,) * 512,
                      bounded=False)
    decoder = Decoder(wait=0)
    decoder.push(Packet(DICTIONARY, 0, wide.id + b"\0\1" + wide.data).bytes(b""))
    for number, body in enumerate((b"\xff" * 1195, b"\x55" * 1195, bytes(range(256)) * 4, b"\x7f\xff" * 590)):
        assert len(decoder.push(Packet(KEY, number, body).bytes(wide.id))) <= 64 * 4
    decoder.finish()


# -- doors -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("options", "message"), [
    ({"names": "12"}, "names: expected several names"),
    ({"names": ("12", "12")}, "each once"),
    ({"names": ("a\nb",)}, "one line"),
    ({"vocabulary": "arkitt"}, "did you mean 'arkit'"),
    ({"fps": 0}, "fps: expected frames a second"),
    ({"fps": 5000}, "fps: expected frames a second"),
    ({"quality": 0}, "quality: expected a number in 0.02"),
    ({"quality": "fine"}, "quality: expected a number"),
    ({"frames": 65}, "frames: expected 1..64"),
    ({"frames": 2.5}, "frames: expected a whole number"),
    ({"key_every": 0}, "key_every: expected packets"),
    ({"parts": ("hed",)}, "did you mean 'head'"),
    ({"steps": {"13": 0.1}}, "there is no '13' among the names"),
    ({"steps": {"12": 0}}, "steps: 12: expected a number"),
])
def test_an_encoder_says_what_is_wrong(options, message):
    with pytest.raises(InputError, match=message):
        Encoder(**{"names": ("12",)} | options)


@pytest.mark.parametrize(("weights", "others", "message"), [
    ([0.1, 0.2], {}, r"weights: expected 1 finite numbers or NaN, got shape \(2,\)"),
    ([np.inf], {}, "weights: expected 1 finite"),
    (["much"], {}, "weights: expected 1 numbers"),
    ({"13": 0.2}, {}, "the stream has no '13'"),
    ([0.1], {"head": [1, 2]}, "head: expected 3 finite"),
])
def test_a_frame_that_does_not_fit_is_refused(weights, others, message):
    with pytest.raises(InputError, match=message):
        Encoder(("12",)).push(weights, **others)


def test_decoder_doors():
    with pytest.raises(InputError, match="wait: expected packets"):
        Decoder(wait=64)
    with pytest.raises(InputError, match="data: expected the bytes"):
        Decoder().push("text")
    with pytest.raises(InputError, match="no dictionary came; received: 2 packets damaged"):
        decode_packets([b"", b"xyz"])
    with pytest.raises(InputError, match="no frame came"):
        decode_packets(PACKETS[:1])
    with pytest.raises(InputError, match="the performance has no place"):
        encode_performance(lively(), parts=("place",))


def test_given_steps_are_kept():
    encoder = Encoder(("26", "12"), steps={"12": 0.125}, parts=())
    assert encoder.dictionary.steps[1] == pytest.approx(0.125, rel=0.05)
    assert encoder.dictionary.steps[1] <= 0.125
