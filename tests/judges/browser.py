"""Headless Chromium with a page that loads a GLB in three.js; the page posts back what it found."""

from __future__ import annotations

import json
import shutil
import subprocess
import threading
from collections.abc import Sequence
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

HERE = Path(__file__).parent
# The software renderer, and nothing that asks the network.
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
         "--disable-background-networking", "--disable-component-update", "--disable-sync", "--use-gl=angle",
         "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SECONDS = 90


def chromium() -> str | None:
    """Return the browser's command, or None."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def seen_by_threejs(judges: Path, avatar: Path, poses: list[str], profile: Path, times: Sequence[float] = ()) -> dict:
    """Return what three.js finds in a GLB: its meshes, and a picture (data: URI) of each pose and of the neutral ''.

    times: seconds at which its last animation is looked at.
    """
    found: dict = {}
    done = threading.Event()

    class Server(SimpleHTTPRequestHandler):
        def log_message(self, *args):
            pass

        def do_GET(self):
            files = {"/": HERE / "page.html", "/avatar.glb": avatar}
            if self.path == "/wish":
                self._say(json.dumps({"poses": poses, "times": list(times)}).encode(), "application/json")
            elif self.path in files:
                self._say(files[self.path].read_bytes(), "text/html" if self.path == "/" else "model/gltf-binary")
            else:
                super().do_GET()

        def do_POST(self):
            found.update(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self._say(b"", "text/plain")
            done.set()

        def _say(self, data, kind):
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Server, directory=str(judges)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    command = [chromium(), *FLAGS, f"--user-data-dir={profile}", f"http://127.0.0.1:{server.server_port}/"]
    with open(profile.with_suffix(".log"), "wb") as log:
        browser = subprocess.Popen(command, stdout=log, stderr=log)
        try:
            done.wait(SECONDS)
        finally:
            browser.terminate()
            browser.wait(30)
            server.shutdown()
            server.server_close()
    if not found:
        said = profile.with_suffix(".log").read_text(errors="replace")[-2000:]
        raise AssertionError(f"three.js said nothing within {SECONDS} s: {said}")
    assert "error" not in found, found["error"]
    return found
