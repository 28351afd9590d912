"""Works as data: to a file and back, what is refused, undo, autosave."""

import json
import stat
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import facegen
from facegen.errors import FileError, InputError, TableError
from facegen.facs.tables import load_units
from facegen.studio.history import STEPS, TOGETHER, History
from facegen.studio.store import Store
from facegen.studio.work import FaceWork, TableWork, Work

weights = st.floats(0.0, 1.0, allow_subnormal=False)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(st.sampled_from(["1", "L2", "R12", "26", "43"]), weights), weights,
       st.dictionaries(st.sampled_from(["jaw_unused", "open"]).filter(lambda key: key == "open"),
                       st.floats(-20, 20, allow_subnormal=False)))
def test_a_work_comes_back_from_json_as_it_was(units, intensity, jaw):
    raw = {"units": "millimetre", "jaw": jaw, "points": {"mouth_corner_L": [1.5, 0.0, -2.0]}}
    work = Work(face=FaceWork(units=units, intensity=intensity, raw=raw, person="mika").checked())
    assert Work.read(json.loads(json.dumps(work.plain()))) == work


@pytest.mark.parametrize(("change", "said"), [
    ({"facegen_studio": 2}, "form of the studio's work '2'"),
    ({"face": {"rig": 3}}, "face.rig: expected a text"),
    ({"face": {"units": {"99": 1.0}}}, "there is no unit 99"),
    ({"face": {"units": {"12": 1.5}}}, "12"),
    ({"face": {"blend": {"happiness": float("nan")}}}, "blend.happiness"),
    ({"face": {"intensity": 2}}, "intensity: expected a number in 0..1"),
    ({"face": {"raw": {"jaw": {"opn": 1}}}}, "did you mean|unknown"),
    ({"face": {"colour": 1}}, "unknown key 'colour'"),
    ({"clip": {"loop": 1}}, "clip.loop: expected true or false"),
    ({"extra": {}}, "unknown key 'extra'"),
])
def test_what_is_no_work_is_refused_by_name(change, said):
    with pytest.raises(TableError, match=said):
        Work.read({**Work().plain(), **change})


def test_raw_movements_come_on_top_of_units_and_intensity_scales_both():
    face = facegen.load_face()
    work = FaceWork(units={"12": 0.8}, raw={"units": "millimetre", "points": {"brow_inner_L": [0.0, 4.0, 0.0]}})
    both, units = face.pose(work.meaning()), face.pose("AU12=0.8")
    moved = abs(both - units).max(axis=1) > 0.1
    assert 20 < moved.sum() < len(both) / 2
    half = replace(work, intensity=0.5)
    expected = face.pose("AU12=0.4") + (both - units) / 2
    assert face.pose(half.meaning()) == pytest.approx(expected, abs=0.02)
    assert (face.pose(FaceWork().meaning()) == face.mesh().vertices).all()


def smiling(weight):
    return Work(face=FaceWork(units={"12": weight}))


def test_undo_and_redo_walk_through_all_steps_and_a_new_change_forgets_the_redone():
    history = History(Work())
    for weight in (0.1, 0.2, 0.3):
        assert history.change(f"to {weight}", smiling(weight))
    assert not history.change("nothing", smiling(0.3))
    assert history.undoes == "to 0.3"
    assert [history.undo() for _ in range(4)] == [smiling(0.2), smiling(0.1), Work(), Work()]
    assert history.undoes is None
    assert history.redo() == smiling(0.1)
    assert history.redoes == "to 0.2"
    history.change("elsewhere", smiling(0.9))
    assert history.redoes is None
    assert history.redo() == smiling(0.9)


def test_a_drag_is_one_step_and_a_pause_ends_it():
    now = [0.0]
    history = History(Work(), clock=lambda: now[0])
    for weight in (0.1, 0.2, 0.3):
        history.change("smile", smiling(weight), thing="12")
        now[0] += 0.9 * TOGETHER
    now[0] += TOGETHER
    history.change("smile", smiling(0.4), thing="12")
    history.change("brows", replace(smiling(0.4), face=FaceWork(units={"1": 1.0})), thing="1")
    assert [history.undo() for _ in range(3)] == [smiling(0.4), smiling(0.3), Work()]


def test_history_does_not_grow_without_end():
    history = History(Work())
    for k in range(STEPS + 50):
        history.change(str(k), smiling(k / 1000))
    for _ in range(STEPS):
        history.undo()
    assert history.undoes is None
    assert history.work == smiling(0.049)


def test_a_store_finds_works_again_after_a_crash(tmp_path):
    store = Store(tmp_path / "works")
    assert store.load("one") == (Work(), None)
    for weight in (0.1, 0.2, 0.3):
        store.save("one", smiling(weight))
    assert store.load("one") == (smiling(0.3), None)                # what waits is what is
    store.save("two", smiling(0.9))
    store.flush()
    again = Store(tmp_path / "works")                               # another process
    assert again.load("one") == (smiling(0.3), None)
    assert again.load("two") == (smiling(0.9), None)
    assert stat.S_IMODE((tmp_path / "works" / "one").stat().st_mode) == 0o700
    assert not list(tmp_path.rglob("*.part"))


def test_a_change_is_saved_by_itself(tmp_path):
    store = Store(tmp_path)
    store.save("one", smiling(0.5))
    store._timer.join(10)
    assert Store(tmp_path).load("one") == (smiling(0.5), None)


@pytest.mark.parametrize("text", ["{", '{"facegen_studio": 9}', "[]", ""])
def test_an_unreadable_work_is_set_aside_and_told(tmp_path, text):
    store = Store(tmp_path)
    path = store.folder_of("one") / "work.json"
    path.write_text(text)
    work, told = store.load("one")
    assert work == Work()
    assert "set aside" in told
    store.save("one", smiling(0.2))
    store.flush()
    assert [aside.read_text() for aside in path.parent.glob("*.unreadable")] == [text]
    assert store.load("one") == (smiling(0.2), None)


def test_a_work_that_cannot_be_saved_is_told_once_and_saved_when_it_can_be(tmp_path):
    store, said = Store(tmp_path), []
    store.on_failure(lambda name, error: said.append((name, error)))
    (tmp_path / "one").write_text("a file where the folder should be")
    for weight in (0.5, 0.6):
        store.save("one", smiling(weight))
        store.flush()
    (name, error), = said
    assert name == "one"
    assert isinstance(error, FileError)
    assert store.load("one") == (smiling(0.6), None)
    (tmp_path / "one").unlink()
    store.flush()
    assert Store(tmp_path).load("one") == (smiling(0.6), None)


def test_a_section_checks_itself():
    with pytest.raises(InputError, match="no unit"):
        FaceWork(units={"99": 1.0}).checked()


def test_a_new_work_comes_back():
    """Every section as it is before anything is chosen: texts that are empty, what is None."""
    assert Work.read(json.loads(json.dumps(Work().plain()))) == Work()


@pytest.mark.parametrize("script", ["61+12D", "63D+6C", "65C+4B"])
def test_a_gaze_takes_the_place_of_units_that_turn_the_eyes(script):
    """A rig that is posed by units must not turn the eyes twice."""
    face = facegen.load_face()
    units = facegen.parse(script)
    gaze = {"x": 60.0, "y": -20.0, "z": 400.0}
    others = {code: one for code, one in units.items() if code not in ("61", "63", "65")}
    both, alone = (FaceWork(units=one, gaze=gaze).checked().meaning(rig=face) for one in (units, others))
    assert face.pose(both) == pytest.approx(face.pose(alone), abs=1e-9)
    assert not any(load_units().basis[name].eyes for name in load_units().coefficients(both.units))


TARGET = np.array([30.0, -10.0, 250.0])


@pytest.mark.parametrize("script", ["0", "57E", "51C+55D", "58D+53C+61E"])
@pytest.mark.parametrize("raw", [
    {}, {"head": {"yaw": -12.0, "pitch": 8.0, "roll": 6.0}}, {"head": {"forward": 9.0, "yaw": 10.0}},
    {"head": {"forward": 0.3}, "units": "face"}, {"head": {"forward": 0.2, "roll": -7.0}, "units": "paper"}])
def test_eyes_meet_what_they_look_at_however_the_head_is_held(script, raw):
    """By the posed eyeballs themselves: their centre and how they turned."""
    face = facegen.load_face("akimoto-1986" if raw.get("units") == "paper" else "akimoto")
    work = FaceWork(units=facegen.parse(script), raw={"units": "millimetre", **raw} if raw else {},
                    gaze=dict(zip("xyz", TARGET.tolist(), strict=True))).checked()
    meaning = work.meaning(rig=face)
    assert face.head_angles(meaning).any() == (script != "0" or bool(raw))
    rest, posed = face.mesh().vertices, face.pose(meaning)
    for part, centre in zip(("eye_L", "eye_R"), face.eye_centres, strict=True):
        ball = face.mesh().part_vertices(part)
        u, _, vt = np.linalg.svd((posed[ball] - posed[ball].mean(axis=0)).T @ (rest[ball] - rest[ball].mean(axis=0)))
        turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        at = posed[ball].mean(axis=0) + turn @ (centre - rest[ball].mean(axis=0))
        way, away = turn @ [0.0, 0.0, 1.0], TARGET - at
        assert np.degrees(np.arccos(np.clip(way @ away / np.linalg.norm(away), -1, 1))) < 0.2


@pytest.mark.parametrize("rotation", [None, [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]])
def test_an_avatars_eyes_look_as_the_faces_do(rig_of, rotation):
    """Made of the base face, in metres and in whatever axes."""
    from facegen.face.avatar import AvatarFace

    avatar, face = AvatarFace(rig_of("units", rotation=rotation)), facegen.load_face()
    work = FaceWork(units=facegen.parse("57D+12C"), raw={"head": {"yaw": 14.0, "forward": 6.0}, "units": "millimetre"},
                    gaze=dict(zip("xyz", TARGET.tolist(), strict=True)))
    found, wanted = (work.meaning(rig=rig).more[-1].eyes for rig in (avatar, face))
    assert found == pytest.approx(wanted, abs=0.7)
    assert wanted != pytest.approx(facegen.look_at(face, TARGET), abs=3.0)


def test_a_table_of_too_many_habits_is_refused():
    data = {"about": "a", "source": "b", "aliases": dict.fromkeys([f"w{k}" for k in range(2000)], "happiness")}
    with pytest.raises(InputError, match="has 2,000 habits"):
        TableWork("ada.yaml", data).checked()
