"""Draw every picture of the documentation anew: python docs/make_images.py (about a minute)."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from facegen import Wireframe, contact_sheet, load_face, render, render_passes, rig, save_image, save_passes
from facegen.animation.speech_script import say, speech_clip
from facegen.cli import main
from facegen.jobs.lesson import lesson, save_lesson_sheet

IMAGES = Path(__file__).parent / "images"
FACE = load_face()
SIZE = 320


def run(*argv: object) -> None:
    """Run one command or stop."""
    if main([str(word) for word in argv]):
        raise SystemExit(1)


def strip(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return pictures side by side."""
    return np.concatenate([picture[..., :3] for picture in pictures], axis=1)


def pass_strip() -> NDArray[np.uint8]:
    """Return depth, normals, parts and landmarks of one pose side by side, as their files show them."""
    options = {"size": SIZE, "view": (25, 0)}
    found = render_passes(FACE, "happiness", passes=("depth", "normal", "part", "landmarks"), **options)
    with tempfile.TemporaryDirectory() as folder:
        paths = save_passes(found, f"{folder}/")
        depth, normal, part = (Image.open(paths[name]) for name in ("depth", "normal", "part"))
        grey = np.asarray(depth)
        # Light is near; eight bits are enough to look at.
        grey = np.where(grey > 0, 255 - grey // 280, 0).astype(np.uint8)
        shown = [np.repeat(grey[..., None], 3, axis=2), np.asarray(normal), np.asarray(part.convert("RGB"))]
    picture = Image.fromarray(render(FACE, "happiness", **options)[..., :3])
    draw, points = ImageDraw.Draw(picture), found["landmarks"]
    for (x, y), visible in zip(points.xy, points.visible, strict=True):
        draw.ellipse((x - 2.5, y - 2.5, x + 2.5, y + 2.5), fill=(20, 150, 70) if visible else (200, 40, 40))
    return strip([*shown, np.asarray(picture)])


def said() -> NDArray[np.uint8]:
    """Return the middles of the sounds of "my baby" in a row each: at rest, and over a smile."""
    rows, labels = [], []
    for below in (None, "happiness"):
        words = say(phonemes="M AY1 B EY1 B IY0")
        clip = speech_clip(words, expression=None if below is None else FACE.resolve(below))
        for start, end, label, _ in words.speech.visemes:
            rows.append(render(FACE, clip.at((start + end) / 2), size=160))
            labels.append(label)
    return contact_sheet(rows, labels, columns=len(rows) // 2)


def avatars() -> NDArray[np.uint8]:
    """Return the shipped avatars in rows: neutral and four poses."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name in ("human", "cartoon", "cat", "horse"):
            path = rig(name, f"{folder}/{name}.glb", sets=["units", "expressions"]).path
            face = load_face(path)
            rows.append(strip([render(face, pose, size=SIZE, view=(20, 0))
                               for pose in ("neutral", "happiness", "surprise", "anger", "43E")]))
    return np.concatenate(rows, axis=0)


def layouts() -> NDArray[np.uint8]:
    """Return where the points of the landmark layouts lie on the base face and on the shipped avatars, row by row."""
    from facegen.fitting.fit import layout_points
    from facegen.geometry.camera import frame

    rows = []
    with tempfile.TemporaryDirectory() as folder:
        faces = [FACE]
        for name in ("human", "cartoon", "cat"):
            rig(name, f"{folder}/{name}.glb", sets=["arkit"])
            faces.append(load_face(f"{folder}/{name}.glb"))
        for layout, pose in (("ibug68", {"27": 0.6}), ("mediapipe478", {"12": 0.5})):
            drawn = []
            for face in faces:
                neutral, posed = face.mesh().vertices, face.pose(pose)
                near = slice(None) if getattr(face, "focus", None) is None else face.focus
                camera = frame(neutral[near], posed[near], size=(SIZE, SIZE))
                picture = Image.fromarray(render(face, pose, size=SIZE)[..., :3])
                pen = ImageDraw.Draw(picture)
                for x, y, _ in camera.project(layout_points(face, layout, None)[0] @ posed):
                    pen.ellipse((x - 1.6, y - 1.6, x + 1.6, y + 1.6), fill=(235, 40, 40))
                drawn.append(np.asarray(picture))
            rows.append(strip(drawn))
    return np.concatenate(rows)


if __name__ == "__main__":
    IMAGES.mkdir(exist_ok=True)
    run("gallery", "-o", IMAGES)
    run("render", "happiness", "-o", IMAGES / "happiness.png", "--size", 640)
    save_image(strip([
        render(FACE, "surprise", size=SIZE, shading="flat", wireframe=True),
        render(FACE, "surprise", size=SIZE, detail=2, view=(30, 0), wireframe=Wireframe(lines="cage")),
    ]), IMAGES / "wireframe.webp")
    save_image(strip([render(FACE, "anger", size=SIZE, view=(35, 0), shadows=shadows) for shadows in (False, True)]),
               IMAGES / "shadows.webp")
    save_image(pass_strip(), IMAGES / "passes.webp")
    save_image(said(), IMAGES / "speech.webp")
    save_lesson_sheet(lesson("p, f, θ, t, k, ʃ, s, n, ɹ, ɑ, ɛ, i, ɔ, u"), IMAGES / "sounds.webp", size=160, columns=2)
    save_image(avatars(), IMAGES / "avatars.webp")
    save_image(layouts(), IMAGES / "layouts.webp")
    with tempfile.TemporaryDirectory() as folder:
        run("figures", "-o", folder, "--size", 256)
        for face in ("akimoto-1986", "akimoto"):
            with Image.open(Path(folder) / face / "figures.png") as sheet:
                save_image(np.asarray(sheet), IMAGES / f"figures-{face}.webp")
