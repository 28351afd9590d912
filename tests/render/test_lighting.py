"""Named lights: the default is the renderer's own, each is another, and wrong files are refused."""

from __future__ import annotations

import numpy as np
import pytest

import facegen
from facegen.data import tables_dir
from facegen.errors import InputError, TableError
from facegen.render.lighting import DEFAULT, light_names, load_light, read_lights
from facegen.render.scene import Scene


def test_the_default_is_the_renderers_own():
    assert load_light() == load_light(DEFAULT) == Scene()
    assert light_names()[0] == DEFAULT


def test_every_light_is_another_and_none_burns_out():
    face = facegen.load_face()
    pictures = {name: facegen.render(face, size=64, detail=0, scene=load_light(name), renderer="soft")
                for name in light_names()}
    assert {"portrait", "left", "right", "top", "even", "backlit"} <= set(pictures)
    assert len({picture.tobytes() for picture in pictures.values()}) == len(pictures)
    for name, picture in pictures.items():
        head = picture[20:44, 22:42, :3]
        assert 20 < head.mean() < 200, name
        assert (head == 255).all(axis=2).mean() < 0.02, name


def test_left_is_the_subjects():
    face = facegen.load_face()
    left, right = (facegen.render(face, size=64, detail=0, scene=load_light(name), renderer="soft").astype(float)
                   for name in ("left", "right"))
    assert left[24:44, 34:42].mean() > left[24:44, 22:30].mean() + 15
    assert right[24:44, 34:42].mean() < right[24:44, 22:30].mean() - 15
    assert np.abs(left[:, ::-1] - right).mean() < 1


def test_an_unknown_light():
    with pytest.raises(InputError, match=r"light: expected portrait, .*got 'lefft'; did you mean 'left'"):
        load_light("lefft")


@pytest.mark.parametrize(("old", "new", "words"), [
    ("spread: 5", "spraed: 5", r"lights\.portrait\.lights\.0: unknown key 'spraed'; did you mean 'spread'"),
    ("[-0.46, 0.56, 0.88]", "[0, 0, 0]", r"lights\.0\.towards: expected a direction"),
    ("[0.70, 0.68, 0.655]", "[0.70, -0.68, 0.655]", r"lights\.0\.colour: expected three numbers of 0 or more"),
    ("sky: [0.40, 0.41, 0.43]", "sky: blue", r"portrait\.sky: expected three numbers"),
    ("source:", "sauce:", "unknown key 'sauce'; did you mean 'source'"),
])
def test_wrong_files(tmp_path, old, new, words):
    text = (tables_dir() / "lights.yaml").read_text(encoding="utf-8")
    assert old in text
    page = tmp_path / "lights.yaml"
    page.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(TableError, match=words):
        read_lights(page)
