"""A real browser at the server: what a person does reaches the callbacks, and what they do reaches the picture."""

from __future__ import annotations

import numpy as np


def _ball(client, work):
    """A page with a ball that grows."""
    client.scene.set_up_direction("+y")
    ball = client.scene.add_icosphere("/ball", radius=1.0, color=(200, 30, 30))
    slider = client.gui.add_slider("size", 0.2, 2.0, 0.01, 1.0)

    @slider.on_update
    def _(event):
        ball.scale = slider.value


def _red(picture: np.ndarray) -> int:
    return int(((picture[..., 0] > 120) & (picture[..., 1] < 120)).sum())


def test_a_slider_moves_the_picture(serve, browser_page):
    server = serve(_ball)
    page = browser_page(server)
    assert page.page.title() == "facegen studio"
    page.until(lambda: _red(page.pixels()) > 500)
    before = page.still()
    page.drag_slider("size", 1.0)
    after = page.changed(before)
    assert page.value("size") == 2.0
    assert _red(after) > 2.5 * _red(before)
    assert server.pages[0][1] == page.work


def test_a_page_that_is_loaded_again_has_the_same_work(serve, browser_page):
    server = serve(_ball)
    page = browser_page(server)
    page.slider("size").wait_for()
    first = page.work
    page.reload().slider("size").wait_for()
    assert page.work == first
    other = browser_page(server)
    other.slider("size").wait_for()
    assert other.work != first
    assert [work for _, work in server.pages] == [first, first, other.work]
    page.until(lambda: [work for _, work in server.gone] == [first])


def test_files_go_up_and_come_down(serve, browser_page, tmp_path):
    came = []

    def build(client, work):
        opened = client.gui.add_upload_button("Open avatar")
        opened.on_upload(lambda event: came.append((event.target.value.name, event.target.value.content)))
        client.gui.add_button("Take away").on_click(
            lambda _: client.send_file_download("face.txt", b"R12A", save_immediately=True))

    page = browser_page(serve(build))
    sent = tmp_path / "big.bin"
    sent.write_bytes(np.random.default_rng(1).bytes(3_000_000))
    page.upload("Open avatar", sent)
    page.until(lambda: came)
    assert came == [("big.bin", sent.read_bytes())]
    got = page.download(tmp_path, lambda: page.press("Take away"))
    assert (got.name, got.read_bytes()) == ("face.txt", b"R12A")


def test_clicks_on_the_canvas_find_what_stands_there(serve, browser_page):
    rays = []

    def build(client, work):
        client.scene.set_up_direction("+y")
        ball = client.scene.add_icosphere("/ball", radius=1.0, color=(200, 30, 30))
        ball.on_click(lambda event: rays.append(event.ray_origin))

    page = browser_page(serve(build))
    page.until(lambda: _red(page.pixels()) > 500)
    picture = page.still()
    rows, columns = np.nonzero((picture[..., 0] > 120) & (picture[..., 1] < 120))
    page.click((float(np.median(columns)), float(np.median(rows))))
    page.until(lambda: rays)
    assert np.isfinite(rays[0]).all()
