"""A real browser at the server: what a person does reaches the callbacks, and what they do reaches the picture."""

from __future__ import annotations

import numpy as np

from facegen.studio.limits import Limits


def _ball(client, work, rays=None):
    """A page with a ball that grows, and tells of clicks."""
    client.scene.set_up_direction("+y")
    ball = client.scene.add_icosphere("/ball", radius=1.0, color=(200, 30, 30))
    slider = client.gui.add_slider("size", 0.2, 2.0, 0.01, 1.0)
    if rays is not None:
        ball.on_click(lambda event: rays.append((event.ray_origin, event.ray_direction)))

    @slider.on_update
    def _(event):
        ball.scale = slider.value


def _red(picture: np.ndarray) -> int:
    return int(((picture[..., 0] > 120) & (picture[..., 1] < 120)).sum())


def test_a_slider_moves_the_picture_and_a_click_finds_what_is_there(serve, browser_page):
    rays = []
    server = serve(lambda client, work: _ball(client, work, rays))
    page = browser_page(server)
    assert page.page.title() == "facegen studio"
    page.until(lambda: _red(page.pixels()) > 500)
    before = page.still()
    page.drag_slider("size", 1.0)
    after = page.changed(before)
    assert page.value("size") == 2.0
    assert _red(after) > 2.5 * _red(before)
    assert server.pages[0][1] == page.work
    rows, columns = np.nonzero((after[..., 0] > 120) & (after[..., 1] < 120))
    middle = float(np.median(columns)), float(np.median(rows))
    page.click(middle)
    page.until(lambda: rays)
    origin, direction = np.array(rays[0])
    away = np.linalg.norm(np.cross(direction, -origin)) / np.linalg.norm(direction)
    assert away < 0.3                                   # of the ball's middle, whose radius is 2
    page.click((middle[0] + 0.47 * np.ptp(columns), middle[1]))
    page.until(lambda: len(rays) > 1)
    origin, direction = np.array(rays[1])
    assert 1.5 < np.linalg.norm(np.cross(direction, -origin)) / np.linalg.norm(direction) < 2.0


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


def test_files_go_up_and_come_down_and_what_is_refused_is_told_of(serve, browser_page, tmp_path):
    came = []

    def build(client, work):
        opened = client.gui.add_upload_button("Open avatar")
        opened.on_upload(lambda event: came.append((event.target.value.name, event.target.value.content)))
        client.gui.add_button("Take away").on_click(
            lambda _: client.send_file_download("face.txt", b"R12A", save_immediately=True))

    page = browser_page(serve(build, limits=Limits(file_bytes=4_000_000)))
    sent, large = tmp_path / "big.bin", tmp_path / "large.glb"
    sent.write_bytes(np.random.default_rng(1).bytes(3_000_000))
    large.write_bytes(bytes(5_000_000))
    page.upload("Open avatar", large)
    page.says("large.glb has 4.8 MiB; the studio opens such files up to 3.8 MiB.")
    assert not came
    page.upload("Open avatar", sent)                    # the button is not left waiting for the other
    page.until(lambda: came)
    assert came == [("big.bin", sent.read_bytes())]
    got = page.download(tmp_path, lambda: page.press("Take away"))
    assert (got.name, got.read_bytes()) == ("face.txt", b"R12A")
