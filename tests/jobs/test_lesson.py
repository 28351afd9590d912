"""Lessons of sounds: three views of the mouth, slowly."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from facegen.errors import FileError, InputError, NotationError
from facegen.jobs.lesson import _mouth, _Views, lesson, save_lesson, save_lesson_sheet


def labels(made):
    return [made.speech.sounds[k].label for k in made.shown]


def test_a_consonant_stands_between_vowels():
    made = lesson("TH S")
    assert labels(made) == ["TH", "S"]
    assert [one.label for one in made.speech.sounds] == ["ə", "TH", "ə", "sil", "ə", "S", "ə"]
    assert [one.label for one in lesson("i u").speech.sounds] == ["i", "sil", "u"]
    assert [one.label for one in lesson("θ, ɹi, u").speech.sounds] == ["ə", "θ", "ə", "sil", "ɹ", "i", "sil", "u"]
    assert labels(lesson("θ, ɹi, u")) == ["θ", "ɹ", "i", "u"]
    assert labels(lesson("θɹi")) == ["θ", "ɹ", "i"]                     # a word is said as it is


def test_it_is_slow():
    assert lesson("TH", slow=8).speech.duration == pytest.approx(2 * lesson("TH", slow=4).speech.duration)
    assert lesson("TH", slow=4).frames(25) == round(25 * lesson("TH", slow=4).speech.duration)


def test_captions():
    made = lesson("TH")
    one = made.speech.sounds[1]
    assert made.caption((one.start + one.end) / 2) == "θ  TH   as in thin: the tongue's tip between the teeth"
    assert made.caption(0.0) == ""


def test_a_film_and_a_sheet(tmp_path):
    made = lesson("M", slow=1)
    path = save_lesson(made, tmp_path / "m.gif", size=64, fps=5, face="akimoto-1986")
    with Image.open(path) as film:
        assert film.size == (192, 64 + 16)
        assert 2 < film.n_frames <= made.frames(5)
    sheet = save_lesson_sheet(lesson("AY"), tmp_path / "ay.png", size=64, face="akimoto-1986")
    with Image.open(sheet) as picture:
        assert picture.size == (192, 2 * (64 + 16))                     # a diphthong has two mouths
    assert not [one for one in tmp_path.iterdir() if one not in (path, sheet)]


def test_the_tongue_is_seen_where_the_sound_needs_it():
    """In the view cut open: the red of the tongue is high in front at t, high behind at k, low at a."""
    views = _Views("akimoto", 128)

    def tongue(sounds):
        made = lesson(sounds)
        one = made.speech.sounds[made.shown[0]]
        vertices = views.rig.pose(made.clip.at((one.start + one.end) / 2), detail=2)
        return vertices[views.rig.mesh(2).part_vertices("tongue")]

    def height(at, low, high):
        return at[(at[:, 2] > low) & (at[:, 2] < high), 1].max()

    t, k, a, i = map(tongue, ("T", "K", "AA", "IY"))
    assert height(t, 0, 30) > height(k, 0, 30) + 5                      # the tip at the ridge
    assert height(k, -45, -25) > height(t, -45, -25) + 5                # the back at the soft palate
    assert height(i, -25, -5) > height(a, -25, -5) + 8
    ridge = views.rig.mesh(2).vertices[views.rig.mesh(2).part_vertices("teeth_upper")]
    front = ridge[(np.abs(ridge[:, 0]) < 2) & (ridge[:, 2] > 5) & (ridge[:, 2] < 13)]
    tip = t[t[:, 2].argmax()]
    assert np.linalg.norm(front - tip, axis=1).min() < 6.0
    th = tongue("TH")
    assert th[:, 2].max() > ridge[:, 2].max()                           # the tip beyond the upper teeth


def test_bad_input(tmp_path):
    with pytest.raises(InputError, match="expected sounds or text, one of the two"):
        lesson()
    with pytest.raises(NotationError, match="position 1: 'QQ' is no code"):
        lesson("QQ")
    with pytest.raises(InputError, match="slow: expected a factor"):
        lesson("TH", slow=0)
    with pytest.raises(InputError, match="expected one sound or more"):
        lesson(" , ")
    with pytest.raises(FileError, match=r"a name that ends in \.png"):
        save_lesson_sheet(lesson("TH"), tmp_path / "a.gif", size=64)
    with pytest.raises(InputError, match="size: expected whole pixels of each view"):
        save_lesson(lesson("TH"), tmp_path / "a.gif", size=5)
    blank = SimpleNamespace(name="blank", landmark_points=lambda vertices, detail: {"chin": vertices[0]})
    with pytest.raises(InputError, match=r"face: blank has no landmark mouth_corner_L and mouth_corner_R"):
        _mouth(blank, np.zeros((3, 3)), 2)
    with pytest.raises(InputError, match="200 pictures at most on one sheet"):
        save_lesson_sheet(lesson("AA " * 201), tmp_path / "a.png", size=64)
    assert not list(tmp_path.iterdir())
