"""Clips and recordings as animations in glTF files: read and played again, they show what was meant."""

from __future__ import annotations

import numpy as np
import pytest

import facegen
from facegen.animation.performance import Performance
from facegen.animation.playback import Playback
from facegen.animation.streams.gltf import read_gltf_performance, vocabulary_of
from facegen.blendshapes.recipes import shape_set
from facegen.face.face import load_face
from facegen.jobs.animated import save_animation
from facegen.jobs.frames import save_clip

T = np.arange(12) / 10
HEAD = np.stack([40 * np.sin(5 * T), 10 * np.cos(3 * T), 6 * T], axis=1)
NAMES = ("jawOpen", "mouthSmileLeft", "eyeBlinkRight", "mouthClose", "browInnerUp")


def recorded(names=NAMES, vocabulary="arkit", seed=0, **more):
    weights = np.random.default_rng(seed).uniform(0, 1, (len(T), len(names)))
    if "mouthClose" in names:           # lips close no farther than the jaw opens
        weights[:, names.index("mouthClose")] *= weights[:, names.index("jawOpen")]
    return Performance(T + 100.0, names, weights, vocabulary, **{"head": HEAD, **more})


def test_an_avatars_own_shapes_come_back_as_they_were(tmp_path, rig_file):
    take = recorded()
    assert save_clip(take, tmp_path / "take.glb", face=rig_file("arkit")).made == len(take)
    back = read_gltf_performance(tmp_path / "take.glb")
    assert (back.vocabulary, back.about["animation"]) == ("arkit", "take")
    assert set(back.names) == set(shape_set("arkit"))
    np.testing.assert_allclose(back.times, T, atol=1e-6)
    for name in NAMES:
        np.testing.assert_allclose(back.column(name), take.column(name), atol=1e-7)
    assert not back.column("tongueOut").any()
    np.testing.assert_allclose(back.head, np.clip(HEAD, [-30, -20, -20], [30, 20, 20]), atol=1e-4)


@pytest.mark.parametrize("sets", ["arkit", "units"])
def test_the_file_shows_what_a_film_shows(tmp_path, rig_file, sets):
    rig, take = load_face(rig_file(sets)), Playback(recorded(gaze=np.tile([9.0, -4, 9, -4], (len(T), 1))))
    save_animation(take, tmp_path / "take.glb", face=rig_file(sets))
    again = Playback(read_gltf_performance(tmp_path / "take.glb"))
    played = load_face(tmp_path / "take.glb")
    meant, shown = take.shown.on(rig), again.shown.on(played)
    np.testing.assert_allclose(played.mesh().vertices, rig.mesh().vertices, atol=1e-4)
    for t in (0.0, 0.35, 1.1):
        np.testing.assert_allclose(shown(again.cue(t)), meant(take.cue(t)), atol=2e-3)


def off(face, take, path, t):
    """Return how far the file is from the face, as a share of the movement, over the face's own vertices."""
    played, again = load_face(path), Playback(read_gltf_performance(path))
    meant, shown = take.shown.on(face, detail=1)(take.cue(t)), again.shown.on(played)(again.cue(t))
    rest = face.mesh(1).vertices
    rows = np.array([np.linalg.norm(rest - one, axis=1).argmin() for one in played.mesh().vertices[::40]])
    moved = np.linalg.norm((meant - rest)[rows])
    return np.linalg.norm(shown[::40] - played.mesh().vertices[::40] - (meant - rest)[rows]) / moved


@pytest.mark.parametrize(("names", "vocabulary"), [
    (NAMES, "arkit"), (("12", "L1", "25", "26", "45"), "units"), (("jaw_open", "EyeBlinkLeft"), "shapes"),
    (("aa", "happy"), "vrm"), (("AU12_L", "AU26"), "shapes")])
def test_the_parametric_face_gets_a_file_of_its_own(tmp_path, names, vocabulary):
    face, take = load_face(), Playback(recorded(names, vocabulary, seed=2))
    made = save_animation(take, tmp_path / "take.glb", detail=1)
    assert made.warnings == ()
    assert made.keys == len(T)
    for t in (0.0, 0.6):
        assert off(face, take, tmp_path / "take.glb", t) < 0.12


def test_the_gaze_becomes_glances(tmp_path):
    take = Playback(recorded(("jawOpen",), head=None, gaze=np.tile([12.5, 10.0, 12.5, -12.5], (len(T), 1))))
    save_animation(take, tmp_path / "take.glb", face="akimoto", detail=0)
    back = read_gltf_performance(tmp_path / "take.glb")
    assert back.head is None
    found = {name: back.column(name)[0] for name in back.names if name.startswith("eyeLook")}
    assert {name: weight for name, weight in found.items() if weight} == pytest.approx(
        {"eyeLookOutLeft": 0.5, "eyeLookInRight": 0.5, "eyeLookUpLeft": 0.5, "eyeLookDownRight": 0.5}, abs=1e-6)


def test_a_clip(tmp_path):
    face = load_face()
    smile = {"t": 0.5, "pose": "6C+12D+26B", "head": {"yaw": 20}}
    clip = facegen.load_clip({"keyframes": [{"t": 0, "pose": "0"}, smile, {"t": 1, "pose": "1+2+5"}]})
    made = save_animation(clip, tmp_path / "clip.glb", fps=8)
    assert (made.keys, made.warnings) == (8, ())
    assert {"AU12_L", "AU26", "AU5_R"} <= set(made.names)
    played = load_face(tmp_path / "clip.glb")
    back = Playback(read_gltf_performance(tmp_path / "clip.glb"))
    rest, pose = played.mesh().vertices, back.shown.on(played)
    for t in (0.25, 0.5, 0.75):
        meant = played.pose(clip.at(t))
        np.testing.assert_allclose(pose(back.cue(t)), meant, atol=1e-3)
        far = np.linalg.norm(face.pose(clip.at(t)) - face.mesh().vertices, axis=1).max()
        assert np.linalg.norm(meant - rest, axis=1).max() == pytest.approx(far, rel=0.1)


def test_a_clip_on_an_avatar(tmp_path, rig_file):
    avatar = load_face(rig_file("units"))
    clip = facegen.morph("0", "happiness", seconds=0.5, hold=0.0)
    assert save_clip(clip, tmp_path / "clip.glb", face=rig_file("units"), fps=10).made == 5
    back = Playback(read_gltf_performance(tmp_path / "clip.glb"))
    np.testing.assert_allclose(back.shown.on(avatar)(back.cue(0.3)), avatar.pose(clip.at(0.3)), atol=1e-3)


def test_raw_data_and_still_clips(tmp_path):
    raw = facegen.morph("0", {"jaw": {"open": 9}}, seconds=0.2, hold=0.0)
    save_animation(raw, tmp_path / "raw.glb", detail=0)
    assert read_gltf_performance(tmp_path / "raw.glb").weights.max() > 0.2
    still = facegen.load_clip({"keyframes": [{"t": 0, "pose": "0"}, {"t": 1, "pose": "0"}]})
    assert save_animation(still, tmp_path / "still.glb", detail=0, fps=2).keys == 2
    assert not read_gltf_performance(tmp_path / "still.glb").weights.any()


def test_vocabularies():
    assert vocabulary_of(("jawOpen", "tongueOut")) == "arkit"
    assert vocabulary_of(("viseme_PP",)) == "visemes"
    assert vocabulary_of(("jawOpen", "viseme_PP")) == vocabulary_of(("AU12_L",)) == "shapes"


@pytest.mark.parametrize(("path", "words"), [("no/a.glb", "does not exist"), ("a.glb", "can show none")])
def test_nothing_is_written_for_wrong_wishes(tmp_path, path, words):
    (tmp_path / "a.glb").write_bytes(b"precious")
    alien = Performance([0.0, 1.0], ("gills",), np.zeros((2, 1)), "shapes")
    with pytest.raises(facegen.InputError, match=words):
        save_clip(alien, tmp_path / path)
    assert (tmp_path / "a.glb").read_bytes() == b"precious"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_head_that_cannot_turn(tmp_path, rig_file):
    made = save_animation(Playback(recorded()), tmp_path / "a.glb", face=rig_file("arkit", notes=False))
    assert made.warnings == ("arkit.glb has no joint that turns its head, and none can be added, so the head does not "
                             "turn in the file",)


def test_a_head_alone(tmp_path, rig_file):
    take = Performance(T, (), np.zeros((len(T), 0)), "arkit", head=HEAD)
    for face in ("akimoto", rig_file("units")):
        save_animation(Playback(take), tmp_path / "a.glb", face=face, detail=0)
        assert np.abs(read_gltf_performance(tmp_path / "a.glb").head).max() == pytest.approx(30, abs=1e-3)
    save_clip(take, tmp_path / "frames", face="akimoto-1986", fps=2, size=32, detail=0, renderer="soft")
    assert len(list((tmp_path / "frames").glob("*.png"))) == 2
