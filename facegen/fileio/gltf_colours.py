"""The colours of a glTF file: base colour factors, textures looked up at the vertices, and vertex colours.

Khronos, "glTF 2.0 Specification", sections 3.8.4 (samplers), 3.9.2 (base colour) and KHR_texture_transform. What Pillow
cannot read is unknown, not an error: nothing but pictures depends on it.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError
from facegen.fileio.gltf_accessors import Accessors
from facegen.fileio.gltf_file import read_uri
from facegen.fileio.jsontree import Tree
from facegen.fileio.srgb import to_linear, to_srgb

# Because a vertex looks up one place: finer texels than these cost time and show nothing.
_SIDE = 1024
# Because a picture of one colour takes few bytes and much memory: a face needs 4096 x 4096.
_MOST_PIXELS, _MOST_PIXELS_IN_ALL = 70_000_000, 300_000_000
_REPEAT, _CLAMP, _MIRROR = 10497, 33071, 33648


class Colours:
    """Looks up the colours of one file."""

    def __init__(self, tree: Tree, accessors: Accessors) -> None:
        self._tree, self._accessors = tree, accessors
        self._images: dict[int, NDArray[np.float64] | None] = {}
        self._pixels = 0

    def of_vertices(self, attributes: Tree, material: Tree | None, count: int
                    ) -> tuple[NDArray[np.float64] | None, bool]:
        """Return linear 0..1 (count, 3), None if unknown, and whether they differ from vertex to vertex."""
        factor, texture = _base(material)
        result, varies = np.tile(factor, (count, 1)), False
        if texture is not None:
            texels = self._looked_up(texture, attributes, count)
            if texels is None:
                return None, False
            result, varies = result * texels, True
        if (reference := attributes.get("COLOR_0")) is not None:
            kind = "VEC4" if self._tree.items("accessors")[self._accessors.index(reference)]["type"].value == "VEC4" \
                else "VEC3"
            result = result * np.clip(self._accessors.floats(reference, kind, count=count)[:, :3], 0.0, 1.0)
            varies = True
        return result, varies

    def _looked_up(self, texture: Tree, attributes: Tree, count: int) -> NDArray[np.float64] | None:
        """Return the texture's linear colours (count, 3) at the vertices; its mean if they have no place in it."""
        textures = self._tree.items("textures")
        one = textures[texture["index"].index(len(textures), "texture")]
        picture = self._image(one)
        if picture is None:
            return None
        transform = (texture.get("extensions") or Tree({}, texture.path)).get("KHR_texture_transform")
        channel = next((t["texCoord"].integer() for t in (transform, texture) if t and t.get("texCoord")), 0)
        reference = attributes.get(f"TEXCOORD_{channel}")
        if reference is None:
            return np.tile(picture.reshape(-1, 3).mean(axis=0), (count, 1))
        places = self._accessors.floats(reference, "VEC2", count=count).astype(np.float64)
        if transform:
            places = _transformed(places, transform)
        return _sampled(picture, places, *self._wraps(one))

    def _wraps(self, texture: Tree) -> tuple[int, int]:
        samplers = self._tree.items("samplers")
        if not texture.get("sampler"):
            return _REPEAT, _REPEAT
        one = samplers[texture["sampler"].index(len(samplers), "sampler")]
        return tuple(one[key].integer() if one.get(key) else _REPEAT for key in ("wrapS", "wrapT"))

    def _image(self, texture: Tree) -> NDArray[np.float64] | None:
        """Return a texture's picture (h, w, 3), linear, or None."""
        extensions = texture.get("extensions") or Tree({}, texture.path)
        sources = [extensions.get("EXT_texture_webp"), extensions.get("EXT_texture_avif"), texture]
        source = next((s["source"] for s in sources if s and s.get("source")), None)
        if source is None:
            return None
        images = self._tree.items("images")
        number = source.index(len(images), "image")
        if number not in self._images:
            self._images[number] = self._decoded(images[number])
        return self._images[number]

    def _decoded(self, image: Tree) -> NDArray[np.float64] | None:
        if image.get("bufferView"):
            data = bytes(self._accessors.view(image["bufferView"])[0])
        elif image.get("uri"):
            try:
                data = read_uri(image["uri"])
            except FileError:                       # not there, or elsewhere: facegen reads nothing outside the folder
                return None
        else:
            return None
        from PIL import Image

        try:
            with Image.open(io.BytesIO(data)) as picture:
                self._pixels += math.prod(picture.size)
                if math.prod(picture.size) > _MOST_PIXELS or self._pixels > _MOST_PIXELS_IN_ALL:
                    return None
                picture.draft("RGB", (_SIDE, _SIDE))
                factor = max(1, max(picture.size) // _SIDE)
                small = picture.convert("RGB").reduce(factor)
                return to_linear(np.asarray(small))
        except Exception:                           # whatever a broken picture makes a decoder raise
            return None


def _base(material: Tree | None) -> tuple[NDArray[np.float64], Tree | None]:
    """Return a material's linear base colour (3,) and its texture, if any."""
    if material is None:
        return np.ones(3), None
    old = (material.get("extensions") or Tree({}, material.path)).get("KHR_materials_pbrSpecularGlossiness")
    properties = old or material.get("pbrMetallicRoughness") or Tree({}, material.path)
    names = ("diffuseFactor", "diffuseTexture") if old else ("baseColorFactor", "baseColorTexture")
    factor = properties.get(names[0])
    return np.array(factor.numbers(4)[:3]) if factor else np.ones(3), properties.get(names[1])


def _transformed(places: NDArray[np.float64], transform: Tree) -> NDArray[np.float64]:
    offset, scale = ([*(transform[key].numbers(2) if transform.get(key) else default)]
                     for key, default in (("offset", (0.0, 0.0)), ("scale", (1.0, 1.0))))
    angle = transform["rotation"].number() if transform.get("rotation") else 0.0
    c, s = math.cos(angle), math.sin(angle)
    with np.errstate(all="ignore"):
        return (places * scale) @ np.array([[c, -s], [s, c]]) + offset


def _sampled(picture: NDArray[np.float64], places: NDArray[np.float64], wrap_s: int, wrap_t: int
             ) -> NDArray[np.float64]:
    """Return the picture (h, w, 3) between its texels at (u, v) places (n, 2); v runs down."""
    size = np.array(picture.shape[1::-1])
    # Because beyond this a float32 place has no fraction left; it also keeps the whole numbers small.
    at = np.clip(np.nan_to_num(places), -1e6, 1e6) * size - 0.5
    low = np.floor(at).astype(np.int64)
    part = at - low
    columns = [_wrapped(low[:, 0] + step, size[0], wrap_s) for step in (0, 1)]
    rows = [_wrapped(low[:, 1] + step, size[1], wrap_t) for step in (0, 1)]
    u, v = part[:, :1], part[:, 1:]
    top = picture[rows[0], columns[0]] * (1 - u) + picture[rows[0], columns[1]] * u
    bottom = picture[rows[1], columns[0]] * (1 - u) + picture[rows[1], columns[1]] * u
    return top * (1 - v) + bottom * v


def _wrapped(index: NDArray[np.int64], size: int, wrap: int) -> NDArray[np.int64]:
    if wrap == _CLAMP:
        return np.clip(index, 0, size - 1)
    if wrap == _MIRROR:
        index = index % (2 * size)
        return np.minimum(index, 2 * size - 1 - index)
    return index % size


def mean_colour(light: NDArray[np.float64], corners: NDArray, vertices: NDArray[np.float64]) -> tuple[float, ...]:
    """Return the sRGB 0..255 mean of vertex colours (n, 3), linear, over triangles (m, 3), by their area."""
    p = vertices[corners]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    if not np.isfinite(area.sum()) or area.sum() <= 0:
        area = np.ones(len(corners))
    mean = np.average(light[corners].mean(axis=1), axis=0, weights=area)
    return tuple(float(c) for c in to_srgb(mean))


def as_screen(light: Mapping[int, NDArray[np.float64]], count: int) -> NDArray[np.float64]:
    """Return sRGB 0..255 (count, 3) of blocks of linear colours by their first row; white where none is known."""
    result = np.full((count, 3), 255.0)
    for start, block in light.items():
        result[start:start + len(block)] = to_srgb(block)
    return result
