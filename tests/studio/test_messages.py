"""Attacks over a real websocket: what no page of viser's would send."""

from __future__ import annotations

import logging
import math
import threading
import time

import msgspec
import pytest
from studio_raw import CAMERA, PATIENCE

from facegen.errors import InputError
from facegen.studio.gate import PART
from facegen.studio.limits import Limits


@pytest.fixture
def panel(serve, raw):
    """A page with some elements: (server, raw page, uuid of each element by label, handles by label, events)."""
    def start(**options):
        handles, events = {}, []

        def build(client, work):
            gui = client.gui
            made = [gui.add_slider("smile", 0.0, 1.0, 0.01, 0.0), gui.add_text("script", "R12A"),
                    gui.add_dropdown("who", ("anna", "bert")), gui.add_checkbox("linked", True),
                    gui.add_vector3("gaze", (0.0, 0.0, 1.0)), gui.add_button("go"), gui.add_upload_button("open"),
                    gui.add_rgb("colour", (1, 2, 3)), gui.add_number("steps", 3, min=1, max=9)]
            for handle in made:
                handles[handle.label] = handle
                note = handle.on_click if handle.label == "go" else \
                    handle.on_upload if handle.label == "open" else handle.on_update
                note(lambda event: events.append((event.target.label, event.target.value)))

        server = serve(build, **options)
        page = raw(server).begin()
        uuids = page.elements(9)
        return server, page, uuids, handles, events

    return start


def _update(uuid, **updates):
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates}


def _settled(page, uuids, events, value=0.5):
    """Wait until the server has heard all that was sent before: it answers an honest update."""
    page.send(_update(uuids["smile"], value=value))
    end = time.monotonic() + PATIENCE
    while ("smile", value) not in events:
        assert time.monotonic() < end, events
        time.sleep(0.02)


def test_honest_values_arrive(panel):
    _, page, uuids, handles, events = panel()
    page.send(_update(uuids["script"], value="L12B"), _update(uuids["who"], value="bert"),
              _update(uuids["linked"], value=False), _update(uuids["gaze"], value=[1, 0.5, 2]),
              _update(uuids["steps"], value=9), _update(uuids["go"], value=True),
              _update(uuids["colour"], value=[9, 8, 7]))
    _settled(page, uuids, events)
    assert handles["gaze"].value == (1.0, 0.5, 2.0)
    assert [label for label, _ in events] == ["script", "who", "linked", "gaze", "steps", "go", "colour", "smile"]


@pytest.mark.parametrize("updates", [
    {"update_cb": []}, {"removed": True}, {"uuid": "x"}, {"props": {}}, {"gui_api": None}, {"is_button": True},
    {"value": 0.3, "update_cb": []}, {"__class__": "x"}, {}])
def test_no_attribute_but_the_value_is_set(panel, updates):
    """viser's own handler would set any attribute that exists."""
    _, page, uuids, handles, events = panel()
    state = handles["smile"]._impl
    before = {name: getattr(state, name) for name in ("update_cb", "removed", "uuid", "props", "gui_api", "is_button")}
    page.send({"type": "GuiUpdateMessage", "uuid": uuids["smile"], "updates": updates})
    _settled(page, uuids, events)
    assert {name: getattr(state, name) for name in before} == before
    assert events == [("smile", 0.5)]


@pytest.mark.parametrize(("label", "value"), [
    ("smile", "a"), ("smile", math.nan), ("smile", math.inf), ("smile", 1.5), ("smile", -0.1), ("smile", True),
    ("smile", None), ("smile", [1.0]), ("script", 3), ("script", "x" * 300_000), ("who", "carl"), ("who", 1),
    ("linked", 1), ("linked", "yes"), ("gaze", [1.0, 2.0]), ("gaze", [1.0, 2.0, math.nan]), ("gaze", 5.0),
    ("gaze", [1.0] * 1000), ("gaze", "abc"), ("open", "x"), ("open", True), ("go", "x" * 10), ("go", {"a": 1}),
    ("steps", 0), ("steps", 1e300), ("smile", 10**40), ("script", b"bytes")])
def test_values_that_do_not_fit_are_refused(panel, label, value, caplog):
    _, page, uuids, handles, events = panel()
    before = handles[label].value
    try:
        raw = msgspec.msgpack.encode(_update(uuids[label], value=value))
    except OverflowError:
        raw = msgspec.msgpack.encode(_update(uuids[label], value=2**64 - 1))
    with caplog.at_level(logging.WARNING, "facegen.studio"):
        page.send_bytes(raw)
        _settled(page, uuids, events)
    assert [event for event in events if event != ("smile", 0.5)] == []
    assert label == "smile" or handles[label].value == before
    assert any("refused a message" in record.getMessage() for record in caplog.records)


@pytest.mark.parametrize("message", [
    {"type": "ShareUrlRequest"}, {"type": "ShareUrlDisconnect"}, {"type": "RunJavascriptMessage", "source": "x"},
    {"type": "Nothing"}, {"type": "GuiRemoveMessage", "uuid": "x"}, {"type": "ResetGuiMessage"}, {}, {"type": 5},
    {"type": "GuiUpdateMessage"}, {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": 1}, "extra": 1},
    {**CAMERA, "wxyz": [math.nan] * 4}, {**CAMERA, "wxyz": [0.0] * 4}, {**CAMERA, "position": [math.inf, 0, 0]},
    {**CAMERA, "fov": -1.0}, {**CAMERA, "image_height": "tall"}, {**CAMERA, "look_at": [1.0]},
    {**CAMERA, "up_direction": [0, 0, 0]}, {key: value for key, value in CAMERA.items() if key != "near"},
    {"type": "GetRenderResponseMessage", "payload": "no bytes", "render_uuid": "x"},
    {"type": "FileTransferPart", "source_component_uuid": "x", "transfer_uuid": "y", "part_index": -1, "content": b""}])
def test_what_viser_s_page_does_not_say_is_refused(panel, message):
    server, page, uuids, _, events = panel()
    page.send(message)
    _settled(page, uuids, events)       # the same connection, alive
    camera = server.pages[0][0].camera
    assert all(map(math.isfinite, (*camera.wxyz, *camera.position, camera.fov)))
    assert server.viser._share_tunnel is None


@pytest.mark.parametrize("data", [b"", b"\xc1", b"\x00", b"\xff" * 1000, b"\x81" * 5000, b"\xdd\xff\xff\xff\xff",
                                  b"\xdf\xff\xff\xff\xff", b"\x91" * 100_000])
def test_bytes_that_are_no_message_are_refused(panel, data):
    _, page, uuids, _, events = panel()
    page.send_bytes(data)
    _settled(page, uuids, events)


def test_text_is_refused(panel):
    _, page, uuids, _, events = panel()
    page.socket.send('{"type": "ShareUrlRequest"}')
    _settled(page, uuids, events)


def test_nobody_shares_the_studio(studio_server, caplog):
    with caplog.at_level(logging.WARNING, "facegen.studio"):
        assert studio_server.viser.request_share_url() is None
    assert "refused to share" in caplog.text
    assert studio_server.viser._share_tunnel is None


def test_who_goes_on_and_on_is_sent_away(panel, caplog):
    server, page, _, _, _ = panel()
    with caplog.at_level(logging.WARNING, "facegen.studio"):
        page.send(*[{"type": "ShareUrlRequest"}] * 90)
        assert page.closed() == 1008
    assert sum("sent away" in record.getMessage() for record in caplog.records) == 1
    assert sum("refused a message" in record.getMessage() for record in caplog.records) == 5
    end = time.monotonic() + PATIENCE
    while not server.gone and time.monotonic() < end:
        time.sleep(0.02)
    assert server.gone


def test_a_message_over_the_limit_is_not_kept(serve, raw):
    server = serve(limits=Limits(message_bytes=1 << 20))
    page = raw(server).begin()
    page.send_bytes(b"x" * (1 << 21))
    assert page.closed() == 1009


def _start(uuid, size, name="t1", parts=None, filename="face.glb"):
    return {"type": "FileTransferStartUpload", "source_component_uuid": uuid, "transfer_uuid": name,
            "filename": filename, "mime_type": "", "part_count": -(-size // PART) if parts is None else parts,
            "size_bytes": size}


def _part(uuid, index, content, name="t1"):
    return {"type": "FileTransferPart", "source_component_uuid": uuid, "transfer_uuid": name, "part_index": index,
            "content": content}


def test_an_honest_upload_arrives(panel):
    _, page, uuids, handles, events = panel()
    content = b"a" * PART + b"b" * 10
    page.send(_start(uuids["open"], len(content)), _part(uuids["open"], 1, content[PART:]),
              _part(uuids["open"], 0, content[:PART]), _start(uuids["open"], 0, "t2"))
    _settled(page, uuids, events)
    assert [label for label, _ in events] == ["open", "open", "smile"]
    assert handles["open"].value.content == b""


def test_a_file_over_the_limit_is_refused_before_it_comes(panel):
    server, page, uuids, _, events = panel(limits=Limits(file_bytes=3 * PART))
    page.send(_start(uuids["open"], 4 * PART), *[_part(uuids["open"], i, b"x" * PART) for i in range(4)])
    found = page.until("NotificationShowMessage")
    assert "MiB" in found["props"]["body"]
    _settled(page, uuids, events)
    assert [label for label, _ in events] == ["smile"]
    assert not server.pages[0][0].gui._current_file_upload_states
    assert server.budget.taken == 0


@pytest.mark.parametrize(("name", "size", "told"), [
    ("a.exe", 10, "expected a file that ends in .glb, .yaml"), ("a.glb.exe", 10, "expected a file"),
    ("glb", 10, "expected a file"), ("a.yaml", 2**20, "up to 0.5 MiB"), ("a.YAML", 2**20, "up to 0.5 MiB"),
    ("a.glb", 2**30, "up to 64.0 MiB")])
def test_a_file_of_another_kind_or_size_is_told_of(serve, raw, name, size, told):
    server = serve(lambda client, work: client.gui.add_upload_button("open", mime_type=".glb,.yaml"))
    page = raw(server).begin()
    page.send(_start(page.element("open"), size, filename=name))
    assert told in page.until("NotificationShowMessage")["props"]["body"]
    assert not server.pages[0][0].gui._current_file_upload_states


@pytest.mark.parametrize("lie", ["parts", "many parts", "long part", "short part", "twice", "index", "elsewhere"])
def test_sizes_that_lie_end_the_page(panel, lie):
    server, page, uuids, handles, events = panel()
    here = uuids["open"]
    messages = {"parts": [_start(here, 10, parts=3)], "many parts": [_start(here, 10, parts=10**9)],
                "long part": [_start(here, 10), _part(here, 0, b"x" * 1_000_000)],
                "short part": [_start(here, 2 * PART), _part(here, 0, b"x")],
                "twice": [_start(here, 2 * PART), _part(here, 0, b"x" * PART), _part(here, 0, b"x" * PART)],
                "index": [_start(here, 10), _part(here, 5, b"x" * 10)],
                "elsewhere": [_start(here, 10), _part(uuids["smile"], 0, b"x" * 10)]}
    page.send(*messages[lie])
    assert page.closed() == 1008
    end = time.monotonic() + PATIENCE
    while (not server.gone or server.budget.taken) and time.monotonic() < end:
        time.sleep(0.02)
    assert server.budget.taken == 0
    assert not events
    assert handles["smile"].value == 0.0


def test_hostile_files_are_told_of_and_the_studio_goes_on(studio, raw):
    """Sent to the whole studio, as a page sends them: its panels read them, and the next good file opens."""
    import json
    import struct

    from facegen.studio.avatar_panel import AvatarPanel

    text = json.dumps({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                       "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
                       "accessors": [{"count": 2**31, "componentType": 5126, "type": "VEC3"}]}).encode()
    text += b" " * (-len(text) % 4)
    bomb = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A) + text
    escape = (b'{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 9, "uri": "../../../../../../etc/passwd"}]}')
    running = studio(panels={"Avatar": AvatarPanel})
    page = raw(running.server).begin()
    opens = page.elements(3, seconds=2 * PATIENCE)
    while "Load landmarks" not in opens:
        opens |= page.elements(1)
    for number, (button, name, content, told) in enumerate([
            ("Open an avatar", "bomb.glb", bomb, "triangles"), ("Open an avatar", "a.gltf", escape, "leads out"),
            ("Open an avatar", "../../../../etc/cron.d/a.glb", b"glTF", "glb"),
            ("Load landmarks", "a.yaml", b"!!python/object/apply:os.system ['true']", "")]):
        page.send(_start(opens[button], len(content), f"t{number}", filename=name),
                  _part(opens[button], 0, content, f"t{number}"))
        found = page.until("NotificationShowMessage")["props"]
        assert told in found["body"], found
        assert "root:" not in found["body"]
    good = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    page.send(_start(opens["Open an avatar"], len(good), "good", filename="good.obj"),
              _part(opens["Open an avatar"], 0, good, "good"))
    end = time.monotonic() + PATIENCE
    while not any(one.work.avatar.file == "good.obj" for one in running.pages.values()):
        assert time.monotonic() < end
        time.sleep(0.05)


def test_an_endless_recording_is_ended_and_stops_when_told(studio, raw, monkeypatch):
    """A file that keeps its reader busy for minutes: another page is served meanwhile, Stop ends the reading at once,
    its time ends it without, and the next recording opens."""
    from facegen.studio import apart, recordings
    from facegen.studio.clip_panel import ClipPanel

    processes = []
    popen = apart.subprocess.Popen
    monkeypatch.setattr(apart.subprocess, "Popen", lambda *args, **options: processes.append(popen(*args, **options))
                        or processes[-1])
    monkeypatch.setattr(recordings, "LIMITS", Limits(read_seconds=600.0))
    monkeypatch.setattr(apart, "_PROGRAM", apart._PROGRAM.replace(
        "apart.answer(", "read = reading.JOBS['recording']\n"
        "reading.JOBS['recording'] = lambda path, wish: read(path, wish) if path.stat().st_size < 999 else endless()\n"
        "def endless():\n    while True: pass\n\napart.answer("))
    running = studio(panels={"Timeline": ClipPanel})
    page = raw(running.server).begin()
    found = page.elements(1, seconds=2 * PATIENCE)
    while "Open a recording" not in found:
        found |= page.elements(1)
    opens, content = found["Open a recording"], b"time,jawOpen\n" + b"0,1\n" * 400

    def send(name, content):
        page.send(_start(opens, len(content), name, filename=name), _part(opens, 0, content, name))

    send("endless.csv", content)
    stop = page.elements(1)
    while "Stop" not in stop:
        stop |= page.elements(1)
    other = raw(running.server, "b" * 20).begin()
    while "Open a recording" not in other.elements(1, seconds=2 * PATIENCE):
        pass
    assert processes[0].poll() is None, "it is still read while another page came"
    page.send(_update(stop["Stop"], value=True))
    assert page.until("NotificationShowMessage")["props"]["title"] == "endless.csv: stopped"
    assert processes[0].poll() is not None
    monkeypatch.setattr(recordings, "LIMITS", Limits(read_seconds=1.0))
    send("endless.csv", content)
    assert "endless.csv: cannot be read within 1 s" in page.until("NotificationShowMessage")["props"]["body"]
    monkeypatch.setattr(recordings, "LIMITS", Limits())
    send("good.csv", b"time,jawOpen\n0,0\n1,1\n")
    end = time.monotonic() + PATIENCE
    while not any(one.work.clip.recording == "good.csv" for one in running.pages.values()):
        assert time.monotonic() < end
        time.sleep(0.05)
    assert [process.poll() is None for process in processes] == [False, False, False]
    folder, = running.desk.store.folder.glob("a*/recording")
    assert [path.name for path in folder.iterdir()] == ["good.csv"]


def test_uploads_at_once_are_few(panel):
    server, page, uuids, _, events = panel(limits=Limits(uploads=2, upload_bytes=5 * PART))
    page.send(_start(uuids["open"], 2 * PART, "t1"), _start(uuids["open"], 4 * PART, "t2"),
              _start(uuids["open"], 2 * PART, "t3"), _start(uuids["open"], 10, "t4"),
              _start(uuids["smile"], 10, "t5"))
    _settled(page, uuids, events)
    assert set(server.pages[0][0].gui._current_file_upload_states) == {"t1", "t3"}
    assert server.budget.taken == 4 * PART


def test_a_flood_from_one_page_leaves_the_other_responsive(serve, raw):
    heard = []

    def build(client, work):
        slider = client.gui.add_slider("smile", 0.0, 1.0, 0.01, 0.0)
        if work.startswith("f"):
            slider.on_update(lambda event: time.sleep(0.05))        # each as slow as a heavy face
        else:
            slider.on_update(lambda event: heard.append(event.target.value))

    server = serve(build)
    flood, calm = raw(server, "f" * 20).begin(), raw(server, "c" * 20).begin()
    flooded, here = flood.element("smile"), calm.element("smile")
    stop = threading.Event()
    sent = [0]

    def pour():
        while not stop.is_set():
            try:
                flood.send(_update(flooded, value=(sent[0] % 100) / 100))
            except Exception:
                return
            sent[0] += 1

    thread = threading.Thread(target=pour, daemon=True)
    thread.start()
    try:
        time.sleep(0.5)
        for i in range(10):
            begin = time.monotonic()
            calm.send(_update(here, value=i / 10 + 0.05))
            while len(heard) <= i:
                assert time.monotonic() - begin < PATIENCE, "the calm page was not heard"
                time.sleep(0.002)
    finally:
        stop.set()
        flood.vanish()
        thread.join(10)
    assert heard == [i / 10 + 0.05 for i in range(10)]


def test_handlers_of_a_page_run_in_turn_and_the_newest_value_wins(serve, raw):
    heard, running, most = [], [0], [0]

    def build(client, work):
        slider = client.gui.add_slider("smile", 0.0, 1.0, 0.01, 0.0)
        button = client.gui.add_button("key")

        def slow(event):
            running[0] += 1
            most[0] = max(most[0], running[0])
            time.sleep(0.1)
            heard.append((event.target.label, event.target.value if event.target is slider else None))
            running[0] -= 1

        slider.on_update(slow)
        button.on_click(slow)

    server = serve(build)
    page = raw(server).begin()
    uuids = page.elements(2)
    page.send(*[_update(uuids["smile"], value=i / 50) for i in range(1, 31)], _update(uuids["key"], value=True),
              _update(uuids["key"], value=True), *[_update(uuids["smile"], value=0.8 + i / 100) for i in range(10)])
    end = time.monotonic() + PATIENCE
    while [label for label, _ in heard].count("key") < 2 or heard[-1] != ("smile", 0.89):
        assert time.monotonic() < end, heard
        time.sleep(0.02)
    assert most[0] == 1
    assert [label for label, _ in heard if label == "key"] == ["key", "key"]
    assert heard[-1] == ("smile", 0.89)
    assert len(heard) < 8           # of forty values


def test_what_a_handler_raises_is_told_and_the_page_lives(serve, raw, caplog):
    def build(client, work):
        client.gui.add_button("wrong").on_click(lambda event: (_ for _ in ()).throw(InputError("'X12' is no unit")))
        client.gui.add_button("broken").on_click(lambda event: 1 / 0)

        @client.gui.add_button("later").on_click
        async def _(event):
            raise KeyError("lost")

    server = serve(build)
    page = raw(server).begin()
    uuids = page.elements(3)
    with caplog.at_level(logging.ERROR, "facegen.studio"):
        for label, told in (("wrong", "'X12' is no unit"), ("broken", "ZeroDivisionError"), ("later", "KeyError")):
            page.send(_update(uuids[label], value=True))
            assert told in page.until("NotificationShowMessage")["props"]["body"]
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == 2
    assert all("\n" not in line and "test_messages.py:" in line for line in lines)


def test_a_page_that_cannot_be_built_says_so(serve, raw, caplog):
    def build(client, work):
        raise RuntimeError("no face")

    page = raw(serve(build)).begin()
    with caplog.at_level(logging.ERROR, "facegen.studio"):
        assert "no face" in page.until("NotificationShowMessage")["props"]["body"]


def test_a_page_that_reads_nothing_holds_nobody_up(serve, raw):
    import numpy as np

    def build(client, work):
        if work.startswith("s"):
            for i in range(40):
                client.scene.add_point_cloud(f"/p{i}", np.zeros((50_000, 3), np.float32), (1, 2, 3))
        client.gui.add_slider("smile", 0.0, 1.0, 0.01, 0.0)

    server = serve(build)
    raw(server, "s" * 20).begin()       # it never receives
    calm = raw(server, "c" * 20).begin()
    assert calm.element("smile")
