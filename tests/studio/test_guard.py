"""The guards by themselves: headers in, a refusal or none out."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.studio import guard
from facegen.studio.listening import names

NAMES = ["127.0.0.1", "localhost", "[::1]"]


def _every(**headers):
    folded = {name.casefold().replace("_", "-"): value for name, value in headers.items()}

    def every(name):
        found = folded.get(name.casefold(), [])
        return [found] if isinstance(found, str) else found

    return every


@pytest.mark.parametrize(("host", "inside"), [
    ("127.0.0.1", True), ("localhost", True), ("LocalHost", True), ("127.9.9.9", True), ("::1", True), ("[::1]", True),
    ("0.0.0.0", False), ("", False), ("::", False), ("192.168.1.2", False), ("example.org", False),
    ("127.0.0.1.x", False), ("localhost.evil", False)])
def test_what_only_this_machine_reaches(host, inside):
    assert guard.is_loopback(host) is inside


def test_port_80_may_be_left_out():
    assert guard.check_host(["localhost"], NAMES, 80) is None
    assert guard.check_host(["[::1]"], NAMES, 80) is None
    assert guard.check_host(["localhost"], NAMES, 8092).status == 403


@settings(deadline=None)
@given(st.text(max_size=40))
def test_no_other_host_is_taken(host):
    if guard.check_host([host], NAMES, 8092) is None:
        assert host.strip().casefold() in [f"{name}:8092" for name in NAMES]


@settings(deadline=None)
@given(st.text(alphabet="0123456789abcdef.:[]%; '*", max_size=30))
def test_what_is_taken_as_an_address_can_stand_in_a_header(host):
    if guard.check_host([host], ["x"], 8092, addresses=True) is None:
        assert not set(host.strip()) & set("%; '*")


@settings(deadline=None)
@given(st.text(max_size=40))
def test_no_other_origin_is_taken(origin):
    every = _every(Host="localhost:8092", Origin=origin)
    if guard.check_origin(every, websocket=True) is None:
        assert origin.strip().casefold() == "http://localhost:8092"


def test_headers_that_come_twice_are_refused():
    assert guard.check_host(["localhost:1", "localhost:1"], NAMES, 1).status == 400
    every = _every(Host="localhost:1", Origin=["http://localhost:1", "http://evil"])
    assert guard.check_origin(every, websocket=False).status == 400
    assert guard.check_host([], NAMES, 1).status == 400


def test_a_form_s_navigation_has_no_token_of_another_port():
    every = _every(Cookie=["a=b; facegen-studio-1=x", "facegen-studio-2=y"], Authorization="Basic z")
    assert guard.tokens_in_headers(every, 1) == ["x"]
    assert guard.tokens_in_headers(every, 2) == ["y"]
    assert guard.tokens_in_headers(every, 3) == []
    assert guard.token_in_query("a=1&token=t&token=u") == "t"
    assert guard.token_in_query("%00=&;") is None


@settings(deadline=None)
@given(st.text(max_size=70))
def test_only_ids_are_works(text):
    found = guard.work_of(f"/w/{text}")
    assert (found == text) if 16 <= len(text) <= 64 and text.isascii() and all(c.isalnum() or c in "-_" for c in text) \
        else found is None


def test_a_server_knows_its_names():
    assert names("127.0.0.1") == ["127.0.0.1", "localhost", "[::1]"]
    assert names("::1")[0] == "[::1]"
    assert names("192.168.1.7") == ["192.168.1.7"]
    assert "127.0.0.1" in names("0.0.0.0")
