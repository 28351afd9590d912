import os

import numpy as np
import pytest
from PIL import Image

from facegen.errors import FileError, InputError
from facegen.fileio import images
from facegen.fileio.images import check_image_path, contact_sheet, save_image

RNG = np.random.default_rng(5)
PIXELS = RNG.integers(0, 256, (20, 30, 4), dtype=np.uint8)


def read(path):
    with Image.open(path) as image:
        return np.asarray(image)


def test_png_keeps_every_pixel_and_alpha(tmp_path):
    path = save_image(PIXELS, tmp_path / "a.png")
    np.testing.assert_array_equal(read(path), PIXELS)
    save_image(PIXELS[..., :3], str(path))
    np.testing.assert_array_equal(read(path), PIXELS[..., :3])
    assert os.listdir(tmp_path) == ["a.png"]


def test_an_opaque_picture_is_written_without_alpha(tmp_path):
    pixels = PIXELS.copy()
    pixels[..., 3] = 255
    assert read(save_image(pixels, tmp_path / "a.png")).shape == (20, 30, 3)


@pytest.mark.parametrize(("name", "kind"), [("a.JPG", "JPEG"), ("a.jpeg", "JPEG"), ("a.webp", "WEBP")])
def test_other_suffixes_give_other_formats(tmp_path, name, kind):
    smooth = np.full((32, 32, 4), (200, 100, 50, 255), np.uint8)
    path = save_image(smooth, tmp_path / name)
    with Image.open(path) as image:
        assert image.format == kind
        assert np.abs(np.asarray(image.convert("RGB")).astype(int) - smooth[..., :3]).max() <= 4


def test_jpeg_shows_white_through_transparency(tmp_path):
    path = save_image(np.zeros((16, 16, 4), np.uint8), tmp_path / "a.jpg")
    assert read(path).min() >= 253


def test_a_failed_write_leaves_the_old_file_and_no_draft(tmp_path, monkeypatch):
    path = save_image(PIXELS, tmp_path / "a.png")
    before = path.read_bytes()

    def full(self, file, *args, **kwargs):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises(FileError, match=r"a\.png: the picture cannot be written: No space left"):
        save_image(PIXELS[:5], path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["a.png"]


@pytest.mark.parametrize(("name", "message"), [
    ("a.pgn", r"ends in .*, got \.pgn; did you mean '\.png'"), ("a", "no suffix"),
    ("no/a.png", "does not exist"), ("folder.png", "is a folder"),
])
def test_bad_paths_are_refused_before_any_work(tmp_path, name, message):
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(FileError, match=message):
        check_image_path(tmp_path / name)
    with pytest.raises(FileError, match=message):
        save_image(PIXELS, tmp_path / name)


@pytest.mark.parametrize("bad", [PIXELS.astype(float), PIXELS[..., 0], PIXELS[..., :2], PIXELS[:0]])
def test_bad_pixels_are_refused(tmp_path, bad):
    with pytest.raises(InputError, match=r"^pixels: expected a picture"):
        save_image(bad, tmp_path / "a.png")


def test_a_contact_sheet_holds_each_picture_in_order_with_a_label_below():
    pictures = [np.full((40, 60, 3), (k * 30, 90, 200), np.uint8) for k in range(5)]
    labels = ["one", "two", "three", "a label far too long for its picture " * 3, ""]
    sheet = contact_sheet(pictures, labels, 3, gap=4)
    rows, columns = 2, 3
    strip = (sheet.shape[0] - 4) // rows - 44
    assert sheet.shape == (4 + rows * (44 + strip), 4 + columns * 64, 3)
    for k, picture in enumerate(pictures):
        left, top = 4 + (k % 3) * 64, 4 + (k // 3) * (44 + strip)
        np.testing.assert_array_equal(sheet[top:top + 40, left:left + 60], picture)
        label = sheet[top + 40:top + 40 + strip, left:left + 60]
        assert (label.min() < 128) == (k != 4)
        assert sheet[top:, left + 60:left + 64].min() == 255


def test_a_contact_sheet_refuses_what_does_not_fit_together():
    picture = PIXELS
    with pytest.raises(InputError, match=r"^labels: expected one for each"):
        contact_sheet([picture], [])
    with pytest.raises(InputError, match=r"^labels: .* at least one"):
        contact_sheet([], [])
    with pytest.raises(InputError, match=r"^columns: expected"):
        contact_sheet([picture], ["a"], 0)
    with pytest.raises(InputError, match=r"^images: expected one height"):
        contact_sheet([picture, picture[:10]], ["a", "b"])


@pytest.mark.parametrize("fonts", [images._FONTS, ("no such font.ttf",)])
def test_a_line_below_a_picture(monkeypatch, fonts):
    """With a font that has the letters of the IPA and with Pillow's own, which has none of them."""
    monkeypatch.setattr(images, "_FONTS", fonts)
    picture = np.full((40, 300, 3), 90, np.uint8)
    made = images.captioned(picture, "θ  TH  wie in thin, été", 20)
    assert made.shape == (60, 300, 3)
    assert np.array_equal(made[:40], picture)
    assert (made[40:] < 100).any()                          # ink
    assert (made[40:, -15:] == 255).all()                   # and room after it
    long = images.captioned(picture, "word " * 60, 20)
    assert (long[40:, -8:] == 255).all()
