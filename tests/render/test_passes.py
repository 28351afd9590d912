"""Passes against what geometry says: planes, spheres, known layouts, the camera's own projection."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image
from shapes import box, sphere

from facegen import load_face
from facegen.errors import FileError, InputError
from facegen.geometry.mesh import Mesh, merge
from facegen.render import PASSES, render, render_passes, save_passes
from facegen.render.passes import ARRAY_PASSES

BALL = sphere()


def tilted_plane(cells=5):
    """A square through the origin, z = 0.4 x - 0.3 y, in many triangles."""
    k = np.linspace(-1, 1, cells + 1)
    x, y = (a.ravel() for a in np.meshgrid(k, k, indexing="ij"))
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    faces = np.concatenate([np.stack([a, a + cells + 1, a + cells + 2], 1), np.stack([a, a + cells + 2, a + 1], 1)])
    return Mesh.of(np.stack([x, y, 0.4 * x - 0.3 * y], axis=1), faces)


def rays(camera):
    """Origin (h, w, 3) and unit direction (h, w, 3) of the line of sight through each pixel's centre, world axes."""
    y, x = np.indices((camera.height, camera.width)) + 0.5
    towards = np.stack(camera.rays(x, y), axis=-1) @ camera.rotation
    right = (x - camera.offset[0]) / camera.scale
    up = -(y - camera.offset[1]) / camera.scale
    at = camera.target + right[..., None] * camera.rotation[0] + up[..., None] * camera.rotation[1]
    return at, -towards


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("view", [(0, 0), (35, -20)])
def test_a_planes_depth_and_normal_are_exact(orthographic, view):
    mesh = tilted_plane()
    found = render_passes(mesh, passes=("depth", "normal", "triangle"), size=(120, 90), view=view,
                          orthographic=orthographic)
    camera = found.camera
    normal = np.array([-0.4, 0.3, 1.0]) / np.sqrt(1.25)
    at, direction = rays(camera)
    places = at - (at @ normal / (direction @ normal))[..., None] * direction
    expected = camera.distance - (places - camera.target) @ camera.rotation[2]
    hit = found["triangle"] >= 0
    assert hit.sum() > 1500
    np.testing.assert_allclose(found["depth"][hit], expected[hit], rtol=3e-7)
    expected = np.broadcast_to(camera.rotation @ normal, (hit.sum(), 3))
    np.testing.assert_allclose(found["normal"][hit], expected, atol=1e-6)
    assert np.isinf(found["depth"][~hit]).all()
    assert (found["normal"][~hit] == 0).all()
    inside = np.abs(places[..., :2]).max(axis=-1)
    assert hit[inside < 0.98].all()
    assert not hit[inside > 1.02].any()


@pytest.mark.parametrize("shading", ["smooth", "flat"])
@pytest.mark.parametrize("orthographic", [False, True])
def test_a_spheres_normals_point_away_from_its_centre(shading, orthographic):
    ball = sphere(rings=60, centre=(3, 1, -2))
    found = render_passes(ball, passes=("depth", "normal"), size=200, view=(-30, 25), shading=shading,
                          orthographic=orthographic)
    camera, hit = found.camera, np.isfinite(found["depth"])
    y, x = np.nonzero(hit)
    zoom = camera.scale * (1 if orthographic else camera.distance / found["depth"][hit])
    local = np.stack([(x + 0.5 - camera.offset[0]) / zoom, (camera.offset[1] - y - 0.5) / zoom,
                      camera.distance - found["depth"][hit]], axis=1) + camera.rotation @ (camera.target - [3, 1, -2])
    np.testing.assert_allclose(np.linalg.norm(local, axis=1), 1, atol=0.002)       # depth puts it on the sphere
    normal = found["normal"][hit]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-6)
    cosine = (normal * local).sum(axis=1) / np.linalg.norm(local, axis=1)
    assert np.degrees(np.arccos(np.clip(cosine.min(), -1, 1))) < (0.5 if shading == "smooth" else 3)
    if shading == "smooth":
        assert len(np.unique(normal[:, 0])) > 0.9 * len(normal)


def two_boxes():
    return merge([box("skin", half=(1, 1, 0.2), centre=(-1, 0, 0), part="right"),
                  box("hair", half=(1, 0.5, 0.2), centre=(1, 0, 0), part="left"),
                  box("skin", half=(0.3, 0.3, 0.2), centre=(-1, 0, 1), part="front")])


def test_parts_and_materials_lie_where_they_were_laid():
    mesh = two_boxes()
    found = render_passes(mesh, passes=["part", "material", "triangle"], size=(160, 80), orthographic=True)
    camera = found.camera

    def at(x, y):
        column, row = camera.project(np.array([[x, y, 0.2]]))[0, :2].astype(int)
        return found["part"][row, column], found["material"][row, column]

    assert (found.parts, found.materials) == (("right", "left", "front"), ("skin", "hair"))
    assert at(-1.6, 0.5) == (1, 1)
    assert at(1.5, 0.2) == (2, 2)
    assert at(1.5, 0.8) == (0, 0)
    assert at(-1.1, 0.1) == (3, 1)
    ids = found["triangle"]
    np.testing.assert_array_equal(found["part"], np.where(ids >= 0, mesh.face_parts[ids] + 1, 0))
    assert (found["part"] == 3).sum() == pytest.approx((0.6 * camera.scale) ** 2, rel=0.05)


def test_the_inner_side_has_a_normal_towards_the_viewer():
    mesh = tilted_plane()
    found = render_passes(mesh, passes=("normal", "triangle"), size=64, view=(180, 0))
    hit = found["triangle"] >= 0
    assert hit.any()
    assert (found["normal"][hit][:, 2] > 0.8).all()


def test_types_and_shapes_are_as_promised():
    found = render_passes(BALL, passes=ARRAY_PASSES, size=(48, 40))
    assert {name: (array.dtype.name, array.shape) for name, array in found.items()} == {
        "depth": ("float32", (40, 48)), "normal": ("float32", (40, 48, 3)), "part": ("uint8", (40, 48)),
        "material": ("uint8", (40, 48)), "triangle": ("int32", (40, 48))}
    alone = render_passes(BALL, passes=["normal"], size=(48, 40))
    np.testing.assert_array_equal(alone["normal"], found["normal"])
    assert list(alone) == ["normal"]


def test_passes_lie_pixel_for_pixel_over_the_picture():
    face = load_face()
    options = {"size": 96, "view": (25, 5), "detail": 1}
    alpha = render(face, "surprise", background="transparent", **options)[..., 3]
    covered = render_passes(face, "surprise", passes=("part",), **options)["part"] > 0
    assert covered[alpha == 255].all()
    assert not covered[alpha == 0].any()


def test_bands_join_without_a_seam():
    large = render_passes(BALL, passes=("depth", "triangle"), size=900)
    column = np.flatnonzero(large["triangle"][:, 450] >= 0)
    np.testing.assert_array_equal(np.diff(column), 1)
    assert np.abs(np.diff(large["depth"][column, 450], n=2)[5:-5]).max() < 0.01


def test_feature_points_are_where_the_camera_projects_them():
    face = load_face()
    found = render_passes(face, "happiness", passes=("feature_points", "depth"), size=128, detail=1, view=(30, 0))
    points, vertices = found["feature_points"], face.pose("happiness", detail=1)
    places = face.feature_point_places(vertices, detail=1)
    assert points.names == tuple(places) == tuple(face.feature_points)
    np.testing.assert_array_equal(points.places, np.array(list(places.values())))
    expected = found.camera.project(points.places)
    np.testing.assert_array_equal(np.column_stack([points.xy, points.depth]), expected)
    seen = dict(zip(points.names, points.visible, strict=True))
    assert seen["nose_tip"]
    assert seen["mouth_corner_L"]
    assert seen["ear_lower_L"]
    assert not seen["ear_lower_R"]
    assert not seen["tongue_tip"]                        # behind closed lips
    # What is seen lies at the depth of its pixel, up to the slope of the surface within it.
    x, y = points.xy[points.visible].astype(int).T
    assert np.median(np.abs(found["depth"][y, x] - points.depth[points.visible])) < 1.0


def test_landmarks_are_where_the_camera_projects_them():
    face = load_face()
    found = render_passes(face, "surprise", passes=("landmarks",), size=128, view=(-25, 10), detail=1)
    points = found["landmarks"]
    places = face.landmark_points(face.pose("surprise", detail=1), detail=1)
    assert points.names == tuple(places) == face.landmarks
    np.testing.assert_array_equal(np.column_stack([points.xy, points.depth]),
                                  found.camera.project(np.array(list(places.values()))))
    seen = dict(zip(points.names, points.visible.tolist(), strict=True))
    assert all(seen[name] for name in ("nose_tip", "chin", "mouth_top", "mouth_bottom", "eye_outer_R", "brow_mid_R"))
    behind = render_passes(face, "surprise", passes=("landmarks",), size=128, view=(180, 0), detail=1)["landmarks"]
    assert not behind.visible[points.names.index("nose_tip")]


def test_feature_points_follow_the_pose_and_the_level():
    face = load_face()
    rest, smile = (face.feature_point_places(face.pose(what, detail=2)) for what in ("neutral", "happiness"))
    assert smile["mouth_corner_L"][1] - rest["mouth_corner_L"][1] > 2
    np.testing.assert_allclose(smile["mouth_corner_L"] * [-1, 1, 1], smile["mouth_corner_R"], atol=1e-6)
    coarse = face.feature_point_places(face.pose("happiness", detail=0), detail=0)
    for name, place in smile.items():
        np.testing.assert_allclose(place, coarse[name], atol=0.5)
        assert np.linalg.norm(rest[name] - face.feature_points[name]) < 8       # the surface is near its cage
    opened = render_passes(face, "10E+25E+19E+27E", passes=("feature_points",), size=256)["feature_points"]
    assert dict(zip(opened.names, opened.visible, strict=True))["tongue_tip"]
    with pytest.raises(InputError, match=r"^vertices: expected shape \(\d+, 3\) at detail 1"):
        face.feature_point_places(face.mesh(2).vertices, detail=1)


class Needle:
    """A wall with points before, on and behind it, and one beside the picture."""

    def mesh(self, detail):
        return box(half=(1, 1, 0.1))

    def pose(self, what, *, person=None, intensity=1.0, detail=2):
        return self.mesh(detail).vertices

    def feature_point_places(self, vertices, *, detail):
        return {"before": np.array([0.2, 0.1, 0.5]), "on": np.array([0.31, -0.2, 0.1]),
                "behind": np.array([0.2, 0.1, -0.05]), "beside": np.array([5, 0, 0.5]),
                "free": np.array([1.05, 0.0, -0.1])}


@pytest.mark.parametrize("orthographic", [False, True])
def test_points_are_hidden_by_walls_and_by_the_pictures_edge(orthographic):
    points = render_passes(Needle(), passes=["feature_points"], size=64, orthographic=orthographic)["feature_points"]
    assert dict(zip(points.names, points.visible.tolist(), strict=True)) == {
        "before": True, "on": True, "behind": False, "beside": False, "free": True}


def test_zero_area_triangles_hide_nothing_and_change_nothing():
    mesh = two_boxes()
    spoilt = Mesh(mesh.vertices, np.concatenate([mesh.faces, [[0, 0, 0], [0, 1, 1], [0, 5, 0]]]), mesh.materials,
                  np.append(mesh.face_materials, [0, 0, 0]), mesh.parts, np.append(mesh.face_parts, [0, 0, 0]))
    before, after = (render_passes(m, passes=ARRAY_PASSES, size=64) for m in (mesh, spoilt))
    for name in ARRAY_PASSES:
        np.testing.assert_allclose(after[name], before[name], atol=1e-6)


class Bare(Needle):
    """A rig whose data hold no landmarks."""

    name, landmarks = "bare", ()

    def landmark_points(self, vertices, *, detail):
        return {}


@pytest.mark.parametrize(("call", "message"), [
    (lambda: render_passes(BALL, passes=["dept"]), r"^passes: expected .*got 'dept'; did you mean 'depth'"),
    (lambda: render_passes(BALL, passes="depth"), r"^passes: expected a list of names .*got 'depth'"),
    (lambda: render_passes(BALL, passes=[]), r"^passes: expected a list"),
    (lambda: render_passes(BALL, passes=["landmarks"]), r"^passes: 'landmarks' needs a face .*got a Mesh"),
    (lambda: render_passes(Bare(), passes=["landmarks"]), r"^passes: 'landmarks' needs a face .*got bare"),
    (lambda: render_passes(BALL, passes=["feature_points"]), r"^passes: 'feature_points' needs a face"),
    (lambda: render_passes(BALL, shading="flatt"), r"^shading: .*did you mean 'flat'"),
    (lambda: render_passes(BALL, size=5), r"^size: "),
    (lambda: render_passes(BALL, "happiness"), r"^pose: a Mesh"),
    (lambda: render_passes(Mesh(BALL.vertices, BALL.faces, BALL.materials, BALL.face_materials,
                                tuple(f"part{k}" for k in range(256)), BALL.face_parts)),
     r"^passes: 'part' can tell 255 names apart, the mesh has 256"),
])
def test_wrong_wishes_are_named_at_the_door(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_all_names_are_offered():
    assert PASSES == ("depth", "normal", "part", "material", "triangle", "landmarks", "feature_points")


def saved(tmp_path, **options):
    found = render_passes(load_face(), "surprise", passes=(*ARRAY_PASSES, "feature_points"), size=(72, 64), detail=0,
                          **options)
    return found, save_passes(found, tmp_path / "smile", exact=True)


@pytest.mark.parametrize("orthographic", [False, True])
def test_files_give_back_what_was_saved(tmp_path, orthographic):
    found, paths = saved(tmp_path, orthographic=orthographic, view=(20, 10))
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in paths.values()) == sorted([
        *(f"smile.{name}.png" for name in ARRAY_PASSES), "smile.feature_points.json", "smile.passes.json",
        "smile.passes.npz"])
    about = json.loads(paths["passes"].read_text())
    pictures = {name: Image.open(paths[name]) for name in ARRAY_PASSES}

    raw, depth = np.asarray(pictures["depth"]).astype(float), found["depth"]
    assert raw.max() == 65535
    np.testing.assert_array_equal(raw == 0, np.isinf(depth))
    measured = about["depth"]["offset"] + about["depth"]["step"] * raw
    np.testing.assert_allclose(measured[raw > 0], depth[raw > 0], atol=0.51 * about["depth"]["step"] + 1e-4)

    raw = np.asarray(pictures["normal"])
    seen = np.isfinite(depth)
    assert (raw[~seen] == 0).all()
    np.testing.assert_allclose(raw[seen] / 127.5 - 1, found["normal"][seen], atol=0.0041)

    for name, names in (("part", found.parts), ("material", found.materials)):
        assert pictures[name].mode == "P"
        np.testing.assert_array_equal(np.asarray(pictures[name]), found[name])
        labels = about[name]["labels"]
        assert [labels[label]["value"] for label in ("nothing", *names)] == list(range(len(names) + 1))
        assert len({tuple(label["colour"]) for label in labels.values()}) == len(labels)
        row, column = np.argwhere(found[name] == 1)[0]
        assert pictures[name].convert("RGB").getpixel((int(column), int(row))) == tuple(labels[names[0]]["colour"])

    raw = np.asarray(pictures["triangle"]).astype(int)
    np.testing.assert_array_equal(raw @ [1, 256, 65536] - 1, found["triangle"])

    points = json.loads(paths["feature_points"].read_text())
    assert tuple(points) == found["feature_points"].names
    np.testing.assert_allclose([p["xy"] for p in points.values()], found["feature_points"].xy, atol=1e-3)
    assert [p["visible"] for p in points.values()] == found["feature_points"].visible.tolist()
    # The camera as data projects the places to where the points are.
    camera = about["camera"]
    local = np.array([[*p["place"], 1] for p in points.values()]) @ np.array(camera["extrinsics"]).T
    assert camera["projection"] == ("orthographic" if orthographic else "perspective")
    divided = local / (1 if orthographic else local[:, 2:])
    divided[:, 2] = 1
    xy = divided @ np.array(camera["intrinsics"]).T
    np.testing.assert_allclose(xy[:, :2], found["feature_points"].xy, atol=1e-3)
    np.testing.assert_allclose(local[:, 2], found["feature_points"].depth, atol=1e-3)

    with np.load(paths["arrays"]) as arrays:
        for name in ARRAY_PASSES:
            np.testing.assert_array_equal(arrays[name], found[name])
        np.testing.assert_array_equal(arrays["feature_points_xy"], found["feature_points"].xy)


def test_an_empty_view_is_saved_too(tmp_path):
    camera = render_passes(BALL, size=64).camera
    away = render_passes(BALL, BALL.vertices + np.array([0, 1000.0, 0]), camera=camera)
    paths = save_passes(away, f"{tmp_path}/")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["depth.png", "normal.png", "part.png", "passes.json"]
    assert (np.asarray(Image.open(paths["depth"])) == 0).all()


def test_what_cannot_be_saved_is_said_and_nothing_is_harmed(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"^passes: expected what render_passes returned, got a dict"):
        save_passes({}, tmp_path / "a")
    found = render_passes(BALL, size=32, passes=["depth"])
    with pytest.raises(FileError, match=r"the folder .*nowhere does not exist"):
        save_passes(found, tmp_path / "nowhere" / "a")
    (tmp_path / "a.depth.png").mkdir()
    with pytest.raises(FileError, match="is a folder"):
        save_passes(found, tmp_path / "a")
    old = tmp_path / "b.depth.png"
    old.write_bytes(b"precious")

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises(FileError, match="depth pass cannot be written: No space left"):
        save_passes(found, tmp_path / "b")
    assert old.read_bytes() == b"precious"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.depth.png", "b.depth.png"]
