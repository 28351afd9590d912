"""Round trips: weights -> vertices, markers or landmarks -> weights."""

from dataclasses import replace

import numpy as np
import pytest
from compared import of, swapped
from scipy.optimize import least_squares, minimize

import facegen
from facegen.fitting.fit import fit_landmarks, fit_markers, fit_meshes, landmark_tracker, layout_points
from facegen.fitting.head_pose import HeadPose, rotation
from facegen.fitting.rigs import rig_points, wanted
from facegen.fitting.solve import Rules, State, solve
from facegen.fitting.views import WeakCamera

TURN, PLACE = (20.0, -10.0, 15.0), np.array([10.0, 20.0, 30.0])


def test_meshes_give_back_weights_and_pose(avatar, performed):
    weights, posed = performed(6)
    found = fit_meshes(avatar, 1e-3 * (posed @ rotation(*TURN).T + PLACE), fps=30)
    names = wanted(avatar).names
    assert np.abs(of(found.performance, names) - weights).max() < 2e-3
    assert found.performance.head == pytest.approx(np.tile(TURN, (6, 1)), abs=1e-3)
    assert found.performance.place == pytest.approx(np.tile(PLACE, (6, 1)), abs=1e-2)
    assert found.scale == pytest.approx(1e-3, rel=1e-5)
    assert found.worst < 1e-2
    assert found.performance.vocabulary == "arkit"
    assert not found.seen.unseen


def test_noise_on_meshes_averages_out(avatar, performed):
    weights, posed = performed(3)
    noisy = posed + np.random.default_rng(0).normal(0, 0.5, posed.shape)
    found = fit_meshes(avatar, noisy, noise=0.5, scale=1.0)
    assert np.sqrt(np.mean((of(found.performance, wanted(avatar).names) - weights) ** 2)) < 0.02
    assert found.residual == pytest.approx(0.5 * np.sqrt(3), rel=0.03)


def test_markers_with_noise_and_gaps(avatar, performed):
    weights, posed = performed(12)
    rng = np.random.default_rng(1)
    marks = [name for name in avatar.landmarks if not name.startswith("eye_center")]
    places = np.array([[avatar.landmark_points(one)[name] for name in marks] for one in posed])
    places += rng.normal(0, 0.5, places.shape)
    places[rng.random(places.shape[:2]) < 0.2] = np.nan
    found = fit_markers(avatar, places @ rotation(*TURN).T + PLACE, marks, fps=30)
    error = of(found.performance, wanted(avatar).names) - weights
    assert np.sqrt(np.mean(error**2)) < 0.08
    assert np.abs(found.performance.head - TURN).max() < 2.5
    assert 0.3 < found.residual < 1.0


@pytest.mark.parametrize(("layout", "most"), [("ibug68", 0.08), ("mediapipe478", 0.04)])
def test_landmarks_in_pictures(avatar, performed, drawn, layout, most):
    weights, posed = performed(8)
    names, rng = wanted(avatar).names, np.random.default_rng(2)
    clean = drawn(avatar, posed, layout)
    found = fit_landmarks(avatar, clean, layout, camera=facegen.Pinhole.of_view(40, (1280, 720)), noise=0.1, fps=30)
    assert np.sqrt(np.mean((of(found.performance, names) - weights) ** 2)) < 0.03
    assert np.abs(found.performance.head - (15, 5, -5)).max() < 0.1
    assert np.abs(found.performance.place - (20, 10, -700)).max() < 1.0
    noisy = clean + rng.normal(0, 1.0, clean.shape)
    noisy[rng.random(clean.shape[:2]) < 0.15] = np.nan
    found = fit_landmarks(avatar, noisy, layout, camera=facegen.Pinhole.of_view(40, (1280, 720)), fps=30)
    assert np.sqrt(np.mean((of(found.performance, names) - weights) ** 2)) < most
    assert found.unit == "px"
    assert found.residual < 2.0


def test_weak_perspective_finds_the_turn_and_leaves_the_distance_open(avatar, performed, drawn):
    _, posed = performed(3)
    found = fit_landmarks(avatar, drawn(avatar, posed, place=(0.0, 0.0, -3000.0)), "ibug68", noise=0.3)
    assert np.abs(found.performance.head - (15, 5, -5)).max() < 2.0
    assert np.isnan(found.performance.place[:, 2]).all()
    assert np.isfinite(found.performance.place[:, :2]).all()
    assert any("how far away" in said for said in found.performance.warnings)


@pytest.mark.parametrize("pictures", [False, True])
def test_the_parametric_face_by_meshes_and_by_landmarks(base, drawn, pictures):
    units = {"27": 0.9, "L12": 0.6, "6": 0.5} if pictures else {"4": 0.9, "43": 0.6, "17": 0.5, "R10": 0.5}
    table, posed = facegen.load_units().catalogue.expand(units), base.pose(units)
    found = fit_landmarks(base, drawn(base, [posed], "mediapipe478"), "mediapipe478", noise=0.1,
                          camera=facegen.Pinhole.of_view(40, (1280, 720))) if pictures else \
        fit_meshes(base, posed @ rotation(*TURN).T)
    one = found.performance
    assert one.vocabulary == "units"
    assert np.abs(one.weights[0] - [table.get(name, 0.0) for name in one.names]).max() < 0.05
    assert np.linalg.norm(base.pose(one.frame(0)) - posed, axis=1).max() < 0.6      # millimetres, of all vertices


def test_the_gaze_of_the_parametric_face(base, drawn):
    posed = base.pose({"61": 0.6, "63": 0.5, "12": 0.4})
    found = fit_landmarks(base, drawn(base, [posed], "mediapipe478"), "mediapipe478", noise=0.1,
                          camera=facegen.Pinhole.of_view(40, (1280, 720)))
    assert found.performance.gaze[0] == pytest.approx([15.0, 10.0, 15.0, 10.0], abs=0.3)
    assert fit_landmarks(base, drawn(base, [posed]), "ibug68").performance.gaze is None     # no point on an eye


def test_units_on_an_avatar_of_units(rig_of):
    face = facegen.AvatarFace(rig_of("units"))
    units = {"12": 0.7, "6": 0.6, "1": 0.5, "L10": 0.4}         # 6 counts less beside 12: the table's rule
    found = fit_meshes(face, face.pose(units), shapes="units")
    atoms = facegen.load_units().catalogue.expand(units)
    assert found.performance.frame(0) == pytest.approx({name: atoms.get(name, 0.0) for name in found.performance.names},
                                                       abs=0.02)


def test_lids_that_are_corrected_half_way_are_fitted_so(rig_of):
    made = rig_of("arkit")
    side = made.shapes["eyeBlinkLeft"][:, [2, 0, 1]] * 0.5
    made = replace(made, shapes={**made.shapes, "eyeBlinkLeft_half": side},
                   notes={**made.notes, "halves": {"eyeBlinkLeft": "eyeBlinkLeft_half"}})
    face = facegen.AvatarFace(made)
    for weight in (0.2, 0.5, 0.9):
        found = fit_meshes(face, face.pose_shapes({"eyeBlinkLeft": weight, "jawOpen": 0.3}))
        assert "eyeBlinkLeft_half" not in found.performance.names
        assert found.performance.column("eyeBlinkLeft") == pytest.approx(weight, abs=2e-3)


def test_mouth_close_never_exceeds_jaw_open(avatar, performed, drawn):
    _weights, posed = performed(12, seed=11)
    rng = np.random.default_rng(3)
    points = drawn(avatar, posed) + rng.normal(0, 3.0, (12, 68, 2))
    one = fit_landmarks(avatar, points, "ibug68", noise=3.0).performance
    assert (one.column("mouthClose") <= one.column("jawOpen") + 1e-12).all()
    closed = avatar.pose_shapes({"jawOpen": 0.6, "mouthClose": 0.6})
    found = fit_meshes(avatar, closed).performance
    assert found.column("mouthClose") == pytest.approx(0.6, abs=5e-3)
    assert found.column("jawOpen") == pytest.approx(0.6, abs=5e-3)


def test_few_weights_say_what_many_could(avatar, drawn):
    posed = avatar.pose_shapes({"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8})
    noisy = drawn(avatar, [posed]) + np.random.default_rng(5).normal(0, 1.0, (68, 2))
    camera = facegen.Pinhole.of_view(40, (1280, 720))
    sparse = fit_landmarks(avatar, noisy, "ibug68", camera=camera).performance
    free = fit_landmarks(avatar, noisy, "ibug68", camera=camera, sparsity=0.0).performance
    assert (sparse.weights > 0.05).sum() < 0.6 * (free.weights > 0.05).sum()
    assert sparse.column("mouthSmileLeft")[0] == pytest.approx(0.8, abs=0.12)


def test_outliers_count_less_when_asked(avatar, performed, drawn):
    weights, posed = performed(8, seed=5)
    camera, rng = facegen.Pinhole.of_view(40, (1280, 720)), np.random.default_rng(6)
    points = drawn(avatar, posed) + rng.normal(0, 0.5, (8, 68, 2))
    bad = rng.random((8, 68)) < 0.1
    points[bad] += rng.normal(0, 60.0, (int(bad.sum()), 2))
    names = wanted(avatar).names
    plain, robust = (fit_landmarks(avatar, points, "ibug68", camera=camera, robust=robust, noise=0.5)
                     for robust in (False, True))
    off = [np.sqrt(np.mean((of(one.performance, names) - weights) ** 2)) for one in (plain, robust)]
    assert off[1] < 0.08
    assert off[1] < 0.4 * off[0]
    assert (robust.performance.extra["outliers"] > 0).mean() > 0.7


def test_a_mirrored_recording_gives_mirrored_weights(base, avatar, drawn):
    camera = facegen.Pinhole.of_view(40, (1280, 720))
    weights = {"mouthSmileLeft": 0.7, "browDownRight": 0.6, "jawOpen": 0.4, "jawLeft": 0.5, "eyeBlinkLeft": 0.8}
    posed = avatar.pose_shapes(weights)
    mirror = avatar.pose_shapes({swapped(name): w for name, w in weights.items()})
    one, other = (fit_landmarks(avatar, drawn(avatar, [vertices], turn=turn, place=place), "ibug68", camera=camera)
                  for vertices, turn, place in ((posed, (12, 4, 7), (30.0, 5.0, -600.0)),
                                                (mirror, (-12, 4, -7), (-30.0, 5.0, -600.0))))
    left, right = one.performance.frame(0), other.performance.frame(0)
    assert {swapped(name): w for name, w in left.items()} == pytest.approx(right, abs=0.02)
    assert one.performance.head[0] == pytest.approx(other.performance.head[0] * (-1, 1, -1), abs=0.1)


def test_another_persons_rest_is_no_expression(avatar, performed, drawn):
    weights, posed = performed(8, seed=8)
    weights[0] = 0.0
    posed[0] = avatar.mesh().vertices
    wide = posed * (1.08, 0.95, 1.04)                   # a broader face; its movements as much larger
    camera, names = facegen.Pinhole.of_view(40, (1280, 720)), wanted(avatar).names
    points = drawn(avatar, wide)
    off = [np.sqrt(np.mean((of(fit_landmarks(avatar, points, "ibug68", camera=camera, neutral=neutral).performance,
                               names) - weights) ** 2)) for neutral in ((), (0,))]
    assert off[1] < 0.06
    assert off[1] < 0.5 * off[0]
    points[0, 20:22] = np.nan
    found = fit_landmarks(avatar, points, "ibug68", camera=camera, neutral=(0,)).performance
    assert any("2 points are missing in the neutral frames" in said for said in found.warnings)
    meshes = fit_meshes(avatar, wide, neutral=[0]).performance
    assert np.sqrt(np.mean((of(meshes, names) - weights) ** 2)) < 0.05


def test_what_no_marker_sees_is_said(avatar, base):
    brows = [name for name in avatar.landmarks if name.startswith(("brow", "temple"))]
    places = np.array([avatar.landmark_points(avatar.pose_shapes({"browInnerUp": 0.7}))[name] for name in brows])
    found = fit_markers(avatar, places, brows, noise=0.1)
    assert {"jawOpen", "mouthSmileLeft", "tongueOut", "jawLeft"} <= set(found.seen.unseen)
    assert not {"browInnerUp", "browDownLeft"} & set(found.seen.unseen)
    assert not set(found.seen.unseen) & set(found.performance.names)
    assert any("no point sees" in said and "jawOpen" in said for said in found.performance.warnings)
    assert found.performance.column("browInnerUp")[0] == pytest.approx(0.7, abs=0.05)
    full = fit_meshes(avatar, avatar.mesh().vertices)
    assert not full.seen.unsure


def test_what_cannot_be_told_apart_is_said(avatar, drawn):
    found = fit_landmarks(avatar, drawn(avatar, [avatar.mesh().vertices]), "ibug68", noise=4.0)
    assert found.seen.unsure
    assert any("says little of" in said for said in found.performance.warnings)
    for name, other in found.seen.unsure.items():
        assert name != other
        assert found.seen.deviations[name] > 0.15


def test_a_lost_face_is_found_again(avatar, performed, drawn):
    _weights, posed = performed(12, seed=4)
    points = drawn(avatar, posed)
    points[4:7] = np.nan
    points[7:] = drawn(avatar, posed[7:], turn=(-35.0, -10.0, 20.0), place=(-200.0, 60.0, -1100.0))
    found = fit_landmarks(avatar, points, "ibug68", camera=facegen.Pinhole.of_view(40, (1280, 720)), noise=0.2)
    assert np.flatnonzero(~found.performance.found).tolist() == [4, 5, 6]
    assert np.isnan(found.residuals[4:7]).all()
    assert found.worst < 0.5
    assert any("3 of 12 frames" in said for said in found.performance.warnings)


def test_a_steadier_fit_follows_more_slowly(avatar, performed, drawn):
    _, posed = performed(20, seed=2)
    points = drawn(avatar, posed) + np.random.default_rng(0).normal(0, 2.0, (20, 68, 2))
    shaking = [np.abs(np.diff(fit_landmarks(avatar, points, "ibug68", change=change, noise=2.0).performance.weights,
                              axis=0)).mean() for change in (0.3, 10.0)]
    assert shaking[0] < 0.7 * shaking[1]


# -- beside the obvious way -----------------------------------------------------------------------------------------

def test_one_frame_is_the_least_of_its_energy(avatar, drawn):
    """The same energy, handed to SciPy's general minimiser."""
    rows, share, indices = layout_points(avatar, "ibug68", None)
    few = ["jawOpen", "mouthClose", "mouthSmileLeft", "mouthSmileRight", "browInnerUp", "browDownLeft", "mouthPucker",
           "eyeBlinkLeft"]
    points, camera = rig_points(avatar, rows, wanted(avatar, few)), facegen.Pinhole.of_view(40, (1280, 720))
    goal = drawn(avatar, [avatar.pose_shapes({"jawOpen": 0.5, "mouthSmileLeft": 0.6, "browInnerUp": 0.4})])[0][indices]
    goal = goal + np.random.default_rng(4).normal(0, 1.0, goal.shape)
    rules = Rules(1.0, rounds=60)
    start = State(np.zeros(8), HeadPose(rotation(14, 4, -4), np.array([18.0, 12.0, -690.0])), share)
    found = solve(points, camera, goal, share, start, rules)

    def energy(p):
        places = points.places(p[6:]) @ rotation(*p[:3]).T + p[3:6] * (1, 1, 10)
        off = camera.project(places) - goal
        return 0.5 * share @ (off**2).sum(axis=1) + rules.sparsity * p[6:].sum()

    begin = np.concatenate([[14, 4, -4, 18, 12, -69.0], np.full(8, 0.02)])
    best = minimize(energy, begin, method="L-BFGS-B", bounds=[(None, None)] * 6 + [(0, 1)] * 8,
                    options={"maxiter": 3000, "maxfun": 400_000, "ftol": 1e-12, "gtol": 1e-6})
    assert found.cost <= best.fun + 1e-3 * abs(best.fun)


def test_without_a_price_it_is_least_squares(avatar, performed):
    """Markers in space: SciPy's least_squares over weights and pose, from the same beginning."""
    _weights, posed = performed(1, seed=9)
    marks = [name for name in avatar.landmarks if not name.startswith("eye_center")]
    goal = np.array([avatar.landmark_points(posed[0])[name] for name in marks])
    goal = (goal + np.random.default_rng(7).normal(0, 0.3, goal.shape)) @ rotation(*TURN).T + PLACE
    picked = ["jawOpen", "mouthSmileLeft", "mouthSmileRight", "browInnerUp", "mouthPucker", "eyeBlinkLeft"]
    found = fit_markers(avatar, goal, marks, shapes=picked, sparsity=0.0, scale=1.0)
    rows = np.array([avatar.landmark_points(avatar.mesh().vertices)[name] for name in marks])
    moves = np.array([[avatar.landmark_points(avatar.pose_shapes({shape: 1.0}))[name] for name in marks]
                      for shape in picked]) - rows

    def off(p):
        return ((rows + np.tensordot(p[6:], moves, 1)) @ rotation(*p[:3]).T + p[3:6] - goal).ravel()

    best = least_squares(off, np.full(12, 0.1), bounds=([-np.inf] * 6 + [0.0] * 6, [np.inf] * 6 + [1.0] * 6),
                         xtol=1e-12, ftol=1e-12, gtol=1e-12)
    assert of(found.performance, picked)[0] == pytest.approx(best.x[6:], abs=2e-3)
    assert found.performance.head[0] == pytest.approx(best.x[:3], abs=0.02)


def test_frame_by_frame_is_the_same_as_all_at_once(avatar, performed, drawn):
    _, posed = performed(5)
    points, camera = drawn(avatar, posed), facegen.Pinhole.of_view(40, (1280, 720))
    whole = fit_landmarks(avatar, points, "ibug68", camera=camera, fps=30).performance
    tracker, used = landmark_tracker(avatar, "ibug68", camera=camera)
    for k, frame in enumerate(points):
        state = tracker.step(frame[used], 1 / 30 if k else 0.0)
        row = dict(zip(tracker.points.names, tracker.points.weights(state.x).tolist(), strict=True))
        assert {name: row[name] for name in whole.names} == pytest.approx(whole.frame(k), abs=1e-9)
    assert tracker.step(np.full((len(used), 2), np.nan)) is None


def test_a_weak_camera_may_have_a_middle(avatar, drawn):
    posed = [avatar.mesh().vertices]
    points = drawn(avatar, posed)
    one, other = (fit_landmarks(avatar, points, "ibug68", camera=WeakCamera(centre)).performance
                  for centre in ((0.0, 0.0), (640.0, 360.0)))
    assert one.head == pytest.approx(other.head, abs=1e-6)
    assert np.abs(other.place[0, :2] - (20, 10)).max() < 3.0
