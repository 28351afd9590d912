"""What a rig brings for its look: its materials' colours, and which of it a portrait shows.

A file knows colours, not how eyes shine. What a material is, is guessed from its name and from the parts that wear it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.mesh import Mesh
from facegen.render.scene import CLAY, MATERIALS, Scene
from facegen.transfer.piece_names import kind_of_name, words_of

# Word of a name -> our material, before the kinds of pieces; the first that is found counts.
_WORDS = {"lash": "lashes", "lashes": "lashes", "eyelash": "lashes", "eyelashes": "lashes", "brow": "brows",
          "brows": "brows", "eyebrow": "brows", "eyebrows": "brows", "lip": "lips", "lips": "lips",
          "nostril": "nostril", "nostrils": "nostril", "gum": "gums", "gums": "gums", "pupil": "pupil",
          "pupils": "pupil", "iris": "iris", "irises": "iris", "limbus": "limbus", "hair": "hair", "hairs": "hair",
          "beard": "hair", "moustache": "hair", "mustache": "hair", "mane": "hair"}
_KINDS = {"eye": "sclera", "teeth": "teeth", "tongue": "tongue", "mouth": "mouth", "skin": "skin"}


def dressed(scene: Scene, thing: Any, mesh: Mesh) -> Scene:
    """Return the scene with the materials of a mesh that the thing brings colours for.

    thing: anything; only what has ``colours`` (material -> sRGB 0..255, missing ones unknown) changes the scene.
    """
    colours: Mapping[str, tuple[float, float, float]] | None = getattr(thing, "colours", None)
    if colours is None or isinstance(thing, Mesh):
        return scene
    made = {}
    for index, name in enumerate(mesh.materials):
        like = scene.materials.get(_kind(name, mesh, index), CLAY)
        made[name] = replace(like, albedo=tuple(colours[name])) if name in colours else like
    return replace(scene, materials={**scene.materials, **made})


def _kind(name: str, mesh: Mesh, index: int) -> str:
    """Return which of our materials a mesh's is like, or nothing."""
    if name in MATERIALS:
        return name
    used = np.bincount(mesh.face_parts[mesh.face_materials == index], minlength=len(mesh.parts))
    for text in (name, mesh.parts[int(used.argmax())] if used.any() else ""):
        words = words_of(text)
        found = next((kind for word, kind in _WORDS.items() if word in words), None) or _KINDS.get(kind_of_name(text))
        if found:
            return found
    return ""


def portrait(thing: Any, vertices: NDArray) -> NDArray:
    """Return those of a thing's vertices (n, 3) that a picture frames: all, or what its ``focus`` names."""
    rows = getattr(thing, "focus", None)
    return vertices if rows is None else vertices[rows]


