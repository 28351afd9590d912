"""Clips as films: the frames that the clip says, resumed, the same whoever draws them."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

import facegen
from facegen.animation.clip import Clip
from facegen.jobs import frames as module
from facegen.jobs.frames import STAMP, save_clip, save_turn

QUICK = {"size": 32, "face": "akimoto-1986", "detail": 0, "renderer": "soft"}
SCRIPT = {"keyframes": [{"t": 0, "pose": "0"}, {"t": 0.4, "pose": "happiness"}], "idle": 1}
CLIP = facegen.load_clip(SCRIPT)


def drawn(monkeypatch):
    """Return a list that grows with the index of every frame that is drawn here."""
    found = []
    make = module.FrameTask.make

    def noted(task):
        found.append(task.index)
        make(task)

    monkeypatch.setattr(module.FrameTask, "make", noted)
    return found


def test_a_folder_of_frames(tmp_path):
    out = tmp_path / "frames"
    steps = []
    report = save_clip(CLIP, out, fps=10, step=lambda: steps.append(1), **QUICK)
    assert (report.made, report.kept, len(steps)) == (4, 0, 4)
    assert sorted(p.name for p in out.iterdir()) == [STAMP, *(f"frame_0000{k}.png" for k in range(1, 5))]
    face = facegen.load_face("akimoto-1986")
    renderer = facegen.Renderer(face, size=32, detail=0, renderer="soft")
    for k in range(4):
        with Image.open(out / f"frame_0000{k + 1}.png") as picture:
            np.testing.assert_array_equal(np.asarray(picture), renderer.draw(CLIP.at(k / 10))[..., :3])


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif", ".webp", ".apng"])
def test_a_film(tmp_path, suffix):
    out = tmp_path / f"a{suffix}"
    assert save_clip(CLIP, out, fps=10, **QUICK).made == 4
    assert list(tmp_path.iterdir()) == [out]                    # the work folder is gone
    if suffix in (".mp4", ".webm"):
        import av

        with av.open(str(out)) as film:
            assert sum(1 for _ in film.decode(video=0)) == 4
    else:
        with Image.open(out) as film:
            assert film.n_frames == 4


def test_the_same_bytes_whatever_the_workers(tmp_path):
    for workers in (1, 2):
        save_clip(CLIP, tmp_path / str(workers), fps=15, workers=workers, **QUICK)
    for one in (tmp_path / "1").glob("*.png"):
        assert one.read_bytes() == (tmp_path / "2" / one.name).read_bytes()


def test_a_stopped_run_goes_on(tmp_path, monkeypatch):
    out, seen = tmp_path / "a.gif", []

    def stop():
        seen.append(1)
        if len(seen) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        save_clip(CLIP, out, fps=10, step=stop, **QUICK)
    assert not out.exists()
    again = drawn(monkeypatch)
    report = save_clip(CLIP, out, fps=10, **QUICK)
    assert again == [2, 3]
    assert (report.made, report.kept) == (2, 2)
    whole = tmp_path / "b.gif"
    save_clip(CLIP, whole, fps=10, **QUICK)
    assert out.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("change", [
    {"size": 40}, {"view": (10, 0)}, {"background": (1, 2, 3)}, {"fps": 5}, {"face": "akimoto"},
    {"clip": facegen.load_clip(SCRIPT, idle=2)}, {"clip": facegen.morph("0", "happiness", seconds=0.4, hold=0)},
])
def test_frames_of_another_film_are_never_kept(tmp_path, monkeypatch, change):
    out = tmp_path / "frames"
    save_clip(CLIP, out, fps=10, **QUICK)
    before = (out / STAMP).read_text()
    again = drawn(monkeypatch)
    save_clip(**{"clip": CLIP, "path": out, "fps": 10, **QUICK, **change})
    assert len(again) == len(list(out.glob("frame_*.png"))) == json.loads((out / STAMP).read_text())["frames"]
    assert (out / STAMP).read_text() != before


def test_other_tables_or_another_mesh_make_other_frames(monkeypatch, tmp_path):
    import shutil

    from facegen.data import meshes_dir

    shot = module.Shot(CLIP, 10.0, 4, "akimoto-1986", 0, "plain", "soft", ())
    same = module.Shot(CLIP, 10.0, 4, "akimoto-1986", 0, "plain", "soft", ())
    assert shot.fingerprint == same.fingerprint
    shutil.copytree(meshes_dir() / "akimoto-1986", tmp_path / "face")
    own = module.Shot(CLIP, 10.0, 4, str(tmp_path / "face"), 0, "plain", "soft", ()).fingerprint
    with (tmp_path / "face" / "face.yaml").open("a") as file:
        file.write("# changed\n")
    changed = module.Shot(CLIP, 10.0, 4, str(tmp_path / "face"), 0, "plain", "soft", ()).fingerprint
    assert len({shot.fingerprint, own, changed}) == 3
    monkeypatch.setattr(module, "__version__", "0.0.0")
    assert module.Shot(CLIP, 10.0, 4, "akimoto-1986", 0, "plain", "soft", ()).fingerprint != shot.fingerprint


def test_somebody_elses_frames_are_left_alone(tmp_path):
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "frame_00001.png").write_bytes(b"precious")
    with pytest.raises(facegen.FileError, match="did not make"):
        save_clip(CLIP, tmp_path / "frames", fps=10, **QUICK)
    assert (tmp_path / "frames" / "frame_00001.png").read_bytes() == b"precious"


def test_a_full_disk_while_drawing(tmp_path, monkeypatch):
    out = tmp_path / "a.gif"
    out.write_bytes(b"precious")
    save, saved = Image.Image.save, []

    def full(image, file, *args, **options):
        saved.append(1)
        if len(saved) > 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        save(image, file, *args, **options)

    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises(facegen.FileError, match="No space left"):
        save_clip(CLIP, out, fps=10, **QUICK)
    assert out.read_bytes() == b"precious"
    assert sorted(p.name for p in (tmp_path / ".a.gif.frames").iterdir()) == [STAMP, "frame_00001.png",
                                                                              "frame_00002.png"]
    monkeypatch.setattr(Image.Image, "save", save)
    assert save_clip(CLIP, out, fps=10, **QUICK).kept == 2
    assert list(tmp_path.iterdir()) == [out]


def test_the_camera_stands_still_and_shows_all(tmp_path):
    clip = facegen.load_clip({"keyframes": [{"t": 0, "head": {"roll": 20}}, {"t": 1, "head": {"roll": -20}}]})
    save_clip(clip, tmp_path / "frames", fps=10, background=(255, 0, 255), **{**QUICK, "size": 96})
    for path in (tmp_path / "frames").glob("frame_*.png"):
        with Image.open(path) as picture:
            pixels = np.asarray(picture)
        edge = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
        assert (edge == [255, 0, 255]).all(), path.name


def test_a_turn(tmp_path):
    assert save_turn("happiness", tmp_path / "turn", seconds=0.8, fps=10, **QUICK).made == 8
    pictures = [np.asarray(Image.open(p)).astype(int) for p in sorted((tmp_path / "turn").glob("frame_*.png"))]
    np.testing.assert_allclose(pictures[2].mean(), pictures[6][:, ::-1].mean(), atol=2)     # left and right
    assert np.abs(pictures[0] - pictures[4]).mean() > 5                                     # front and back
    save_turn("happiness", tmp_path / "swing", seconds=0.8, fps=10, turn=(-40, 40), **QUICK)
    swing = [np.asarray(Image.open(p)) for p in sorted((tmp_path / "swing").glob("frame_*.png"))]
    for k in range(1, 4):
        np.testing.assert_array_equal(swing[k], swing[8 - k])


@pytest.mark.parametrize(("change", "words"), [
    ({"path": "a.avi"}, "expected a name that ends in"), ({"path": "no/a.gif"}, "does not exist"),
    ({"path": "no/frames"}, "does not exist"), ({"path": "file"}, "is a file"),
    ({"path": "a.mp4", "size": 33}, "34x34"), ({"path": "a.gif", "fps": 60}, "0.1..50"),
    ({"size": 0}, "size"), ({"size": 100_000}, "size"), ({"view": (0, 120)}, "view"), ({"fps": 0}, "fps"),
    ({"face": "akimoti"}, "did you mean 'akimoto'"), ({"face": 3}, "face: expected a name or a path"),
    ({"detail": 9}, "detail"), ({"background": "blueish"}, "background"), ({"renderer": "sotf"}, "did you mean 'soft'"),
    ({"clip": "happiness"}, "clip: expected a Clip"), ({"workers": 0}, "workers"),
    ({"clip": Clip(CLIP.tracks, 86_400.0)}, "99999"),
    ({"clip": facegen.morph("0", {"points": {"mouth_corner_left": [0, 1, 0]}})}, "no feature point"),
])
def test_wrong_wishes_are_told_before_work(tmp_path, monkeypatch, change, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("precious")
    started = drawn(monkeypatch)
    with pytest.raises(facegen.InputError) as caught:
        save_clip(**{"clip": CLIP, "path": "a.gif", "fps": 10, **QUICK, **change})
    assert words in str(caught.value)
    assert not started
    assert not list(tmp_path.glob("**/*.png"))
    assert (tmp_path / "file").read_text() == "precious"


@pytest.mark.parametrize(("change", "words"), [
    ({"seconds": 0}, "duration"), ({"seconds": 1e9}, "duration"), ({"turn": (0,)}, "turn"),
    ({"turn": ("a", 2)}, "turn"), ({"turn": (0, 900)}, "yaw"), ({"pitch": 91}, "pitch"),
    ({"what": "hapiness"}, "did you mean"),
])
def test_wrong_turns(tmp_path, change, words):
    with pytest.raises(facegen.InputError, match=words):
        save_turn(**{"what": "happiness", "path": tmp_path / "a.gif", **QUICK, **change})
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written(tmp_path, monkeypatch):
    def refused(path, *_, **__):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr("pathlib.Path.mkdir", refused)
    started = drawn(monkeypatch)
    with pytest.raises(facegen.FileError, match="Permission denied"):
        save_clip(CLIP, tmp_path / "a.gif", fps=10, **QUICK)
    assert not started


def test_killed_in_mid_run_it_goes_on(tmp_path):
    script = tmp_path / "clip.yaml"
    script.write_text("duration: 8\nidle: 3\n")
    out = tmp_path / "a.apng"
    argv = [sys.executable, "-m", "facegen", "animate", str(script), "-o", str(out), "--face", "akimoto-1986", "--size",
            "32", "--fps", "5", "--workers", "2", "--renderer", "soft"]
    work = tmp_path / ".a.apng.frames"
    run = subprocess.Popen(argv, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while len(list(work.glob("frame_*.png"))) < 5 and time.monotonic() < deadline and run.poll() is None:
        time.sleep(0.02)
    os.kill(run.pid, signal.SIGKILL)
    run.wait()
    before = len(list(work.glob("frame_*.png")))
    assert 5 <= before < 40
    assert not out.exists()
    done = subprocess.run([*argv, "--json"], capture_output=True, text=True, timeout=120, check=True)
    told = json.loads(done.stdout)
    assert told["made"] + told["kept"] == told["frames"] == 40
    assert told["kept"] >= before
    assert sorted(tmp_path.iterdir()) == [out, script]
    with Image.open(out) as film:
        assert film.n_frames > 20


def test_a_folder_with_a_films_name(tmp_path):
    (tmp_path / "film.mp4").mkdir()
    with pytest.raises(facegen.FileError, match=r"film\.mp4: is a folder, expected a file"):
        save_clip(facegen.morph("0", "12"), tmp_path / "film.mp4", size=32, fps=2)
    assert not list((tmp_path / "film.mp4").iterdir())


def recorded(seconds=0.4):
    """Return a smile with a turn of the head and a gap, as a camera might have seen it."""
    t = np.arange(round(seconds * 30)) / 30
    weights = np.stack([t / t[-1], np.where((t > 0.1) & (t < 0.2), np.nan, 0.3)], axis=1)
    return facegen.Performance(t + 7.0, ("mouthSmileLeft", "jawOpen"), weights, "arkit",
                               head=np.stack([40 * t, 0 * t, 0 * t], axis=1))


def test_a_recording(tmp_path, monkeypatch):
    from facegen.animation.playback import Playback

    out, play = tmp_path / "frames", Playback(recorded())
    assert save_clip(recorded(), out, fps=10, **QUICK).made == 4
    face = facegen.load_face("akimoto-1986")
    renderer = facegen.Renderer(face, size=32, detail=0, renderer="soft")
    pose = play.shown.on(face, detail=0)
    drawn_before = []
    for k, path in enumerate(sorted(out.glob("frame_*.png"))):
        with Image.open(path) as picture:
            drawn_before.append(np.asarray(picture))
        assert drawn_before[-1].shape == (32, 32, 3)
        assert np.isfinite(renderer.draw(pose(play.cue(k / 10)))).all()
    assert np.abs(drawn_before[0].astype(int) - drawn_before[3]).max() > 20
    again = drawn(monkeypatch)
    assert save_clip(play, out, fps=10, **QUICK).kept == 4
    assert not again
    assert save_clip(Playback(recorded(), bridge=0.0), out, fps=10, **QUICK).kept == 4    # a level gap
    other = facegen.Performance(play.moments, ("mouthSmileLeft",), play.filled.weights[:, :1] * 0.9, "arkit")
    assert save_clip(other, out, fps=10, **QUICK).made == 4


def test_a_recording_on_an_avatar_over_workers(tmp_path, rig_file):
    for workers in (1, 2):
        save_clip(recorded(0.2), tmp_path / str(workers), fps=10, workers=workers,
                  **{**QUICK, "face": rig_file("arkit")})
    names = sorted(path.name for path in (tmp_path / "1").glob("*.png"))
    assert len(names) == 2
    for name in names:
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()


def test_a_recording_that_the_face_cannot_show(tmp_path):
    alien = facegen.Performance([0.0, 0.1], ("gills",), np.zeros((2, 1)), "shapes")
    with pytest.raises(facegen.InputError, match="can show none of the 1 shapes: gills"):
        save_clip(alien, tmp_path / "a.gif", fps=10, **QUICK)
    assert not list(tmp_path.iterdir())
