"""Places on rigs: they are where the rig's own poses have them, and their slopes are their differences."""

import numpy as np
import pytest
from scipy import sparse

import facegen
from facegen.fitting.fit import layout_points
from facegen.fitting.points import BlendPoints, Shapes
from facegen.fitting.rigs import rig_points, wanted
from facegen.fitting.units import FacePoints, unit_atoms


def differences(points, x, step=1e-6):
    return np.column_stack([(points.places(x + step * one) - points.places(x - step * one)).ravel() / (2 * step)
                            for one in np.eye(len(x))])


def test_blendshapes_with_halves_and_pairs():
    rng = np.random.default_rng(0)
    mix = Shapes(4, {1: 4}, {3: 2})
    points = BlendPoints(("a", "b", "c", "fix"), rng.normal(size=(5, 3)), rng.normal(size=(5, 5, 3)), mix)
    x = np.array([0.2, 0.3, 0.1, 0.4])
    assert points.slopes(x) == pytest.approx(differences(points, x), abs=1e-7)
    assert points.gram(x) == pytest.approx(points.slopes(x).T @ points.slopes(x))
    assert points.weights(x).tolist() == [0.2, 0.3, 0.5, 0.4]       # what fix corrects comes along
    assert points.weights(np.array([0, 0, 0.9, 0.8]))[2] == 1.0
    assert points.moved(np.ones((5, 3))).places(x) == pytest.approx(points.places(x) + 1.0)


def test_an_avatars_places_are_where_its_poses_have_them(avatar):
    rows, _, _ = layout_points(avatar, "ibug68", None)
    points = rig_points(avatar, rows, wanted(avatar))
    rng = np.random.default_rng(1)
    x = np.where(rng.random(52) < 0.3, rng.random(52), 0.0)
    posed = avatar.pose_shapes(dict(zip(points.names, points.weights(x).tolist(), strict=True)))
    assert points.places(x) == pytest.approx(rows @ posed, abs=1e-9)


def test_the_parametric_faces_places_are_where_its_poses_have_them(base):
    rows, _, _ = layout_points(base, "mediapipe478", None)
    points = FacePoints(base, rows, unit_atoms())
    rng = np.random.default_rng(2)
    for _ in range(3):
        units = {atom: float(w) for atom, w in zip(points.names, rng.random(len(points.names)), strict=True)
                 if rng.random() < 0.25}
        x = np.array([*(units.get(atom, 0.0) for atom in points.names), 10.0, -8.0, 0.0])
        posed = base.pose({**units, "61": 10 / 25, "64": 8 / _down()})
        assert points.places(x) == pytest.approx(rows @ posed, abs=1e-9)
    assert points.gaze(x) == pytest.approx([10.0, -8.0, 10.0, -8.0])
    crossed = np.zeros(len(x))
    crossed[-1] = -9.0
    assert points.places(crossed) == pytest.approx(rows @ base.pose({"66": 0.5}), abs=1e-9)


def _down():
    from facegen.animation.angles import reach

    return reach("eyes", "pitch")[1]


def test_some_vertices_alone_are_those_of_all(base):
    controls = base.controls(base.resolve("12D+26C+43B+61C+51C").deformation)
    whole = base.pose_controls(controls)
    some = np.unique(np.random.default_rng(0).choice(len(whole), 300))
    assert base.some_posed(some)(controls) == pytest.approx(whole[some], abs=1e-12)
    neutral = base.controls(facegen.Deformation())
    assert (base.some_posed(some)(neutral) == base.mesh().vertices[some]).all()


def test_units_that_look_alike_are_left_out_unless_asked_for(base):
    assert "26" not in unit_atoms()
    assert not any(atom.endswith(("41", "45", "46", "51", "61")) for atom in unit_atoms())
    assert unit_atoms(["AU12_L", "26", "4"]) == ("L4", "R4", "L12", "26")
    rows = sparse.csr_array((3, len(base.mesh().vertices)))
    assert rig_points(base, rows, wanted(base, ["12"]), gaze=False).names == ("L12", "R12")


def test_which_weights_are_fitted(avatar, rig_of, base):
    assert (wanted(avatar).vocabulary, len(wanted(avatar).names)) == ("arkit", 52)
    both = facegen.AvatarFace(rig_of("units", "arkit", "visemes"))
    assert wanted(both).vocabulary == "arkit"
    assert wanted(both, "visemes").vocabulary == "visemes"
    assert wanted(facegen.AvatarFace(rig_of("units"))).vocabulary == "units"
    assert wanted(avatar, ["jawOpen", "mouthClose"]).columns == ("jawOpen", "mouthClose")
    renamed = facegen.AvatarFace(rig_of("arkit", rename=lambda name: f"hero.{name}"))
    assert wanted(renamed).names == wanted(avatar).names
    assert wanted(renamed).columns[0].startswith("hero.")
    for face, shapes, said in ((avatar, "jaw", "did you mean"), (avatar, "visemes", "none of the set"),
                               (avatar, ["jawOpne"], "'jawOpen'"), (base, "arkit", "only units"), (avatar, [], "none"),
                               (base, [], "none")):
        with pytest.raises(facegen.InputError, match=said):
            wanted(face, shapes)
    with pytest.raises(facegen.InputError, match="99"):
        wanted(base, ["99"])
