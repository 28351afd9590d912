"""Attacks over a real connection: what a stranger's page or program asks for, and what it gets."""

from __future__ import annotations

import logging
import re
import select
import socket
import time

import pytest
from studio_raw import PATIENCE, RawPage, request
from websockets.exceptions import InvalidStatus

WORK = "b" * 32


def _status(server, **options) -> int:
    with pytest.raises(InvalidStatus) as refused:
        RawPage(server.port, WORK, **options)
    return refused.value.response.status_code


def test_a_new_tab_gets_a_work_and_the_page(studio_server):
    status, headers, _ = request(studio_server.port)
    assert status == 302
    assert re.fullmatch(r"/w/[A-Za-z0-9_-]{32}", headers["location"])
    assert request(studio_server.port)[1]["location"] != headers["location"]
    status, headers, body = request(studio_server.port, headers["location"])
    assert (status, headers["content-type"]) == (200, "text/html; charset=utf-8")
    assert b"<title>facegen studio</title>" in body
    assert b"<title>Viser" not in body
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["x-frame-options"] == "DENY"
    policy = headers["content-security-policy"]
    assert "frame-ancestors 'none'" in policy
    assert "default-src 'none'" in policy
    assert "unsafe-eval" not in policy.replace("wasm-unsafe-eval", "")
    assert f"connect-src ws://127.0.0.1:{studio_server.port} " in policy
    assert not re.search(r"https?://|\*", policy)


def test_viser_s_page_loads_nothing_from_elsewhere(studio_server):
    _, _, body = request(studio_server.port, f"/w/{WORK}")
    found = set(re.findall(rb"(?:src|href)\s*=\s*[\"'](?!data:)([^\"']+)", body.split(b"<script")[0]))
    assert not found
    assert not re.findall(rb"<link(?![^>]*rel=\"icon\")[^>]*>", body)


@pytest.mark.parametrize("host", [
    "evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "localhost.evil:{port}", "127.0.0.1:{port}.evil",
    "[::1%25;script-src *]:{port}", "0.0.0.0:{port}", "", " "])
def test_a_foreign_host_is_refused(studio_server, host):
    """DNS rebinding: the browser thinks that it speaks to the attacker's own site."""
    host = host.format(port=studio_server.port)
    for path in ("/", f"/w/{WORK}"):
        status, _, body = request(studio_server.port, path, host=host or " ")
        assert status in (400, 403)
        assert b"<script" not in body
    assert _status(studio_server, headers={}, path=f"/w/{WORK}", origin=f"http://{host or 'x'}") == 403


def test_the_names_of_this_machine_are_taken(studio_server):
    for name in ("127.0.0.1", "localhost", "LOCALHOST", "[::1]"):
        assert request(studio_server.port, host=f"{name}:{studio_server.port}")[0] == 302


def test_two_hosts_are_refused(studio_server):
    port = studio_server.port
    assert request(port, headers={"host": "evil.example"})[0] in (400, 403)


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "http://localhost:{port}",
                                    "https://127.0.0.1:{port}", "http://127.0.0.1:{port}.evil.example", "file://",
                                    "http://127.0.0.1:{port}/x", "http://x@127.0.0.1:{port}"])
def test_a_foreign_origin_is_refused(studio_server, origin):
    origin = origin.format(port=studio_server.port)
    assert _status(studio_server, origin=origin) == 403
    status, _, body = request(studio_server.port, f"/w/{WORK}", {"Origin": origin})
    assert status == 403
    assert b"<script" not in body


def test_a_websocket_without_an_origin_needs_the_token(serve):
    assert _status(serve(), origin=None) == 403
    server = serve(token="open-sesame-1")
    assert _status(server, origin=None) == 403
    with RawPage(server.port, WORK, origin=None, headers={"Authorization": "Bearer open-sesame-1"}) as page:
        assert page.receive()


def test_a_picture_or_script_of_another_page_gets_nothing(studio_server):
    for mode in ("no-cors", "cors"):
        assert request(studio_server.port, "/", {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": mode})[0] == 403
    assert request(studio_server.port, "/", {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"})[0] == 302


def test_without_its_token_nothing_is_served(serve):
    server = serve(token="open-sesame-1")
    port = server.port
    for path in ("/", f"/w/{WORK}", "/?token=", "/?token=open-sesame-2", "/?token=open-sesame-11",
                 f"/w/{WORK}?token=x"):
        status, headers, body = request(port, path)
        assert status == 403
        assert b"?token=" in body               # what to do
        assert b"open-sesame" not in body
        assert "set-cookie" not in headers
    assert request(port, "/", {"Cookie": f"facegen-studio-{port}=open-sesame-2; token=open-sesame-1"})[0] == 403
    assert _status(server) == 403
    assert _status(server, headers={"Authorization": "Bearer ö"}) == 403


def test_the_token_becomes_a_cookie(serve):
    server = serve(token="open-sesame-1")
    status, headers, body = request(server.port, "/?token=open-sesame-1")
    assert status == 200
    assert b"url=/\"" in body
    assert b"open-sesame" not in body
    cookie = headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    cookie = {"Cookie": cookie.partition(";")[0]}
    assert request(server.port, "/", cookie)[0] == 302
    assert request(server.port, f"/w/{WORK}", cookie)[0] == 200
    with RawPage(server.port, WORK, headers=cookie) as page:
        assert page.receive()
    assert _status(server, headers=cookie, origin="http://evil.example") == 403


def test_other_hosts_get_a_token_unasked(serve):
    server = serve(host="0.0.0.0")
    assert len(server.token) >= 32
    assert request(server.port)[0] == 403
    bearer = {"Authorization": f"Bearer {server.token}"}
    assert request(server.port, "/", bearer)[0] == 302
    assert request(server.port, "/", bearer, host=f"evil.example:{server.port}")[0] == 403
    assert request(server.port, "/", bearer, host=f"192.168.7.7:{server.port}")[0] == 302
    assert serve(host="127.0.0.1").token is None


@pytest.mark.parametrize("path", [
    "/index.html", "/../../../../etc/passwd", "/w/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/w/%2e%2e%2fetc",
    "/..%5c..%5cwindows", "//etc/passwd", "/w/", "/w", "/w/short", "/w/" + "a" * 15, "/w/" + "a" * 65,
    "/w/" + "a" * 20 + "/", "/w/" + "a" * 20 + "/x", "/w/" + "a" * 20 + "%00", "/w/" + "a" * 19 + ".",
    "/W/" + "a" * 20, "/w/" + "a" * 20 + ";x", "http://127.0.0.1/w/" + "a" * 20, "/favicon.ico", "/assets/x.js",
    "/w/" + "a" * 10 + "%2f" * 3])
def test_everything_else_is_not_there(studio_server, path):
    status, _, body = request(studio_server.port, path)
    assert status == 404
    assert b"root:" not in body
    assert len(body) < 200
    assert _status(studio_server, path=path if path.startswith("/") else "/" + path) == 404


@pytest.mark.parametrize("raw", [b"/w/\xff\xfe" + b"a" * 20, b"/" + b"a" * 9000, b"/\x00", b"/w/" + b"a" * 20 + b"\t"])
def test_bytes_that_are_no_path_are_not_served(studio_server, raw):
    with socket.create_connection(("127.0.0.1", studio_server.port), timeout=20) as wire:
        wire.sendall(b"GET " + raw + f" HTTP/1.1\r\nHost: 127.0.0.1:{studio_server.port}\r\n\r\n".encode())
        answer = wire.recv(1 << 16)
    assert not answer.startswith(b"HTTP/1.1 2")
    assert request(studio_server.port)[0] == 302


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "CONNECT", "TRACE"])
def test_other_methods_do_nothing(studio_server, method):
    with socket.create_connection(("127.0.0.1", studio_server.port), timeout=20) as wire:
        wire.sendall(f"{method} / HTTP/1.1\r\nHost: 127.0.0.1:{studio_server.port}\r\n\r\n".encode())
        answer = wire.recv(1 << 16)
    assert not answer.startswith((b"HTTP/1.1 2", b"HTTP/1.1 3"))


def test_no_query_reaches_viser_s_page(studio_server):
    """Its ``?websocket=`` would connect our page to somebody else's server."""
    status, headers, _ = request(studio_server.port, f"/w/{WORK}?websocket=ws://evil.example&playbackPath=//evil/x")
    assert (status, headers["location"]) == (302, f"/w/{WORK}")


def test_refusals_are_told_in_one_line_each(studio_server, caplog):
    with caplog.at_level(logging.WARNING, "facegen.studio"):
        request(studio_server.port, "/a\tb%0d%0aFORGED")
        request(studio_server.port, "/%0d%0aFORGED", host="evil.example")
    lines = [record.getMessage() for record in caplog.records if record.name == "facegen.studio"]
    assert lines
    assert all("\n" not in line and "\r" not in line for line in lines)


def test_a_flood_of_refusals_is_few_lines(studio_server, caplog):
    with caplog.at_level(logging.WARNING, "facegen.studio"):
        for _ in range(40):
            assert request(studio_server.port, "/x")[0] == 404
    lines = [record.getMessage() for record in caplog.records if record.name == "facegen.studio"]
    assert 20 <= len(lines) < 40
    assert "others are not told of" in lines[19]


def test_a_slow_stranger_holds_nobody_up(studio_server, raw):
    """A hundred who never end their request, and more than may: a page comes in all the same."""
    slow = []
    for _ in range(100):
        wire = socket.create_connection(("127.0.0.1", studio_server.port), timeout=20)
        wire.sendall(b"GET / HTTP/1.1\r\nHost: ")
        slow.append(wire)
    assert request(studio_server.port)[0] == 302
    assert raw(studio_server).begin().receive()
    assert not select.select(slow, [], [], 0)[0]        # they hold on all the while
    for wire in slow:
        wire.close()


def test_more_connections_than_a_browser_needs_are_cut(studio_server):
    many = [socket.create_connection(("127.0.0.1", studio_server.port), timeout=20) for _ in range(160)]
    cut: list = []
    _until(lambda: cut.extend(select.select(many, [], [], 0)[0]) or len(set(cut)) >= 160 - 128)     # nobody is there
    cut = set(cut)
    for wire in many:
        wire.close()
    assert len(cut) == 160 - 128
    time.sleep(0.2)
    assert request(studio_server.port)[0] == 302


def test_no_more_pages_than_may_be(serve, raw):
    from facegen.studio.limits import Limits

    server = serve(limits=Limits(pages=2, works=3))
    first = raw(server, "a" * 20).begin()
    assert first.receive()
    assert raw(server, "b" * 20).begin().receive()
    assert _status(server, path="/w/" + "c" * 20) == 503
    status, _, body = request(server.port, "/w/" + "c" * 20)
    assert status == 503
    assert b"close one" in body
    assert request(server.port, "/w/" + "a" * 20)[0] == 200     # it is loaded again
    first.close()
    _until(lambda: server.open_pages == 1)
    third = raw(server, "c" * 20)
    assert third.begin().receive()
    third.close()
    _until(lambda: server.open_pages == 1)
    assert _status(server, path="/w/" + "d" * 20) == 503        # a fourth work
    assert raw(server, "a" * 20).begin().receive()              # one of the three


def _until(true):
    end = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_another_version_s_page_is_told_so(studio_server):
    page = RawPage(studio_server.port, WORK, protocol="viser-v0.2.0")
    assert page.closed() == 1002
