"""facegen batch: the command line and the jobs file say the same; wrong wishes leave nothing behind."""

from __future__ import annotations

import json

import pytest

from facegen.errors import JobError


def test_a_data_set_by_options(run, tmp_path):
    code, out, err = run("batch", "--poses", "happiness, 6C+12D", "--views", "0,0 30,0", "--sizes", "48x32",
                         "--people", "nobody,mika", "--intensities", "0.5,1", "--lights", "even", "--backgrounds",
                         "1,2,3 plain", "--masks", "--feature-points", "--format", "webp", "-o", tmp_path / "set",
                         "--workers", 1, "--json")
    assert (code, err) == (0, "")
    data = json.loads(out)
    assert (data["pictures"], data["made"], data["kept"]) == (32, 32, 0)
    lines = [json.loads(line) for line in (tmp_path / "set" / "pictures.jsonl").read_text().splitlines()]
    assert {tuple(one["view"]) for one in lines} == {(0, 0), (30, 0)}
    assert {one["light"] for one in lines} == {"even"}
    assert all(one["feature_points"] and one["size"] == [48, 32] for one in lines)
    assert len(list((tmp_path / "set" / "images").glob("*.webp"))) == 32
    assert len(list((tmp_path / "set" / "masks").glob("*.png"))) == 32


def test_a_jobs_file_and_then_another(run, tmp_path):
    page = tmp_path / "jobs.yaml"
    page.write_text("poses: [happiness, 5E+43B]\nsizes: 32\ndetail: 0\n")
    code, out, err = run("batch", page, "-o", tmp_path / "set", "--workers", 1)
    assert (code, out) == (0, "")
    assert err.count("\n") == 1
    assert err.startswith("facegen: warning: 5 (upper lid raiser)")
    page.write_text("poses: [happiness]\nsizes: 32\ndetail: 0\n")
    code, _, err = run("batch", page, "-o", tmp_path / "set", "-q")
    assert code == 2
    assert "another data set" in err
    assert "--update" in err
    code, out, err = run("batch", page, "-o", tmp_path / "set", "-q", "--update", "--json", "--workers", 1)
    assert (code, err) == (0, "")
    assert {key: json.loads(out)[key] for key in ("made", "kept", "removed")} == {"made": 0, "kept": 1, "removed": 1}


@pytest.mark.parametrize(("raised", "words"), [
    (KeyboardInterrupt(), "stopped; the finished pictures stay: run the same again to go on"),
    (JobError("a.json: workers die over it"), "a.json: workers die over it"),
])
def test_work_that_ends_early_is_no_wrong_wish(run, tmp_path, monkeypatch, raised, words):
    def fail(*_, **__):
        raise raised

    monkeypatch.setattr("facegen.jobs.batch.run_batch", fail)
    assert run("batch", "--poses", "happiness", "-o", tmp_path / "set") == (1, "", f"facegen: {words}\n")


def test_any_command_that_is_stopped_says_so(run, tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("facegen.face.face.load_face", stop)
    assert run("gallery", "-o", tmp_path / "sheets") == (1, "", "facegen: stopped\n")


@pytest.mark.parametrize(("argv", "words"), [
    (["--poses", "happiness"], "-o: say which folder"),
    (["-o", "set"], "either a jobs file or --poses"),
    (["jobs.yaml", "--poses", "happiness", "-o", "set"], "not both (--poses)"),
    (["jobs.yaml", "-o", "set"], "no such file"),
    (["--views", "0,0", "-o", "set"], "'poses' is missing"),
    (["--poses", "happiness,hapiness", "-o", "set"], "poses.1: "),
    (["--poses", "hapiness", "-o", "set"], "did you mean 'happiness'"),
    (["--poses", "1", "--views", "north", "-o", "set"], "views.0: view: expected YAW,PITCH"),
    (["--poses", "1", "--faces", "akimoti", "-o", "set"], "did you mean 'akimoto'"),
    (["--poses", "1", "--people", "mikka", "-o", "set"], "did you mean 'mika'"),
    (["--poses", "1", "--lights", "bright", "-o", "set"], "unknown light 'bright'"),
    (["--poses", "1", "--intensities", "much", "-o", "set"], "--intensities: expected numbers"),
    (["--poses", "1", "--format", "gif", "-o", "set"], "unknown format 'gif'"),
    (["--poses", "1", "--sizes", "0", "-o", "set"], "32..4096"),
    (["--poses", "1", "--workers", "0", "-o", "set"], "--workers"),
    (["--poses", "1", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1", "-o", "set"], "give either a scheduler or"),
    (["--poses", "1", "-o", "file"], "is a file, expected a folder"),
    (["--poses", "1", "-o", "."], "holds other files"),
])
def test_wrong_wishes(run, tmp_path, monkeypatch, argv, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("precious")
    code, out, err = run("batch", *argv)
    assert (code, out) == (2, "")
    assert err.startswith("facegen: ")
    assert words in err
    assert "Traceback" not in err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
