"""glTF files for tests, built by hand: as awkward as the format allows, each valid."""

from __future__ import annotations

import base64
import copy
import io
import json
import struct
from pathlib import Path

import numpy as np
from PIL import Image

FLOAT, U8, I8, U16, I16, U32 = 5126, 5121, 5120, 5123, 5122, 5125
DTYPES = {FLOAT: "<f4", U8: "u1", I8: "i1", U16: "<u2", I16: "<i2", U32: "<u4"}
WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def ball(columns=12, rows=8):
    """Return a closed ball: vertices (n, 3) and faces (m, 3), without a seam."""
    theta = np.linspace(0, np.pi, rows + 1)[1:-1, None]
    phi = np.linspace(0, 2 * np.pi, columns, endpoint=False)[None]
    ring = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi, np.sin(theta) * np.cos(phi)], -1)
    vertices = np.concatenate([[[0, 1, 0]], ring.reshape(-1, 3), [[0, -1, 0]]])
    index = 1 + np.arange((rows - 1) * columns).reshape(rows - 1, columns)
    after = np.roll(index, -1, axis=1)
    top = np.stack([np.zeros(columns, int), index[0], after[0]], -1)
    bottom = np.stack([np.full(columns, len(vertices) - 1), after[-1], index[-1]], -1)
    a, b, c, d = index[:-1].ravel(), index[1:].ravel(), after[1:].ravel(), after[:-1].ravel()
    return vertices, np.concatenate([top, np.stack([a, b, c], -1), np.stack([a, c, d], -1), bottom])


class Build:
    """A glTF file in the making."""

    def __init__(self):
        self.data = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
                     "accessors": [], "bufferViews": []}

    def view(self, data, **more):
        self.data += bytes(-len(self.data) % 4)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **more})
        self.data += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values, kind=FLOAT, *, bounds=False, target=None, normalised=False, sparse=None):
        """Add packed values (n, width); sparse: only these rows are written, the rest are zero."""
        values = np.asarray(values, DTYPES[kind])
        values = values.reshape(len(values), -1)
        one = {"componentType": kind, "count": len(values), "type": WIDTHS[values.shape[1]]}
        if normalised:
            one["normalized"] = True
        if bounds:
            one.update(min=values.min(axis=0).tolist(), max=values.max(axis=0).tolist())
        if sparse is None:
            width = values.dtype.itemsize * values.shape[1]
            if target == 34962 and width % 4:       # vertex data stand in steps of four bytes
                padded = np.zeros((len(values), width + -width % 4), "u1")
                padded[:, :width] = values.view("u1").reshape(len(values), width)
                one["bufferView"] = self.view(padded.tobytes(), target=target, byteStride=padded.shape[1])
            else:
                one["bufferView"] = self.view(values.tobytes(), **({"target": target} if target else {}))
        else:
            rows = np.asarray(sparse, "<u2")
            one["sparse"] = {"count": len(rows),
                             "indices": {"bufferView": self.view(rows.tobytes()), "componentType": U16},
                             "values": {"bufferView": self.view(values[rows].tobytes())}}
        self.json["accessors"].append(one)
        return len(self.json["accessors"]) - 1

    def points(self, vertices, **more):
        return self.accessor(vertices, bounds=True, target=34962, **more)

    def primitive(self, vertices, faces, *, normals=True, **more):
        attributes = {"POSITION": self.points(vertices)}
        if normals:
            unit = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
            attributes["NORMAL"] = self.accessor(unit, target=34962)
        return {"attributes": attributes, "indices": self.accessor(np.ravel(faces), U16, target=34963), **more}

    def mesh(self, *primitives, **more):
        self.json["meshes"].append({"primitives": list(primitives), **more})
        return len(self.json["meshes"]) - 1

    def node(self, *, root=True, **more):
        self.json["nodes"].append(more)
        if root:
            self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]) - 1)
        return len(self.json["nodes"]) - 1

    def result(self):
        self.json["buffers"] = [{"byteLength": len(self.data)}]
        return self.json, self.data


def glb(found, data=b"", rest=b""):
    text = json.dumps(found).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text
    if data:
        body += struct.pack("<II", len(data), 0x004E4942) + data
    body += rest
    return struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body


def write(path, found, data=b""):
    """Write a GLB, or a .gltf with its buffer beside it or in it (``data`` None: as the JSON says)."""
    path = Path(path)
    if path.suffix == ".gltf":
        found = copy.deepcopy(found)
        found["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        path.write_text(json.dumps(found))
    else:
        path.write_bytes(glb(found, data))
    return path


def parts_of(path):
    """Return the JSON and the binary chunk of a GLB file."""
    raw = Path(path).read_bytes()
    size, = struct.unpack_from("<I", raw, 12)
    return json.loads(raw[20:20 + size]), raw[28 + size:]


def png(pixels):
    stream = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(stream, "PNG")
    return stream.getvalue()


# -- kinds: each returns JSON and buffer ----------------------------------------------------------------------
def plain():
    b = Build()
    b.node(mesh=b.mesh(b.primitive(*ball())), name="Ball")
    return b.result()


def transformed():
    """A hierarchy with a matrix, a turn, a mirror; one node is not in the scene."""
    b = Build()
    mesh = b.mesh(b.primitive(*ball()), name="Ball")
    child = b.node(root=False, mesh=mesh, name="Child", rotation=[0, 0, 0.6, 0.8], scale=[0.5, 2, -1])
    b.node(name="Parent", children=[child], matrix=[0, 0, -2, 0, 0, 2, 0, 0, 2, 0, 0, 0, 1, 2, 3, 1])
    b.node(root=False, mesh=mesh, name="Hidden")
    return b.result()


def shared():
    """Two primitives on one set of vertices, a fan, and points that are kept."""
    b = Build()
    vertices, faces = ball()
    first = b.primitive(vertices, faces[:40])
    second = {"attributes": first["attributes"], "indices": b.accessor(faces[40:].ravel(), U16, target=34963),
              "material": 0}
    fan = {"attributes": {"POSITION": b.points([[2, 0, 0], [3, 0, 0], [3, 1, 0], [2, 1, 0]])}, "mode": 6}
    dots = {"attributes": {"POSITION": b.points([[5, 5, 5], [6, 6, 6]])}, "mode": 0}
    b.json["materials"] = [{"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0.0, 0.0, 1]}}]
    b.node(mesh=b.mesh(first, second, fan, dots), name="Both")
    return b.result()


def instanced():
    """One mesh on two nodes, side by side."""
    b = Build()
    mesh = b.mesh(b.primitive(*ball()), name="Eye")
    b.node(mesh=mesh, name="Eye_L", translation=[2, 0, 0])
    b.node(mesh=mesh, name="Eye_R", translation=[-2, 0, 0], scale=[2, 2, 2])
    return b.result()


def interleaved():
    """Positions and normals in turns in one bufferView, corners as bytes."""
    b = Build()
    vertices, faces = ball()
    both = np.concatenate([vertices, vertices], axis=1).astype("<f4")
    view = b.view(both.tobytes(), byteStride=24, target=34962)
    low, high = both[:, :3].min(axis=0).tolist(), both[:, :3].max(axis=0).tolist()
    b.json["accessors"] += [
        {"bufferView": view, "componentType": FLOAT, "count": len(vertices), "type": "VEC3", "min": low, "max": high},
        {"bufferView": view, "byteOffset": 12, "componentType": FLOAT, "count": len(vertices), "type": "VEC3"}]
    corners = b.accessor(faces.ravel(), U8, target=34963)
    b.node(mesh=b.mesh({"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": corners}), name="Ball")
    return b.result()


def quantised():
    """Normalised shorts, scaled by the node (KHR_mesh_quantization)."""
    b = Build()
    vertices, faces = ball()
    position = b.points(np.rint(vertices * 32767), kind=I16, normalised=True)
    normal = b.accessor(np.rint(vertices * 127), I8, target=34962, normalised=True)
    corners = b.accessor(faces.ravel(), U16, target=34963)
    b.node(mesh=b.mesh({"attributes": {"POSITION": position, "NORMAL": normal}, "indices": corners}), name="Ball",
           scale=[3, 3, 3])
    b.json.update(extensionsUsed=["KHR_mesh_quantization"], extensionsRequired=["KHR_mesh_quantization"])
    return b.result()


def morphing():
    """Morph targets of its own, dense and sparse, named in the mesh, weights and an animation of them."""
    b = Build()
    vertices, faces = ball()
    primitive = b.primitive(vertices, faces)
    top = np.where(vertices[:, 1:2] > 0.5, [0, 0.3, 0], 0.0)
    side = np.where(vertices[:, :1] > 0.9, [0.2, 0, 0], 0.0)
    primitive["targets"] = [
        {"POSITION": b.points(top), "NORMAL": b.accessor(top * 0, target=34962)},
        {"POSITION": b.accessor(side, bounds=True, sparse=np.flatnonzero(side.any(axis=1))),
         "NORMAL": b.accessor(side * 0, target=34962)}]
    node = b.node(mesh=b.mesh(primitive, extras={"targetNames": ["blink", "smile"], "more": [1]}, weights=[0, 0.5]),
                  name="Face", weights=[0.25, 0])
    times = b.accessor([0, 1, 2], bounds=True)
    weights = b.accessor([0, 0, 1, 0.5, 0, 1])
    b.json["animations"] = [{"samplers": [{"input": times, "output": weights}],
                             "channels": [{"sampler": 0, "target": {"node": node, "path": "weights"}}]}]
    return b.result()


def skin():
    """A skin whose rest pose is not its bind pose."""
    b = Build()
    vertices, faces = ball()
    primitive = b.primitive(vertices, faces)
    upper = np.clip(vertices[:, 1] + 0.5, 0, 1)
    weights = np.stack([1 - upper, upper, 0 * upper, 0 * upper], -1)
    joints = np.stack([0 * upper, upper > 0, 0 * upper, 0 * upper], -1)
    primitive["attributes"]["JOINTS_0"] = b.accessor(joints, U8, target=34962)
    primitive["attributes"]["WEIGHTS_0"] = b.accessor(weights, target=34962)
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, 1, 3] = -0.5
    head = b.node(root=False, name="head", translation=[0, 1, 0], rotation=[0, 0, 0.6, 0.8])
    hips = b.node(root=False, name="hips", children=[head], scale=[2, 2, 2])
    b.node(name="armature", children=[hips], rotation=[0, 0.6, 0, 0.8])
    b.node(mesh=b.mesh(primitive), skin=0, name="Body")
    b.json["skins"] = [{"joints": [hips, head], "inverseBindMatrices": b.accessor(bind.transpose(0, 2, 1))}]
    return b.result()


def seams():
    """A cube with hard edges: eight places, 24 vertices; and a ball split at a UV seam with a texture."""
    b = Build()
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    vertices, normals, faces = [], [], []
    for axis in range(3):
        for sign in (-1, 1):
            side = corners[corners[:, axis] == sign]
            first = len(vertices)
            vertices += side.tolist()
            normals += [(np.eye(3)[axis] * sign).tolist()] * 4
            quad = [[0, 1, 3], [0, 3, 2]]
            a, c, d = side[0], side[1], side[3]
            if np.cross(c - a, d - a)[axis] * sign < 0:
                quad = [one[::-1] for one in quad]
            faces += [[first + i for i in one] for one in quad]
    cube = {"attributes": {"POSITION": b.points(vertices), "NORMAL": b.accessor(normals, target=34962)},
            "indices": b.accessor(np.ravel(faces), U8, target=34963)}
    b.node(mesh=b.mesh(cube), name="Cube")
    points, corners = ball()
    split = np.concatenate([points, points[1:8]])
    again = np.where((corners >= 1) & (corners < 8) & (np.arange(len(corners))[:, None] % 2 == 0),
                     corners + len(points) - 1, corners)
    skin_ = b.primitive(split, again, material=0)
    places = np.stack([np.where(split[:, 0] > 0, 0.75, 0.25), np.full(len(split), 0.5)], -1)
    skin_["attributes"]["TEXCOORD_0"] = b.accessor(places, target=34962)
    picture = np.full((64, 64, 3), [200, 150, 120])
    picture[:, 32:] = [20, 60, 180]
    b.json.update(images=[{"bufferView": b.view(png(picture)), "mimeType": "image/png"}], textures=[{"source": 0}],
                  materials=[{"name": "two", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}])
    b.node(mesh=b.mesh(skin_), name="Head", translation=[4, 0, 0])
    return b.result()


def vrm():
    """A VRM 1.0 avatar, as far as its expressions go."""
    found, data = morphing()
    found["extensionsUsed"] = ["VRMC_vrm"]
    found["extensions"] = {"VRMC_vrm": {
        "specVersion": "1.0", "meta": {"name": "a", "authors": ["b"], "licenseUrl": "https://vrm.dev/licenses/1.0/"},
        "humanoid": {"humanBones": {}},
        "expressions": {"preset": {
            "happy": {"morphTargetBinds": [{"node": 0, "index": 1, "weight": 1.0}], "isBinary": True},
            "sad": {"overrideMouth": "block"}}}}}
    return found, data


KINDS = {one.__name__: one for one in (plain, transformed, shared, instanced, interleaved, quantised, morphing, skin,
                                       seams, vrm)}
