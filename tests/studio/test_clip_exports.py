"""Everything that the timeline saves is read again by the package, and shows what was saved."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

import facegen
from facegen.animation.playback import Playback
from facegen.codec.decoder import Decoder
from facegen.codec.link import read_stream
from facegen.codec.recording import performance_of
from facegen.errors import InputError
from facegen.fileio.sound import read_wav
from facegen.studio import exports, recordings, script_text, timeline
from facegen.studio.exports import FORMS, Wish, export, form_of
from facegen.studio.limits import Limits
from facegen.studio.work import ClipWork

pytestmark = pytest.mark.usefixtures("read_here")

SCRIPT = {"duration": 1.0, "keyframes": [{"t": 0.0, "pose": "0"}, {"t": 0.8, "pose": "6C+12D"}]}
CLIP = timeline.read(SCRIPT)
WISH = Wish("akimoto-1986", (48, 48), 5.0)
QUIET = {"progress": lambda stage, share: None}
RECORDED = [label for label, form in FORMS.items() if form.kind == "recording"]


def saved(label, folder, motion=CLIP, **options):
    return export(motion, form_of(label), folder, "take", WISH, **QUIET, **options)


@pytest.mark.parametrize("label", ["Moving picture (.gif)", "Moving picture (.webp)", "Film (.mp4)"])
def test_films_have_the_frames_that_were_asked_for(tmp_path, label):
    made = saved(label, tmp_path)
    if made.path.suffix == ".mp4":
        av = pytest.importorskip("av")
        with av.open(str(made.path)) as film:
            frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    else:
        with Image.open(made.path) as film:
            frames = [np.asarray(each.convert("RGB")) for each in ImageSequence.Iterator(film)]
    assert len(frames) == 5
    assert frames[0].shape == (48, 48, 3)
    assert np.abs(frames[-1].astype(int) - frames[0]).max() > 40


def test_pictures_are_packed(tmp_path):
    made = saved("Numbered pictures (.zip)", tmp_path)
    with zipfile.ZipFile(made.path) as pack:
        assert pack.namelist() == [f"take/frame_0000{k}.png" for k in range(1, 6)]
        with pack.open("take/frame_00005.png") as file, Image.open(file) as picture:
            assert picture.size == (48, 48)


@pytest.mark.parametrize(("label", "length", "limits", "said"), [
    ("Numbered pictures (.zip)", 600, {}, r"15,000 pictures of 1920 x 1080 are about 8,343 MB, more than a browser"),
    ("Film (.mp4)", 600, {}, r"about 8,343 MB, more than the studio puts on the disk \(4,096\)"),
    ("Moving picture (.gif)", 600, {"export_bytes": 1 << 60}, r"more than the disk has room for \(8,192\)"),
    *((label, 8000, {}, "200000 frames; the limit is 99999") for label in (
        "Film (.webm)", "Animated head (.glb)", "Stream of few bits (.fgp)", RECORDED[0]))])
def test_what_nothing_has_room_for_is_refused_before_it_is_made(tmp_path, monkeypatch, label, length, limits, said):
    monkeypatch.setattr(exports, "LIMITS", Limits(**limits))
    monkeypatch.setattr(exports.shutil, "disk_usage", lambda folder: type("Usage", (), {"free": 1 << 34})())
    motion = timeline.read({**SCRIPT, "duration": length})
    wish = Wish("akimoto", (1920, 1080), 25.0)
    with pytest.raises(InputError, match=said):
        export(motion, form_of(label), tmp_path, "take", wish, lambda stage, share: pytest.fail("it was begun"))
    assert not list(tmp_path.iterdir())
    exports.check_room(timeline.read(SCRIPT), form_of(label), tmp_path, wish)
    exports.check_room(motion, form_of("Clip as text (.yaml)"), tmp_path, wish)


def test_how_large_pictures_are_is_estimated_well(tmp_path):
    """By what is drawn: a larger picture of a face has fewer bytes a pixel."""
    made = export(CLIP, form_of("Numbered pictures (.zip)"), tmp_path, "take", Wish("akimoto-1986", (256, 256), 2.0),
                  **QUIET)
    assert 0.3 < made.path.stat().st_size / (exports._BYTES * 2 * 256 ** 2) < 1.2


def test_what_takes_long_is_stopped(tmp_path):
    """A stop is heard while frames are worked out, not only when they are."""
    def stop(stage, share):
        raise KeyboardInterrupt

    for label in (RECORDED[0], "Stream of few bits (.fgp)", "Numbered pictures (.zip)"):
        with pytest.raises(KeyboardInterrupt):
            export(CLIP, form_of(label), tmp_path, "take", WISH, stop)


def test_an_animated_head_moves_again(tmp_path):
    made = saved("Animated head (.glb)", tmp_path)
    found = facegen.load_performance(made.path)
    assert {"AU12_L", "AU12_R"} <= set(found.names)
    assert found.weights[-1, found.names.index("AU12_L")] > 0.7


@pytest.mark.parametrize("label", RECORDED)
def test_recordings_are_read_again(tmp_path, label):
    made = saved(label, tmp_path)
    found = facegen.load_performance(made.path, format=FORMS[label].name, fps=WISH.fps)
    assert len(found) == 5
    assert np.nanmax(found.weights[-1]) > 0.5
    assert np.nanmax(found.weights[0]) < 0.05


def test_a_stream_is_read_again(tmp_path):
    made = saved("Stream of few bits (.fgp)", tmp_path)
    decoder = Decoder(wait=16)
    with open(made.path, "rb") as file:
        found = performance_of(decoder, list(read_stream(decoder, file)))
    assert np.nanmax(found.weights[-1]) > 0.5
    again = recordings.keep(tmp_path, "take.fgp", made.path.read_bytes(), ClipWork())[1]
    np.testing.assert_array_equal(again.weights, found.weights)


def test_the_text_is_the_clip(tmp_path):
    made = saved("Clip as text (.yaml)", tmp_path, script=SCRIPT)
    assert script_text.read(made.path.read_text()) == SCRIPT
    assert facegen.load_clip(made.path).units_at(0.8) == CLIP.units_at(0.8)


def test_a_voice_is_saved_and_its_absence_said(tmp_path):
    from facegen.animation.espeak import installed

    with pytest.raises(InputError, match="has no sound"):
        saved("Sound (.wav)", tmp_path)
    if not installed():
        pytest.skip("espeak-ng is not installed")
    said = timeline.read({"speech": {"text": "Hello"}})
    made = saved("Sound (.wav)", tmp_path, said)
    np.testing.assert_array_equal(read_wav(made.path).samples, said.sound.samples)
    assert "holds no sound" in saved("Moving picture (.gif)", tmp_path, said).warnings[-1]


def test_a_recording_is_saved_as_recorded(tmp_path):
    recorded = facegen.load_performance(saved("Recording: facegen's own (.csv)", tmp_path).path)
    with pytest.raises(InputError, match="a recording is no script"):
        saved("Clip as text (.yaml)", tmp_path, Playback(recorded))
    again = facegen.load_performance(saved("Recording: facegen's own (.csv)", tmp_path, Playback(recorded)).path)
    np.testing.assert_array_equal(again.weights, recorded.weights)


def test_every_format_that_facegen_writes_can_be_chosen():
    from facegen.animation.streams.files import FORMATS
    from facegen.fileio.video import FORMATS as FILMS

    assert {one.name for one in FORMS.values() if one.kind == "recording"} == {
        one.name for one in FORMATS.values() if one.write is not None} - {"gltf"}
    assert {one.suffix for one in FORMS.values() if one.kind == "film"} == set(FILMS) - {".png"}
    with pytest.raises(InputError, match=r"did you mean 'Film \(.mp4\)'"):
        form_of("Film (.mp3)")


def test_a_recording_is_kept_only_if_it_can_be_read(tmp_path):
    good = saved("Recording: facegen's own (.csv)", tmp_path).path.read_bytes()
    name, found = recordings.keep(tmp_path, "../../my take.csv", good, ClipWork())
    assert name == "my_take.csv"
    assert [each.name for each in (tmp_path / recordings.FOLDER).iterdir()] == [name]
    np.testing.assert_array_equal(recordings.load(tmp_path, ClipWork(recording=name)).weights, found.weights)
    with pytest.raises(facegen.FacegenError, match=r"my_take.csv: "):
        recordings.keep(tmp_path, "my take.csv", b"a,b\n1,2\n", ClipWork())
    assert (tmp_path / recordings.FOLDER / name).read_bytes() == good
    assert recordings.keep(tmp_path, "my take.csv", good, ClipWork())[0] == name
    assert recordings.keep(tmp_path, "my take.csv", good + b"\n", ClipWork())[0] == "my_take-2.csv"
    assert (tmp_path / recordings.FOLDER / name).read_bytes() == good, "who undoes has the first again"
    assert recordings.keep(tmp_path, "cat.csv", good, ClipWork())[0] == "cat.csv", "an avatar's name is no bar"
    for wrong in ("take.exe", "take", "..", "a/.csv/.."):
        with pytest.raises(InputError, match="expected a recording that ends in"):
            recordings.keep(tmp_path, wrong, good, ClipWork())
    (tmp_path / recordings.FOLDER / name).unlink()
    with pytest.raises(facegen.FileError, match="open it again"):
        recordings.load(tmp_path, ClipWork(recording=name))


def test_a_long_recording_is_cleaned_where_it_is_read(tmp_path, monkeypatch):
    """It takes seconds, and nobody could stop it here; what comes of it is the same."""
    from facegen.studio import reading

    text = "time,jawOpen\n" + "".join(f"{k / 10},{0.2 + 0.5 * (k % 3)}\n" for k in range(30))
    name, plain = recordings.keep(tmp_path, "take.csv", text.encode(), ClipWork())
    work = ClipWork(recording=name, calibrate="0-1", smooth="on")
    here = recordings.load(tmp_path, work)
    monkeypatch.setattr(recordings, "_QUICK", 10)
    monkeypatch.setattr(recordings, "cleaned", lambda *_, **__: pytest.fail("it was cleaned here"))
    asked = []
    ask = reading.ask
    monkeypatch.setattr(reading, "ask", lambda *args: asked.append(args[0]) or ask(*args))
    for _ in range(2):
        np.testing.assert_array_equal(recordings.load(tmp_path, work).weights, here.weights)
    assert np.abs(here.weights - plain.weights).max() > 0.1
    assert asked == ["recording"]


def test_too_large_a_recording_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(recordings, "LIMITS", Limits(file_bytes=100))
    with pytest.raises(InputError, match="the studio takes up to"):
        recordings.keep(tmp_path, "take.csv", b"x" * 101, ClipWork())
    assert not Path(tmp_path / recordings.FOLDER).exists()
