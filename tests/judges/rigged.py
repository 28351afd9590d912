"""What the judges judge: avatars of every kind, rigged with shapes of many sorts."""

from __future__ import annotations

import base64
import io
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import cKDTree

from facegen.data import meshes_dir
from facegen.fileio.avatar import AvatarFile, load_avatar, save_avatar
from facegen.geometry.mesh import Mesh, merge
from facegen.transfer.halfway import half_name
from facegen.transfer.rig import rig

sys.path.insert(0, str(Path(__file__).parents[1] / "fileio"))
import gltfs


def missing(what: str) -> None:
    """Skip the test, or fail it where every judge must be there."""
    if os.environ.get("FACEGEN_CI"):
        pytest.fail(f"{what}: must be installed where FACEGEN_CI is set")
    pytest.skip(what)


def picture(uri: str) -> np.ndarray:
    """Return a picture (h, w, 3) from its data: URI."""
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))).convert("RGB")).astype(float)


def bumps(vertices: np.ndarray, count: int = 6, seed: int = 1) -> dict[str, np.ndarray]:
    """Return smooth shapes (n, 3), each local, then one that moves all and one that moves nothing."""
    rng = np.random.default_rng(seed)
    size = np.ptp(vertices, axis=0).max()
    shapes = {}
    for i in range(count):
        centre = vertices[rng.integers(len(vertices))]
        weight = np.exp(-((vertices - centre) ** 2).sum(axis=1) / (0.1 * size) ** 2)
        shapes[f"bump {i}"] = np.where(weight > 0.02, weight, 0.0)[:, None] * rng.normal(size=3) * 0.1 * size
    shapes["all"] = rng.normal(size=vertices.shape) * 0.01 * size
    shapes["nothing"] = np.zeros_like(vertices)
    return shapes


SHAPES = ("eyeBlinkLeft", "eyeLookOutRight", "jawOpen", "mouthSmileLeft", "browInnerUp", "cheekPuff", "tongueOut")


def rigged_cartoon(folder: Path) -> tuple[Path, AvatarFile, dict[str, np.ndarray]]:
    """Return a whole shipped avatar, rigged: its file, the avatar before, and its shapes."""
    made = rig("cartoon", folder / "cartoon.glb", sets=["arkit"], shapes=SHAPES)
    return made.path, load_avatar(meshes_dir() / "avatars/cartoon/cartoon.obj"), \
        {name: made.found.shapes[name] for name in SHAPES} \
        | {half_name(name): moved for name, moved in made.found.halves.items()}


def rows_of(avatar: AvatarFile, name: str, points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return which vertices of the avatar's part that an object's name begins with lie nearest to points, and how far
    the farthest is."""
    part = max((part for part in avatar.mesh.parts if name.startswith(part)), key=len)
    own = avatar.mesh.part_vertices(part)
    away, rows = cKDTree(avatar.mesh.vertices[own]).query(points)
    return own[rows], float(away.max())


def figure() -> AvatarFile:
    """Return a figure of two parts and three materials, such as an OBJ file holds."""
    vertices, faces = gltfs.ball(24, 16)
    half = (np.arange(len(faces)) % 2).astype(np.int32)
    head = Mesh(vertices * [0.9, 1.2, 1.0], faces, ("skin", "lips"), half, ("head",), np.zeros(len(faces), int))
    hat = Mesh.of(vertices * 0.3 + [0, 1.4, 0], faces, material="felt", part="hat")
    return AvatarFile(Path("figure.obj"), "obj", merge([head, hat]), {"skin": (224, 172, 140), "felt": (40, 60, 160)})


def written(kind: str, folder: Path, **options) -> tuple[Path, AvatarFile, dict[str, np.ndarray]]:
    """Return a rigged avatar of a kind, the avatar before, and its shapes."""
    avatar = figure() if kind == "obj" else load_avatar(gltfs.write(folder / f"{kind}.glb", *gltfs.KINDS[kind]()))
    shapes = bumps(avatar.mesh.vertices)
    return save_avatar(avatar, folder / f"{kind}-rigged.glb", shapes, notes={"version": 1}, **options), avatar, shapes
