"""Khronos' gltf-validator finds nothing to complain of in what facegen writes."""

from __future__ import annotations

import gltfs
import numpy as np
import pytest
from rigged import bumps, figure, written

from facegen.fileio.avatar import load_avatar, save_avatar


def complaints(report):
    """Return the errors and warnings of a report."""
    return [one for one in report["issues"]["messages"] if one["severity"] < 2]


@pytest.mark.parametrize("kind", ["obj", *gltfs.KINDS])
@pytest.mark.parametrize("options", [{}, {"normals": False}], ids=["normals", "positions"])
def test_no_error_and_no_warning(tmp_path, validate, kind, options):
    path, avatar, _ = written(kind, tmp_path, **options)
    report = validate(path)
    assert complaints(report) == []
    assert report["info"]["hasMorphTargets"]
    if kind != "obj":       # the file was valid before, so that every complaint would be ours
        assert complaints(validate(avatar.path)) == []


@pytest.mark.parametrize("options", [{}, {"normals": False}, {"quantise": True}],
                         ids=["full", "positions", "quantised"])
def test_a_shipped_avatar_that_facegen_rigged(tmp_path, validate, cartoon, options):
    path, avatar, shapes = cartoon
    if options:
        path = save_avatar(avatar, tmp_path / "cartoon.glb", shapes, **options)
    report = validate(path)
    assert complaints(report) == []
    assert report["info"]["drawCallCount"] >= len(avatar.mesh.parts)


@pytest.mark.parametrize("kind", ["obj", "shared", "morphing"])
def test_a_second_time(tmp_path, validate, kind):
    path, _, _ = written(kind, tmp_path)
    avatar = load_avatar(path)
    shapes = {"bump 1": 2 * avatar.shapes["bump 1"], "more": avatar.shapes["all"]}
    assert complaints(validate(save_avatar(avatar, tmp_path / "again.glb", shapes))) == []


@pytest.mark.parametrize("kind", ["obj", "plain", "instanced", "quantised", "morphing", "seams"])
def test_quantised_motion(tmp_path, validate, kind):
    path, _, _ = written(kind, tmp_path, quantise=True)
    report = validate(path)
    assert complaints(report) == []
    assert "KHR_mesh_quantization" in report["info"]["extensionsUsed"]


def test_text_files(tmp_path, validate):
    avatar = load_avatar(gltfs.write(tmp_path / "a.gltf", *gltfs.seams()))
    for name in ("b.gltf", "b.glb"):
        path = save_avatar(avatar, tmp_path / name, bumps(avatar.mesh.vertices))
        assert complaints(validate(path)) == []


def test_vertices_with_colours(tmp_path, validate):
    avatar = figure()
    avatar = type(avatar)(avatar.path, "ply", avatar.mesh, {}, np.full_like(avatar.mesh.vertices, 128.0))
    path = save_avatar(avatar, tmp_path / "a.glb", bumps(avatar.mesh.vertices))
    assert complaints(validate(path)) == []
