"""Each use of what viser does not promise: these fail where a new viser is another than the guards know."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest

from facegen.errors import FacegenError
from facegen.studio import front, needs


def test_the_version_is_pinned(viser):
    assert viser.__version__ == needs.VERSION
    project = (Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8")
    assert f'studio = ["viser=={needs.VERSION}",' in project


def test_another_viser_is_refused(viser, monkeypatch):
    monkeypatch.setattr(viser, "__version__", "1.2.0")
    with pytest.raises(FacegenError, match=r"needs viser 1\.1\.1, found 1\.2\.0; install it with: pip"):
        needs.import_viser()


def test_without_viser_the_command_is_told(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(FacegenError, match=r'pip install "facegen\[studio\]"'):
        needs.import_viser()


def test_viser_calls_serve_as_we_wrap_it(viser):
    from viser.infra import _infra

    source = inspect.getsource(_infra)
    assert source.count("websockets.asyncio.server.serve(") == 1
    assert re.search(r"serve\(\s*ws_handler,\s*host,\s*port_attempt,", source)
    assert source.count("await websocket.recv()") == 1


def test_every_message_that_viser_handles_is_known(viser, studio_server):
    """A message that a new viser takes and the gate does not know would be refused; one it need not take, is gone."""
    from facegen.studio import wire

    handled = {kind.__name__ for owner in (studio_server.viser._websock_server,) for kind in owner._incoming_handlers}
    assert not {name for name in handled if "Share" in name}
    known = {kind.__struct_config__.tag: kind for kind in wire._ALL.__args__}
    from viser import _messages
    classes = {kind.__name__: kind for kind in _messages.Message.get_subclasses()}
    assert handled <= set(known)
    for name, kind in known.items():
        assert set(kind.__struct_fields__) == set(_messages.infra._messages.wire_field_names(classes[name])), name


def test_a_part_is_what_viser_s_page_cuts(viser):
    from facegen.studio.gate import PART

    source = Path(viser.__file__).parent / "client/src/components/UploadButton.tsx"
    if not source.exists():
        pytest.skip("this viser came without its page's source; the browser test sends a file")
    assert re.search(r"chunkSize = 512 \* 1024", source.read_text())
    assert PART == 512 * 1024


def test_a_page_s_connection_and_elements_are_found(serve, raw):
    from facegen.studio import seam

    made = []
    server = serve(lambda client, work: made.append(
        (client, client.gui.add_slider("smile", 0, 1, 0.1, 0),
         client.gui.add_upload_button("open", mime_type=".glb,.OBJ"), client.gui.add_dropdown("who", ("a", "b")))))
    page = raw(server).begin()
    page.elements(3)
    client, slider, upload, choice = made[0]
    connection = seam.connection_of(server.viser, client)
    assert connection.request.path == "/w/" + "a" * 20
    assert seam.client_of(server.viser, connection) is client
    found = seam.element(server.viser, client, slider._impl.uuid)
    assert (found.value, found.least, found.most, found.files) == (0, 0, 1, None)
    assert seam.element(server.viser, client, upload._impl.uuid).files == (".glb", ".obj")
    assert tuple(seam.element(server.viser, client, choice._impl.uuid).options) == ("a", "b")
    assert seam.element(server.viser, client, "none") is None
    slider.remove()
    assert seam.element(server.viser, client, slider._impl.uuid) is None


def test_a_button_takes_html_of_ours(serve, raw):
    from facegen.studio import seam

    made = []
    server = serve(lambda client, work: made.append(client.gui.add_button("choose")))
    page = raw(server).begin()
    page.elements(1)
    seam.set_icon(made[0], "<b>ours</b>")
    assert page.until("GuiUpdateMessage", uuid=made[0]._impl.uuid)["updates"] == {"_icon_html": "<b>ours</b>"}


def test_nothing_of_viser_s_is_printed_and_nothing_stays_changed(serve, capsys):
    import rich
    import websockets.asyncio.server

    before = websockets.asyncio.server.serve, rich.print
    server = serve()
    assert (websockets.asyncio.server.serve, rich.print) == before
    server.stop()
    assert (websockets.asyncio.server.serve, rich.print) == before
    assert capsys.readouterr().out == ""


def test_another_server_of_websockets_is_left_alone(serve, monkeypatch):
    """While ours starts, somebody else's call of serve goes to websockets itself."""
    import websockets.asyncio.server as module

    from facegen.studio import seam

    seen, plain = [], module.serve

    def watched(*args, **options):
        seen.append((args, options))
        return None if args[0] == "theirs" else plain(*args, **options)

    class Viser(seam.import_viser().ViserServer):
        def __init__(self, *args, **options):
            module.serve("theirs", "localhost", 0, max_size=1)
            super().__init__(*args, **options)

    monkeypatch.setattr(module, "serve", watched)
    monkeypatch.setattr(seam.import_viser(), "ViserServer", Viser)
    serve()
    assert seen[0] == (("theirs", "localhost", 0), {"max_size": 1})
    assert "sock" in seen[1][1]
    assert len(seen) == 2


def test_a_page_that_is_not_viser_s_is_refused(tmp_path):
    (tmp_path / "index.html").write_text("<title>Viser</title><script>1</script><script src=x></script>")
    with pytest.raises(FacegenError, match="install viser again"):
        front.Page(tmp_path / "index.html")
    with pytest.raises(FacegenError, match="cannot be read"):
        front.Page(tmp_path / "no.html")


def test_markdown_holds_no_html_and_no_picture(serve, raw):
    """viser gives the page HTML as it is, and reads the files of pictures."""
    said = 'Ada <meta http-equiv="refresh" content="0">, 1 < 2, ![x](/etc/hostname) `<b>` <3'
    made = []
    server = serve(lambda client, work: made.append(client.gui.add_markdown(said, visible=True)))
    page = raw(server).begin()
    joiner = "\N{WORD JOINER}"
    expected = said.replace("<m", f"<{joiner}m").replace("![", f"!{joiner}[").replace("<b", f"<{joiner}b")
    assert page.until("GuiUpdateMessage", updates={"_markdown": expected})
    assert made[0].content == said
    made[0].content = "</div>"
    assert page.until("GuiUpdateMessage", updates={"_markdown": f"<{joiner}/div>"})
    assert made[0].visible
