"""A face driven live: the same vertices and pictures as the slow way, and every wrong frame named."""

from __future__ import annotations

import numpy as np
import pytest

import facegen
from facegen.animation.playback import Playback
from facegen.animation.streams import OneEuro, smoothed
from facegen.blendshapes.recipes import shape_set

NAMES = ("jawOpen", "mouthSmileLeft", "eyeBlinkRight")


@pytest.fixture(scope="module")
def face():
    return facegen.load_face()


def test_units_are_the_faces_pose(face):
    weights = {"12": 0.7, "L1": 0.4, "26": 0.3}
    live = facegen.Live(face, "units", names=tuple(weights), detail=1)
    np.testing.assert_allclose(live.vertices(weights), face.pose(weights, detail=1), atol=1e-9)
    assert live.mesh is face.mesh(1)


def test_a_mapping_an_array_and_a_recording_agree(rig_file):
    rng = np.random.default_rng(0)
    weights = rng.uniform(0, 1, (3, 3))
    take = Playback(facegen.Performance([0, 0.1, 0.2], NAMES, weights, "arkit", head=np.tile([9.0, 2, 1], (3, 1))))
    live = facegen.Live(rig_file("units"), names=NAMES)
    pose = take.shown.on(facegen.load_face(rig_file("units")))
    for k in range(3):
        expected = pose(take.cue(k / 10))
        np.testing.assert_array_equal(live.vertices(weights[k], head=(9, 2, 1)), expected)
        np.testing.assert_array_equal(live.vertices(dict(zip(NAMES, weights[k], strict=True)), head=[9, 2, 1]),
                                      expected)


def test_a_picture(face):
    live = facegen.Live(face, "arkit", size=48, renderer="soft", background=(10, 20, 30))
    assert live.names == tuple(shape_set("arkit"))
    frame = {"jawOpen": 0.8, "mouthSmileLeft": 1.0}
    pixels = live.draw(frame, gaze=(10, 0, 10, 0))
    renderer = facegen.Renderer(face, size=48, renderer="soft", background=(10, 20, 30), occlusion="neutral")
    np.testing.assert_array_equal(pixels, renderer.draw(live.vertices(frame, gaze=(10, 0, 10, 0))))
    assert np.abs(pixels.astype(int) - live.draw({})).max() > 30


def test_one_frame_leaves_nothing_behind(face):
    live = facegen.Live(face, names=NAMES, detail=0)
    first = live.vertices([0.2, 0.3, 0.4])
    live.vertices([1.0, 1.0, 1.0], head=(20, 0, 0))
    np.testing.assert_array_equal(live.vertices([0.2, 0.3, 0.4]), first)
    first[:] = 0
    assert live.vertices([0, 0, 0]).any()
    np.testing.assert_array_equal(live.vertices({}), face.mesh(0).vertices)


def test_what_was_not_seen_stays(face):
    live = facegen.Live(face, names=NAMES, detail=0)
    whole = live.vertices([0.2, 0.6, 0.4], head=(10, 5, 0))
    np.testing.assert_array_equal(live.vertices([0.2, np.nan, np.nan], head=(np.nan, 5, 0)), whole)
    np.testing.assert_array_equal(live.vertices({"jawOpen": 0.2, "mouthSmileLeft": np.nan, "eyeBlinkRight": 0.4},
                                                head=[np.nan] * 3), whole)


def test_smoothing_is_that_of_recordings(face):
    rng = np.random.default_rng(1)
    times, weights, head = np.arange(9) / 30, rng.uniform(0, 1, (9, 3)), rng.uniform(-9, 9, (9, 3))
    calm = smoothed(facegen.Performance(times, NAMES, weights, "arkit", head=head), OneEuro(1.0, 0.5))
    live, plain = (facegen.Live(face, names=NAMES, detail=0, smooth=one) for one in ("1,0.5", None))
    for k, t in enumerate(times):
        made = live.vertices(weights[k], head=head[k], time=t)
        np.testing.assert_allclose(made, plain.vertices(calm.weights[k], head=calm.head[k]), atol=1e-9)
    assert facegen.Live(face, names=NAMES, detail=0, smooth=True).vertices([0.1, 0.1, 0.1]).any()


def test_a_smoothing_of_your_own(face):
    seen = []

    def half(seconds, weights):
        seen.append(seconds)
        return weights / 2

    live = facegen.Live(face, names=NAMES, detail=0, smooth=half)
    np.testing.assert_array_equal(live.vertices([0.4, 0.8, 0.2], time=3.0),
                                  facegen.Live(face, names=NAMES, detail=0).vertices([0.2, 0.4, 0.1]))
    assert seen == [3.0]
    with pytest.raises(facegen.InputError, match=r"smooth: expected shape \(3,\), got \(2,\)"):
        facegen.Live(face, names=NAMES, detail=0, smooth=lambda t, w: w[:2]).vertices([0, 0, 0])


def test_an_avatars_own_shapes(rig_file):
    live = facegen.Live(rig_file("arkit"), "shapes")
    avatar = facegen.load_face(rig_file("arkit"))
    assert live.names == avatar.shapes
    np.testing.assert_array_equal(live.vertices({"jawOpen": 1.3}), avatar.pose_shapes({"jawOpen": 1.3}))


@pytest.mark.parametrize(("frame", "more", "words"), [
    ({"jawOpn": 1.0}, {}, r"'jawOpn' is not among the names; did you mean 'jawOpen'"),
    ({"jawOpen": "wide"}, {}, "weights: jawOpen: expected a finite number or NaN, got 'wide'"),
    ({"jawOpen": np.inf}, {}, "weights: jawOpen"), ({"jawOpen": True}, {}, "weights: jawOpen"),
    ([1.0, 2.0], {}, r"weights: expected shape \(3,\), got \(2,\)"), ("jawOpen", {}, "weights: expected 3 numbers"),
    ([1.0, 2.0, np.inf], {}, "weights: expected finite numbers or NaN"),
    ({}, {"head": (1, 2)}, r"head: expected shape \(3,\)"), ({}, {"gaze": [1, 2, 3]}, r"gaze: expected shape \(4,\)"),
    ({}, {"head": "left"}, "head: expected 3 numbers, got str"),
])
def test_wrong_frames(face, frame, more, words):
    live = facegen.Live(face, names=NAMES, detail=0)
    with pytest.raises(facegen.InputError, match=words):
        live.vertices(frame, **more)


@pytest.mark.parametrize(("how", "words"), [
    ({"rig": "akimoti"}, "did you mean 'akimoto'"), ({"rig": 3}, "face: expected a name or a path"),
    ({"vocabulary": "arkitt"}, "did you mean 'arkit'"), ({"names": ["foo"]}, "can show none of the 1 shapes: foo"),
    ({"vocabulary": "shapes"}, "names: expected the shapes"), ({"smooth": "much"}, "smooth: expected on, CUTOFF"),
    ({"background": "plain"}, "background: is for pictures"), ({"size": 3}, "size: expected pixels"),
    ({"detail": 9}, "detail: expected a subdivision level"),
])
def test_wrong_wishes(how, words):
    with pytest.raises(facegen.InputError, match=words):
        facegen.Live(**how)


def test_pictures_need_a_size(face):
    with pytest.raises(facegen.InputError, match="size: expected pixels when Live was made"):
        facegen.Live(face, names=NAMES, detail=0).draw([0, 0, 0])
