"""Figures and the stage: colours, picking, the latest pose wins, faults are told."""

import threading

import numpy as np
import pytest
from fake_client import FakeClient

import facegen
from facegen.geometry.mesh import Mesh
from facegen.studio.figure import SCALE, Figure, coloured
from facegen.studio.stage import Stage

face = facegen.load_face()
mesh = face.mesh(1)


@pytest.fixture
def client():
    return FakeClient()


@pytest.fixture
def stage(client):
    faults = []
    made = Stage(client, faults.append)
    made.faults = faults
    yield made
    made.close()


def test_every_triangle_has_one_colour():
    groups = coloured(mesh, face.colours)
    assert np.array_equal(np.sort(np.concatenate([faces for _, faces in groups])), np.arange(len(mesh.faces)))
    assert len({colour for colour, _ in groups}) == len(groups)


def test_of_a_mouth_only_the_inside_is_drawn_where_it_is_known(client):
    turned = facegen.Mesh(mesh.vertices, mesh.faces[:, ::-1], mesh.materials, mesh.face_materials, mesh.parts,
                          mesh.face_parts)
    for one, sides in ((mesh, {"front", "double"}), (turned, {"double"})):
        assert {handle.side for handle, _ in Figure(client.scene, "face", one)._handles} == sides
    lining = mesh.face_materials == mesh.materials.index("mouth")
    [rows] = [rows for handle, rows in Figure(client.scene, "face", mesh)._handles if handle.side == "front"]
    assert np.array_equal(rows, np.unique(mesh.faces[lining]))


def test_colours_of_vertices_are_gathered_into_a_few_near_ones():
    rng = np.random.default_rng(0)
    base = np.array([[220, 170, 150], [90, 50, 40], [240, 240, 235]], float)
    kind = rng.integers(0, 3, len(mesh.vertices))
    kind[:] = (mesh.vertices[:, 1] > 0) + (mesh.vertices[:, 1] > 60)
    given = np.clip(base[kind] + rng.normal(0, 2, (len(kind), 3)), 0, 255)
    painted = facegen.Mesh(mesh.vertices, mesh.faces, mesh.materials, mesh.face_materials, mesh.parts,
                           mesh.face_parts, given)
    groups = coloured(painted)
    assert np.array_equal(np.sort(np.concatenate([faces for _, faces in groups])), np.arange(len(mesh.faces)))
    for colour, faces in groups:
        assert np.median(np.abs(given[mesh.faces[faces]].mean(axis=1) - colour).max(axis=1)) < 20


@pytest.mark.parametrize("offset", [(0, 0, 0), (150, -20, 5)])
def test_a_ray_meets_the_nearest_place_on_the_posed_vertices(client, offset):
    figure = Figure(client.scene, "face", mesh, offset=offset)
    posed = face.pose("27", detail=1)
    figure.show(posed)
    rng = np.random.default_rng(1)
    for row in rng.integers(0, len(mesh.faces), 30):
        weights = rng.dirichlet((2, 2, 2))
        point = weights @ posed[mesh.faces[row]]
        eye = np.array([30.0, 10.0, 900.0])
        hit = figure.pick((eye + offset) * SCALE, point - eye)
        # Whatever is met lies on the ray, not behind the point aimed at, and where it says it lies.
        along = (hit.point - eye) @ (point - eye) / ((point - eye) @ (point - eye))
        assert hit.point == pytest.approx(eye + along * (point - eye), abs=1e-6)
        assert along <= 1.0 + 1e-9
        assert hit.point == pytest.approx(np.array(hit.barycentric) @ posed[mesh.faces[hit.face]], abs=1e-9)
        if hit.face == row:
            assert hit.barycentric == pytest.approx(weights, abs=1e-6)
    assert figure.pick((0, 0, 9), (0, 0, 1)) is None


def test_what_is_shown_is_what_was_posed(client, stage):
    stage.put("face", mesh, colours=face.colours)
    posed = face.pose("happiness", detail=1)
    stage.request("face", lambda: posed)
    assert stage.settle()
    shown = [one for one in client.scene.made if one.kind == "mesh_simple"]
    assert sum(len(one.faces) for one in shown) == len(mesh.faces)
    places = np.concatenate([one.vertices[one.faces].reshape(-1, 3) for one in shown])
    assert np.unique(places.round(5), axis=0) == pytest.approx(
        np.unique((posed[np.unique(mesh.faces)] * SCALE).astype(np.float32).round(5), axis=0))


def test_the_latest_pose_wins_and_nothing_queues(client, stage):
    stage.put("face", mesh)
    asked, gate, shown = [], threading.Event(), []
    stage.on_shown("face", shown.append)

    def pose(k):
        def made():
            asked.append(k)
            gate.wait(10)
            return mesh.vertices + k
        return made

    stage.request("face", pose(0))
    while not asked:
        pass
    for k in range(1, 100):
        stage.request("face", pose(k))
    gate.set()
    assert stage.settle()
    assert asked == [0, 99]
    assert stage.figures["face"].vertices == pytest.approx(mesh.vertices + 99)
    assert len(shown) == 2


def test_a_pose_that_fails_is_told_and_the_next_is_shown(stage):
    stage.put("face", mesh)
    stage.request("face", lambda: face.pose("happines", detail=1))
    assert stage.settle()
    stage.request("face", lambda: mesh.vertices + 1)
    assert stage.settle()
    assert [type(one) for one in stage.faults] == [facegen.InputError]
    assert stage.figures["face"].vertices == pytest.approx(mesh.vertices + 1)


def test_a_pose_of_the_face_before_is_not_shown_on_the_next(stage):
    stage.put("face", mesh)
    stage.put("face", face.mesh(2))
    stage.request("face", lambda: mesh.vertices + 1)
    assert stage.settle()
    assert stage.faults == []
    assert np.array_equal(stage.figures["face"].vertices, face.mesh(2).vertices)


def test_riders_go_along_until_they_leave(stage):
    stage.put("face", mesh)
    seen = []
    leave = stage.on_shown("face", lambda vertices: seen.append(vertices[0, 0]))
    stage.request("face", lambda: mesh.vertices + 1)
    stage.settle()
    leave()
    leave()
    stage.request("face", lambda: mesh.vertices + 2)
    stage.settle()
    assert seen == [mesh.vertices[0, 0] + 1]


def test_a_figure_that_was_removed_is_asked_in_vain():
    figure = Figure(FakeClient().scene, "one", Mesh.of(np.eye(3), [[0, 1, 2]]))
    figure.remove()
    figure.show(2 * np.eye(3))
    figure.visible(False)
    figure.fade(0.5)
