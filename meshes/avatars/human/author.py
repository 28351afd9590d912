"""Author the avatar "human": the head of an old man. Writes human.obj, human.mtl and landmarks.yaml.

    python meshes/avatars/human/author.py [FOLDER]

The head is a cage of quads in rows and loops (head_cage, eyes, mouth, ears) laid over the general shape of facegen's
own base face, aged (age), subdivided once by Catmull and Clark's rules (quads), furrowed and dressed (parts). The
file is in centimetres, +y up, +z forward, with the origin in the middle of the neck's opening; the head is turned a
little, as heads are.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from age import furrow, push_clay
from ears import EARS, add_ear, relief
from eyes import EYES, add_lids, eyeball, press_on_ball
from head_cage import BaseShape, head_cage, key
from mouth import CONTACT, add_lips, add_nostrils, close_lips, facing_pairs
from numpy.typing import NDArray
from parts import Part, brows, fringe, lining, teeth, tongue
from quads import Cage, best_fans, catmull_clark, vertex_normals

SEED = 1986
BORDER, BALL_EDGE, POCKET = 3, 5, 6          # rings: the lips' border; the lids' inner edge and their pocket


@dataclass
class Skin:
    """The subdivided skin, and which fine vertices come from which loops of the cage."""

    cage: Cage
    lips: list[list]
    lids: list[list[list]]
    ears: list[tuple[list, list]]
    nostrils: list
    places: NDArray
    quads: NDArray
    edges: NDArray                           # of the cage

    def __post_init__(self) -> None:
        self.n = len(self.cage.place)
        self.coarse = np.array(self.cage.quads)
        self.edge = {tuple(e): i for i, e in enumerate(self.edges.tolist())}

    def loop(self, keys: list) -> NDArray:
        """Return the fine vertices on a closed loop of keys: its vertices and the points of its edges, in order."""
        i = [self.cage.index[k] for k in keys]
        return np.array([j for a, b in zip(i, i[1:] + i[:1], strict=True)
                         for j in (a, self.n + self.edge[min(a, b), max(a, b)])])

    def spread(self, keys, *, whole: bool = False) -> NDArray:
        """Return a weight (fine vertices,), 1 at the keys; ``whole``: only where all around are keys."""
        w = np.zeros(self.n)
        w[[self.cage.index[k] for k in keys]] = 1.0
        mean = np.minimum.reduce if whole else np.mean
        return np.concatenate([w, mean(w[self.edges], axis=1), mean(w[self.coarse], axis=1)])


def make_skin() -> Skin:
    """Return the aged skin, subdivided, with relief, furrows and lids on the eyeballs."""
    base, cage = BaseShape(), head_cage()
    lips, nostrils = add_lips(cage, base.project), add_nostrils(cage)
    ears = [add_ear(cage, ear) for ear in EARS]
    cage.place = list(push_clay(np.array(cage.place)))
    lids = [add_lids(cage, eye) for eye in EYES]
    places, quads, edges = catmull_clark(np.array(cage.place), np.array(cage.quads))
    skin = Skin(cage, lips, lids, ears, nostrils, places, quads, edges)
    for ear, (front, _) in zip(EARS, ears, strict=True):
        rows = skin.spread(front, whole=True) == 1.0
        local = ear.local(places[rows])
        places[rows] = ear.place(local[:, 0], local[:, 1], relief(local[:, 0], local[:, 1]))
    for k in CONTACT:
        close_lips(places, *facing_pairs(skin.loop(lips[k])))
    smooth = [k for ring in lips[BORDER:] for k in ring]
    smooth += [k for rings in lids for ring in rings[3:] for k in ring]
    smooth += [k for _, every in ears for k in every] + nostrils
    normals = vertex_normals(places, quads)
    depth = furrow(places, normals, lambda r, c: cage.index[key(r, c)]) * (1.0 - skin.spread(smooth))
    skin.places = places + normals * depth[:, None]
    for eye, rings in zip(EYES, lids, strict=True):
        press_on_ball(skin.places, eye, skin.loop(rings[BALL_EDGE]), skin.loop(rings[POCKET]))
    return skin


def skin_part(skin: Skin) -> Part:
    """Return the skin with its materials: lips, nostrils, the inner side of the lips."""
    lip = skin.spread([k for ring in skin.lips[BORDER:7] for k in ring], whole=True) == 1
    inside = skin.spread([k for ring in skin.lips[6:] for k in ring], whole=True) == 1
    nostril = skin.spread(skin.nostrils, whole=True) == 1
    part = Part("skin")
    names = []
    quads = best_fans(skin.places, skin.quads)
    for q in quads:
        found = (name for name, rows in (("nostril", nostril), ("cheeks", inside), ("lips", lip)) if rows[q].all())
        names.append(next(found, "skin"))
    part.add(skin.places, [tuple(q) for q in quads.tolist()], names)
    return part


def author() -> tuple[list[Part], Skin]:
    """Return all parts, millimetres, in the frame of the base face."""
    rng = np.random.default_rng(SEED)
    skin = make_skin()
    normals = vertex_normals(skin.places, skin.quads)
    parts = [skin_part(skin)]
    for eye in EYES:
        part = Part("eye_L" if eye.sign > 0 else "eye_R")
        part.add(*eyeball(eye))
        parts.append(part)
    parts += [teeth("teeth_upper"), teeth("teeth_lower"), tongue(), lining()]
    parts.append(brows(skin.places, normals, rng))
    bare = skin.spread([k for _, every in skin.ears for k in every]) == 0
    parts.append(fringe(skin.places[bare], rng))
    return parts, skin


if __name__ == "__main__":
    from write import write

    write(*author(), Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
