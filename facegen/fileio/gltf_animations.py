"""Animations of morph target weights, for meshes that get more targets: a frame needs a number for each."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from facegen.fileio.gltf_accessors import Accessors
from facegen.fileio.gltf_append import Appended
from facegen.fileio.jsontree import Tree


def pad_weights(appended: Appended, tree: Tree, accessors: Accessors, counts: Mapping[int, tuple[int, int]]) -> None:
    """Give the animated weights of nodes their new length; new targets stay at rest.

    tree: the original JSON. counts: node -> number of targets before and now. FileError for an animation of the
    weights by pointer (KHR_animation_pointer), which facegen leaves to its author.
    """
    for a, animation in enumerate(tree.items("animations")):
        for c, channel in enumerate(animation.items("channels")):
            target = channel["target"]
            if target["path"].text() == "pointer":
                _refuse_weights(target)
            node = target.get("node")
            if target["path"].text() != "weights" or node is None or node.integer() not in counts:
                continue
            before, now = counts[node.integer()]
            samplers = animation.items("samplers")
            number = channel["sampler"].index(len(samplers), "sampler")
            values = accessors.floats(samplers[number]["output"], "SCALAR")
            if not before or now == before or len(values) % before:
                continue                            # no animation of these targets: nothing to keep in step
            padded = np.zeros((len(values) // before, now), np.float32)
            padded[:, :before] = values.reshape(-1, before)
            mine = appended.json["animations"][a]
            mine["samplers"].append({**mine["samplers"][number], "output": appended.floats(padded.ravel(), "SCALAR")})
            mine["channels"][c]["sampler"] = len(mine["samplers"]) - 1


def _refuse_weights(target: Tree) -> None:
    extension = (target.get("extensions") or Tree({}, target.path)).get("KHR_animation_pointer")
    if extension and extension["pointer"].text().endswith("/weights"):
        raise extension["pointer"].error("animates all weights of a mesh at once by pointer, which facegen cannot "
                                         "lengthen; remove this animation")
