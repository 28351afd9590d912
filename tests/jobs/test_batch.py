"""A data set: its pictures, its labels, and what happens when it is stopped, stale or somebody else's."""

from __future__ import annotations

import csv
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
from facegen.errors import FileError, InputError
from facegen.jobs import batch as batch_module
from facegen.jobs import digests, picture
from facegen.jobs.batch import run_batch


def labels(folder):
    return [json.loads(line) for line in (folder / "pictures.jsonl").read_text(encoding="utf-8").splitlines()]


def times(folder):
    return {path.name: path.stat().st_mtime_ns for path in (folder / "images").iterdir()}


def test_every_combination_once(serial):
    found = labels(serial)
    assert len(found) == 12
    assert len({(one["pose"]["said"], tuple(one["view"]), one["person"]) for one in found}) == 12
    files = {path.relative_to(serial).as_posix() for path in serial.rglob("*") if path.is_file()}
    assert files == {"manifest.json", "pictures.jsonl", "pictures.csv", "batch.json",
                     *(one["file"] for one in found), *(f"labels/{one['name']}.json" for one in found)}
    with open(serial / "pictures.csv", encoding="utf-8", newline="") as table:
        rows = list(csv.DictReader(table))
    assert [row["file"] for row in rows] == [one["file"] for one in found]
    assert rows[0]["pose"] == "happiness"
    assert rows[0]["units"] == found[0]["pose"]["script"]


def test_a_picture_is_what_render_draws(serial):
    one = next(one for one in labels(serial) if one["name"] == "happiness_mika_y+30p0")
    with Image.open(serial / one["file"]) as file:
        pixels = np.asarray(file)
    expected = facegen.render(facegen.load_face(), "happiness", person="mika", view=(30, 0), size=48, detail=0,
                              renderer="soft")
    np.testing.assert_array_equal(pixels, expected[..., :3])


def test_labels_say_what_the_pose_is(serial):
    by_name = {one["name"]: one for one in labels(serial)}
    smile = by_name["6C+12D_y0p0"]["pose"]
    assert (smile["kind"], smile["units"], smile["script"]) == ("units", {"6": 0.5, "12": 0.8}, "6C+12D")
    raw = next(one for name, one in by_name.items() if "figure-8" in name)["pose"]
    assert raw["kind"] == "deformation"
    preset = facegen.resolve("akimoto-1986-figure-8").deformation
    assert raw["deformation"] == json.loads(json.dumps(preset.as_dict()))
    assert "units" not in raw


@pytest.mark.parametrize("orthographic", [False, True])
def test_camera_matrices_project_the_landmarks(tmp_path, orthographic):
    run_batch({"poses": ["27E", "57E+12D"], "views": [[-35, 12]], "sizes": ["80x64"], "orthographic": orthographic,
               "renderer": "soft", "detail": 1, "feature_points": True}, tmp_path / "set", workers=1)
    face = facegen.load_face()
    for one in labels(tmp_path / "set"):
        places = face.landmark_points(face.pose(one["pose"]["units"], detail=one["detail"]), detail=one["detail"])
        assert set(one["landmarks"]) == set(face.landmarks)
        assert set(one["feature_points"]) == set(face.feature_points)
        extrinsics, intrinsics = (np.array(one["camera"][key]) for key in ("extrinsics", "intrinsics"))
        np.testing.assert_allclose(extrinsics[:, :3] @ extrinsics[:, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(extrinsics[:, :3]) == pytest.approx(1.0)
        assert one["camera"]["projection"] == ("orthographic" if orthographic else "perspective")
        for points in (one["landmarks"], one["feature_points"]):
            xyz = np.array([p["xyz"] for p in points.values()])
            local = np.column_stack([xyz, np.ones(len(xyz))]) @ extrinsics.T
            depth = np.ones(len(xyz)) if orthographic else local[:, 2]
            pixels = np.column_stack([local[:, 0] / depth, local[:, 1] / depth, np.ones(len(xyz))]) @ intrinsics.T
            np.testing.assert_allclose(pixels[:, :2], [p["xy"] for p in points.values()], atol=0.01)
        for name, place in places.items():
            np.testing.assert_allclose(one["landmarks"][name]["xyz"], place, atol=1e-3)
        # seen from the subject's right: x runs right, y down, z away
        p = one["landmarks"]
        assert p["chin"]["xy"][1] > p["nose_tip"]["xy"][1] > p["nose_bridge"]["xy"][1]
        assert p["jaw_R"]["visible"]
        assert not p["jaw_L"]["visible"]
        z = {name: extrinsics[2] @ [*point["xyz"], 1] for name, point in p.items()}
        assert z["head_back"] > z["nose_tip"] > 0


def test_masks_lie_over_the_pictures(tmp_path):
    run_batch({"poses": "27E", "sizes": 64, "masks": True, "renderer": "soft", "backgrounds": "transparent"},
              tmp_path / "set", workers=1)
    one, = labels(tmp_path / "set")
    parts = json.loads((tmp_path / "set" / "manifest.json").read_text())["faces"]["akimoto"]["mask_parts"]
    with Image.open(tmp_path / "set" / one["mask"]) as file:
        assert file.mode == "L"
        mask = np.asarray(file)
    with Image.open(tmp_path / "set" / one["file"]) as file:
        alpha = np.asarray(file)[..., 3]
    assert parts["nothing"] == 0
    assert set(np.unique(mask)) <= set(parts.values())
    assert (mask[alpha == 255] > 0).all()
    assert (mask[alpha == 0] == 0).all()
    at = {name: mask[int(p["xy"][1]), int(p["xy"][0])] for name, p in one["landmarks"].items() if p["visible"]}
    assert at["chin"] == at["nose_tip"] == parts["skin"]
    assert at["brow_mid_L"] == parts["brows"]
    assert {parts[name] for name in ("skin", "hair", "mouth", "eye_L", "eye_R")} <= set(np.unique(mask))


def test_the_manifest_says_what_it_was_made_from(serial):
    manifest = json.loads((serial / "manifest.json").read_text())
    assert manifest["facegen"] == facegen.__version__
    assert manifest["pictures"] == 12
    assert set(manifest["tables"]) == set(digests.TABLES)
    assert all(len(digest) == 64 for digest in manifest["tables"].values())
    assert manifest["faces"]["akimoto"]["digest"] == digests.face_digest("akimoto")
    assert digests.face_digest("akimoto") != digests.face_digest("akimoto-1986")
    assert {"axes", "camera", "pixels", "view"} <= set(manifest["about"])
    assert manifest["renderer"] == "soft"


@pytest.mark.parametrize("format", ["webp", "jpg"])
def test_formats_and_lights(tmp_path, format):
    run_batch({"poses": "0", "sizes": 48, "format": format, "lights": ["portrait", "left", "dim"], "detail": 0,
               "renderer": "soft"}, tmp_path / "set", workers=1)
    found = {}
    for one in labels(tmp_path / "set"):
        assert one["file"].endswith(f".{format}")
        with Image.open(tmp_path / "set" / one["file"]) as file:
            found[one["light"]] = np.asarray(file).astype(float)
    assert found["dim"][16:32, 16:32].mean() < found["portrait"][16:32, 16:32].mean() - 20
    left = found["left"][20:30]
    assert left[:, 26:32].mean() > left[:, 16:22].mean() + 15       # the subject's left is on the right of the picture


def test_two_workers_give_the_same_bytes(serial, tmp_path, jobs, contents):
    steps = []
    report = run_batch(jobs, tmp_path / "set", workers=2, step=lambda: steps.append(1))
    assert (report.made, report.kept, report.lost) == (12, 0, 0)
    assert len(steps) == 12
    assert contents(tmp_path / "set") == contents(serial)


def test_a_second_run_draws_nothing(serial, jobs, contents):
    before, written = contents(serial), times(serial)
    report = run_batch(jobs, serial, workers=1)
    assert (report.made, report.kept) == (0, 12)
    assert contents(serial) == before
    assert times(serial) == written


@pytest.fixture
def copied(serial, tmp_path):
    import shutil

    return shutil.copytree(serial, tmp_path / "copy")


def test_what_is_missing_or_cut_off_is_drawn_again(copied, jobs, serial, contents):
    first, second, third, fourth, fifth = (one["name"] for one in labels(copied)[:5])
    (copied / "images" / f"{first}.png").unlink()
    cut = copied / "images" / f"{second}.png"
    cut.write_bytes(cut.read_bytes()[:100])
    (copied / "labels" / f"{third}.json").unlink()
    (copied / "labels" / f"{fourth}.json").write_text("{")
    (copied / "labels" / f"{fifth}.json").write_text("[]")
    (copied / "manifest.json").unlink()
    (copied / "images" / f".{first}.png.12345678.part").write_text("half")
    assert run_batch(jobs, copied, workers=1).made == 5
    assert contents(copied) == contents(serial)


def test_stale_pictures_are_drawn_again(copied, jobs, monkeypatch):
    before = times(copied)
    digests.table_digests.cache_clear()
    monkeypatch.setattr(digests, "file_digest", lambda path: "other" if path.name == "lights.yaml" else "same")
    digests.kept_digest.cache_clear()
    try:
        assert run_batch(jobs, copied, workers=1).made == 12
    finally:
        digests.table_digests.cache_clear()
        digests.kept_digest.cache_clear()
    after = times(copied)
    assert all(after[name] > before[name] for name in before)
    monkeypatch.undo()
    monkeypatch.setattr(picture, "__version__", "99")
    assert run_batch(jobs, copied, workers=1).made == 12


def test_line_ends_make_no_other_data(tmp_path):
    (tmp_path / "a").write_bytes(b"x: 1\r\ny: 2\r\n")
    (tmp_path / "b").write_bytes(b"x: 1\ny: 2\n")
    assert digests.file_digest(tmp_path / "a") == digests.file_digest(tmp_path / "b")


def test_a_worker_with_other_data_refuses(tmp_path, jobs, monkeypatch):
    real = picture.data_digest
    answers = iter([real("akimoto")] * 12)
    monkeypatch.setattr(picture, "data_digest", lambda face: next(answers, "another"))
    with pytest.raises(InputError, match="this worker has other data"):
        run_batch(jobs, tmp_path / "set", workers=1)
    assert not list((tmp_path / "set" / "images").iterdir())


def test_an_altered_batch_is_told_apart_and_taken_over(copied, jobs, contents):
    before, there = times(copied), contents(copied)
    jobs["poses"] = ["happiness", "anger", "figure-8"]
    with pytest.raises(FileError, match=r"holds another data set.*--update"):
        run_batch(jobs, copied, workers=1)
    assert contents(copied) == there
    report = run_batch(jobs, copied, workers=1, update=True)
    assert (report.made, report.kept, report.removed) == (4, 8, 4)
    found = labels(copied)
    assert {path.name for path in (copied / "images").iterdir()} == {f"{one['name']}.png" for one in found}
    assert {path.stem for path in (copied / "labels").iterdir()} == {one["name"] for one in found}
    after = times(copied)
    assert all(after[name] == before[name] for name in after if name in before)
    assert run_batch(jobs, copied, workers=1).made == 0


# -- stopped ----------------------------------------------------------------------------------------------------
def heed_interrupts():
    """A process started in the background by a shell would be deaf to Ctrl-C, and so would its children."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(tmp_path, jobs, *options):
    page = tmp_path / "jobs.json"
    page.write_text(json.dumps(jobs))
    command = [sys.executable, "-m", "facegen", "batch", str(page), "-o", str(tmp_path / "set"), *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               preexec_fn=heed_interrupts)
    deadline = time.monotonic() + 60
    while len(list((tmp_path / "set" / "labels").glob("*.json"))) < 3:
        assert time.monotonic() < deadline
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    return process


COUNT = 40
MANY = {"poses": [f"12={weight / 100}" for weight in range(100 - COUNT, 100)], "sizes": 48, "detail": 0,
        "renderer": "soft"}


@pytest.mark.parametrize(("how", "workers"), [(signal.SIGINT, "2"), (signal.SIGKILL, "2"), (signal.SIGINT, "1")])
def test_a_stopped_run_goes_on_where_it_was(tmp_path, how, workers):
    process = start(tmp_path, MANY, "--workers", workers)
    os.kill(process.pid, how)
    _, err = process.communicate(timeout=20)
    if how == signal.SIGINT:
        assert process.returncode == 1
        assert err == "facegen: stopped; the finished pictures stay: run the same again to go on\n"
    time.sleep(0.5)                         # workers see that their parent is gone
    done = {path.stem for path in (tmp_path / "set" / "labels").glob("*.json")}
    before = times(tmp_path / "set")
    assert 3 <= len(done) < COUNT
    assert not (tmp_path / "set" / "manifest.json").exists()
    report = run_batch(MANY, tmp_path / "set", workers=1)
    assert (report.made, report.kept) == (COUNT - len(done), len(done))
    after = times(tmp_path / "set")
    assert all(after[f"{name}.png"] == before[f"{name}.png"] for name in done)
    assert set(after) == {f"{one['name']}.png" for one in labels(tmp_path / "set")}
    assert len(after) == COUNT


@pytest.mark.parametrize("gap", [0.005, 0.1])
def test_more_than_one_interrupt_ends_it_all_the_same(tmp_path, gap):
    process = start(tmp_path, MANY, "--workers", "2")
    for _ in range(3):
        os.kill(process.pid, signal.SIGINT)
        time.sleep(gap)
    try:
        _, err = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 1
    assert err == "facegen: stopped; the finished pictures stay: run the same again to go on\n"


def test_a_killed_worker_process_is_replaced(tmp_path, contents):
    run_batch(MANY, tmp_path / "serial", workers=1)
    process = start(tmp_path, MANY, "--workers", "2", "--json")
    children = subprocess.run(["ps", "-ww", "-o", "pid=,args=", "--ppid", str(process.pid)], capture_output=True,
                              text=True, check=True).stdout.splitlines()
    worker = next(int(line.split()[0]) for line in children if "spawn_main" in line)
    os.kill(worker, signal.SIGKILL)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert json.loads(out)["lost_workers"] == 1
    assert contents(tmp_path / "set") == contents(tmp_path / "serial")


# -- wrong ------------------------------------------------------------------------------------------------------
def test_a_folder_that_is_no_data_set(tmp_path, jobs):
    (tmp_path / "letters.txt").write_text("dear")
    with pytest.raises(FileError, match=r"holds other files \('letters.txt'\).*new or empty"):
        run_batch(jobs, tmp_path)
    with pytest.raises(FileError, match=r"is a file, expected a folder"):
        run_batch(jobs, tmp_path / "letters.txt")
    with pytest.raises(FileError, match="other files"):
        run_batch(jobs, tmp_path, update=True)
    assert [path.name for path in tmp_path.iterdir()] == ["letters.txt"]


def test_a_folder_that_cannot_be_made(tmp_path, jobs):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match=r"file.*(folder cannot be made|cannot be read)"):
        run_batch(jobs, tmp_path / "file" / "set")


def test_a_folder_that_cannot_be_written(tmp_path, jobs, monkeypatch):
    folder = tmp_path / "set"
    folder.mkdir()

    def refuse(self, *_, **__):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr("pathlib.Path.mkdir", refuse)
    with pytest.raises(FileError, match=r"images: the folder cannot be made: Permission denied"):
        run_batch(jobs, folder, workers=1)
    assert list(folder.iterdir()) == []


def test_a_folder_in_the_way_of_a_picture(tmp_path, jobs):
    (tmp_path / "set" / "images").mkdir(parents=True)
    mark = tmp_path / "set" / "batch.json"
    with pytest.raises(FileError, match="other files"):
        run_batch(jobs, tmp_path / "set", workers=1)
    (tmp_path / "set" / "images").rmdir()
    run_batch({**jobs, "poses": "anger"}, tmp_path / "set", workers=1)
    assert mark.exists()
    name = labels(tmp_path / "set")[0]["name"]
    (tmp_path / "set" / "images" / f"{name}.png").unlink()
    (tmp_path / "set" / "images" / f"{name}.png").mkdir()
    with pytest.raises(FileError, match=r"\.png: is a folder, expected a file"):
        run_batch({**jobs, "poses": "anger"}, tmp_path / "set", workers=1)


def test_a_full_disk_leaves_what_was_finished(tmp_path, jobs, monkeypatch, contents, serial):
    real, left = Image.Image.save, [5]

    def save(self, *arguments, **more):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(self, *arguments, **more)

    monkeypatch.setattr(Image.Image, "save", save)
    with pytest.raises(FileError, match="No space left on device"):
        run_batch(jobs, tmp_path / "set", workers=1)
    there = contents(tmp_path / "set")
    assert len([name for name in there if name.startswith("images/")]) == 5
    assert not any(name.endswith(".part") for name in there)
    assert "manifest.json" not in there
    monkeypatch.undo()
    report = run_batch(jobs, tmp_path / "set", workers=1)
    assert (report.made, report.kept) == (7, 5)
    assert contents(tmp_path / "set") == contents(serial)


def test_a_disk_that_is_full_at_the_manifest(copied, jobs, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("csv.writer", full)
    with pytest.raises(FileError, match="No space left"):
        run_batch(jobs, copied, workers=1)
    assert not (copied / "manifest.json").exists()
    assert not list(copied.glob(".*"))


def test_a_scheduler_and_workers_are_one_too_many(tmp_path, jobs):
    with pytest.raises(InputError, match="scheduler: give either"):
        run_batch(jobs, tmp_path / "set", workers=2, scheduler="tcp://127.0.0.1:1")


def test_nothing_is_made_before_all_is_checked(tmp_path, jobs, monkeypatch):
    monkeypatch.setattr(batch_module, "run", lambda *_, **__: pytest.fail("work began"))
    with pytest.raises(InputError):
        run_batch({**jobs, "poses": ["happiness", "hapiness"]}, tmp_path / "set")
    assert not (tmp_path / "set").exists()
