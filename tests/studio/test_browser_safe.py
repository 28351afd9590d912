"""The guards in a real browser: another site's page, open beside the studio, gets nowhere; a token lets in."""

from __future__ import annotations

import threading
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

ATTACK = """<!doctype html><title>wait</title><body><script>
const port = %d, work = "%s", said = [];
const tell = (what) => { said.push(what); if (said.length === 2) document.title = said.sort().join(", "); };
const socket = new WebSocket(`ws://127.0.0.1:${port}/w/${work}`, ["viser-v1.1.1"]);
socket.onopen = () => tell("socket open");
socket.onerror = () => tell("socket refused");
fetch(`http://127.0.0.1:${port}/w/${work}`, {mode: "no-cors"}).then(
    () => fetch(`http://127.0.0.1:${port}/`).then(() => tell("page read"), () => tell("page refused")),
    () => tell("page refused"));
const frame = document.createElement("iframe");
frame.src = `http://127.0.0.1:${port}/w/${work}`;
document.body.append(frame);
</script>"""


class _Site(BaseHTTPRequestHandler):
    """Somebody else's site."""

    def __init__(self, page: str, *args):
        self.page = page
        super().__init__(*args)

    def log_message(self, *args):
        pass

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(self.page.encode())


@pytest.fixture
def site():
    """A function that serves a page at another origin; it returns the address."""
    running = []

    def start(page: str) -> str:
        server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Site, page))
        running.append(server)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        return f"http://localhost:{server.server_port}/"

    yield start
    for server in running:
        server.shutdown()
        server.server_close()


def test_another_sites_page_gets_nowhere(studio_server, chromium, site):
    page = chromium.new_page()
    page.goto(site(ATTACK % (studio_server.port, "a" * 32)))
    end = 200
    while page.title() == "wait" and (end := end - 1):
        page.wait_for_timeout(50)
    assert page.title() == "page refused, socket refused"
    assert page.frames[1].url.startswith("chrome-error:")
    assert not studio_server.pages
    page.close()


def test_a_token_lets_in_even_by_a_link_on_another_page(serve, chromium, browser_page, site):
    server = serve(lambda client, work: client.gui.add_slider("smile", 0.0, 1.0, 0.01, 0.0), token="open-sesame-1")
    context = chromium.new_context()
    page = context.new_page()
    page.goto(f"http://127.0.0.1:{server.port}/")
    assert "wants its token" in page.inner_text("body")
    page.goto(site(f'<a href="{server.url}">the studio</a>'))
    page.click("a")
    page.wait_for_url(f"http://127.0.0.1:{server.port}/w/*")
    page.get_by_role("slider").first.wait_for()
    assert "open-sesame" not in page.url
    page.reload()
    page.get_by_role("slider").first.wait_for()
    assert context.cookies()[0]["httpOnly"]
    context.close()


def test_no_script_but_the_page_s_own_runs(serve, browser_page):
    """A name that is a program, shown as text and as viser's own formatted text."""
    evil = "<img src=x onerror=\"document.title='owned'\"><script>document.title='owned'</script>"

    def build(client, work):
        client.gui.add_markdown(f"Opened {evil} [x](javascript:document.title='owned')")
        client.gui.add_html(evil)
        client.gui.add_button(evil)
        client.gui.add_slider("smile", 0.0, 1.0, 0.01, 0.0)

    page = browser_page(serve(build))
    page.slider("smile").wait_for()
    page.page.wait_for_timeout(1000)
    assert page.page.title() == "facegen studio"
    page.errors.clear()         # the browser tells of what it did not run
