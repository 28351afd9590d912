"""Draw every picture of the documentation anew: python docs/make_images.py (about a minute)."""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from facegen import save_image
from facegen.cli import main

IMAGES = Path(__file__).parent / "images"


def run(*argv: object) -> None:
    """Run one command or stop."""
    if main([str(word) for word in argv]):
        raise SystemExit(1)


if __name__ == "__main__":
    IMAGES.mkdir(exist_ok=True)
    run("gallery", "-o", IMAGES)
    run("render", "happiness", "-o", IMAGES / "happiness.png", "--size", 640)
    with tempfile.TemporaryDirectory() as folder:
        run("figures", "-o", folder, "--size", 256)
        for face in ("akimoto-1986", "akimoto"):
            with Image.open(Path(folder) / face / "figures.png") as sheet:
                save_image(np.asarray(sheet), IMAGES / f"figures-{face}.webp")
