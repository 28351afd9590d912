"""Landmark files that are proposed: read again as they were written, by the reader that a rig uses."""

import numpy as np
import pytest
import yaml

from facegen.cli import main
from facegen.errors import TableError
from facegen.jobs import landmark_files
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.rig import avatar_files

SIX = {"eye_outer_L": [1.5, 2, 1e-07], "nose_tip": 7}


@pytest.fixture
def run(human, monkeypatch, capsys):
    """Run a command; the human's proposer is not made again."""
    proposer = human[0]
    monkeypatch.setattr(landmark_files, "Proposer", lambda mesh: proposer)

    def command(*words):
        code = main([str(word) for word in words])
        return code, *capsys.readouterr()

    return command


def test_the_command_writes_what_a_rig_takes(run, human, tmp_path):
    out, sheet = tmp_path / "human.yaml", tmp_path / "sheet.png"
    code, said, _ = run("landmarks", "human", "-o", out, "--preview", sheet)
    assert code == 0
    assert "proposed, 0 given" in said
    assert sheet.read_bytes()[:4] == b"\x89PNG"
    proposer, _ = human
    places = load_landmarks(out, proposer.mesh, mesh_name="human.obj")
    found = proposer.propose({})
    for name, at in places.points(proposer.mesh.vertices).items():
        assert np.allclose(at, found[name].xyz, atol=1e-3)
    assert yaml.safe_load(out.read_text())["confidence"].keys() == set(places.names)


def test_given_places_stand_in_the_file_as_they_were(run, human, tmp_path):
    _, true = human
    six = tmp_path / "six.yaml"
    marks = yaml.safe_load(avatar_files("human", None)[1].read_text())["landmarks"]
    given = {"nose_tip": marks["nose_tip"], "chin": [float(x) for x in true["chin"]],
             "eye_outer_L": marks["eye_outer_L"], "eye_outer_R": marks["eye_outer_R"]}
    six.write_text(yaml.safe_dump({"landmarks": given}))
    code, said, _ = run("landmarks", "human", "--from", six, "-o", tmp_path / "all.yaml")
    assert code == 0
    assert "4 given" in said
    written = yaml.safe_load((tmp_path / "all.yaml").read_text())
    assert {name: written["landmarks"][name] for name in given} == given
    assert all(written["confidence"][name] == 1.0 for name in given)


def test_json_and_quiet(run, tmp_path):
    import json

    code, said, err = run("landmarks", "human", "-o", tmp_path / "a.yaml", "--json", "-q")
    found = json.loads(said)
    assert (code, err) == (0, "")
    assert found["face"] == 1.0
    assert len(found["landmarks"]["chin"]["barycentric"]) == 3


@pytest.mark.parametrize(("words", "said"), [
    (["human"], "-o: say where"), (["humann", "-o", "a.yaml"], "human"), (["human", "-o", "a.txt"], ".yaml"),
    (["human", "-o", "a.yaml", "--preview", "a.gif"], "a.gif"),
    (["human", "-o", "a.yaml", "--from", "none.yaml"], "none.yaml"),
    (["human", "-o", "a.yaml", "--from", "odd.yaml"], "nose_tip"), (["empty.obj", "-o", "a.yaml"], "empty.obj"),
    (["noise.glb", "-o", "a.yaml"], "noise.glb")])
def test_what_cannot_be_done_is_said_and_nothing_is_touched(run, words, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.yaml").write_text("kept")
    (tmp_path / "odd.yaml").write_text("landmarks: {nose_tipp: 3}")
    (tmp_path / "empty.obj").write_text("")
    (tmp_path / "noise.glb").write_bytes(bytes(range(256)))
    code, out, err = run("landmarks", *words)
    assert (code, out) == (2, "")
    assert said in err
    assert "Traceback" not in err
    assert (tmp_path / "a.yaml").read_text() == "kept"


@pytest.mark.parametrize(("confidence", "said"), [
    ("{nose_tipp: 1}", "nose_tip"), ("{nose_tip: 2}", "0..1"), ("{nose_tip: high}", "number"), ("3", "mapping")])
def test_a_confidence_that_is_none_is_refused(confidence, said, human, tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(f"landmarks: {{nose_tip: 7}}\nconfidence: {confidence}\n")
    with pytest.raises(TableError, match=said):
        load_landmarks(path, human[0].mesh, partial=True)
