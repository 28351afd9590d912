"""A small VRM avatar with a real face: a shipped head on a figure of humanoid bones, in metres."""

from __future__ import annotations

from pathlib import Path

import gltfs
import numpy as np
import yaml

from facegen.data import meshes_dir
from facegen.fileio.avatar import load_avatar, save_avatar
from facegen.transfer.landmarks import load_landmarks

# Bone -> its parent and its place beside it, metres: those that VRM 1.0 requires.
BONES = {"hips": (None, (0, 1.0, 0)), "spine": ("hips", (0, 0.2, 0)), "head": ("spine", (0, 0.45, 0)),
         **{f"{side}{name}": (parent and f"{side}{parent}" if parent not in ("hips", "spine") else parent,
                              (x * sign, y, 0))
            for side, sign in (("left", 1), ("right", -1))
            for name, parent, x, y in (("UpperLeg", "hips", 0.1, -0.1), ("LowerLeg", "UpperLeg", 0, -0.4),
                                       ("Foot", "LowerLeg", 0, -0.4), ("UpperArm", "spine", 0.2, 0.2),
                                       ("LowerArm", "UpperArm", 0.3, 0), ("Hand", "LowerArm", 0.3, 0))}}
HEAD = 1.65         # metres above the ground
SIZE = 0.12         # metres for each unit of the cartoon's file
META = {"name": "a", "authors": ["b"], "licenseUrl": "https://vrm.dev/licenses/1.0/"}


def vrm_avatar(folder: Path, *, version: str = "1.0", expressions: dict | None = None) -> tuple[Path, Path]:
    """Return the cartoon as ``a.vrm`` and its landmarks: VRM 1.0 looks to +z, 0.x to -z."""
    neutral = load_avatar(meshes_dir() / "avatars/cartoon/cartoon.obj")
    points = load_landmarks(meshes_dir() / "avatars/cartoon/landmarks.yaml", neutral.mesh).points(neutral.mesh.vertices)
    found, data = gltfs.parts_of(save_avatar(neutral, folder / "head.glb", {}))
    turn = 1.0 if version == "1.0" else -1.0
    nodes, number = found["nodes"], {}
    face = list(range(len(nodes)))
    for bone, (parent, at) in BONES.items():
        number[bone] = len(nodes)
        nodes.append({"name": bone, "translation": [turn * at[0], at[1], at[2]]})
        if parent is not None:
            nodes[number[parent]].setdefault("children", []).append(number[bone])
    half_turn = {} if turn > 0 else {"rotation": [0.0, 1.0, 0.0, 0.0]}
    nodes[number["head"]]["children"] = [len(nodes)]
    nodes.append({"name": "face", "children": face, "scale": [SIZE] * 3, **half_turn})
    found["scenes"][0]["nodes"] = [number["hips"]]
    if version == "1.0":
        extension = {"VRMC_vrm": {
            "specVersion": "1.0", "meta": META,
            "humanoid": {"humanBones": {bone: {"node": node} for bone, node in number.items()}},
            **({"expressions": expressions} if expressions else {})}}
    else:
        extension = {"VRM": {"specVersion": "0.0", "exporterVersion": "test", "humanoid": {
            "humanBones": [{"bone": bone, "node": node} for bone, node in number.items()]}}}
    found["extensionsUsed"], found["extensions"] = list(extension), extension
    path, marks = folder / "a.vrm", folder / "a.yaml"
    path.write_bytes(gltfs.glb(found, data))
    places = {name: (at * SIZE * [turn, 1, turn] + [0, HEAD, 0]).tolist() for name, at in points.items()}
    marks.write_text(yaml.safe_dump({"landmarks": places}))
    return path, marks


def bound(path: Path) -> dict[str, np.ndarray]:
    """Return the presets of a VRM 1.0 file that bind morph targets as displacements (n, 3) of its vertices."""
    found, _ = gltfs.parts_of(path)
    avatar = load_avatar(path)
    result = {}
    for name, one in found["extensions"]["VRMC_vrm"]["expressions"]["preset"].items():
        if "morphTargetBinds" not in one:
            continue
        result[name] = np.zeros_like(avatar.mesh.vertices)
        for bind in one["morphTargetBinds"]:
            node = found["nodes"][bind["node"]]
            target = found["meshes"][node["mesh"]]["extras"]["targetNames"][bind["index"]]
            own = avatar.mesh.part_vertices(node["name"])
            result[name][own] += bind["weight"] * avatar.shapes[target][own]
    return result
