# SPDX-License-Identifier: Apache-2.0
"""The viewer is a program for one person: who may connect to its page, what a client may do, and what texts of files do in the page."""

import contextlib
import json
import math
import re
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install 'mjsense[view]'")

import devtools
from program_runs import run_program
from raw_client import RawClient, eventually, get

import mjsense as mjs

ARM = """<mujoco><compiler angle="radian"/><worldbody><geom type="plane" size="1 1 .1"/><body name="{0}"><joint name="j" type="hinge" axis="0 1 0" range="-1 1"/>
<geom size=".1 .3" type="capsule"/></body></worldbody><actuator><position name="a" joint="j" ctrlrange="-1 1"/></actuator></mujoco>"""
HOSTILE = [
    "<img src=x onerror='window.owned=1'>", "<iframe srcdoc='<script>parent.owned=1</script>'></iframe>", "![x](/etc/passwd) ![y](http://beacon.example/y)",
    "[link](javascript:window.owned=1) http://beacon.example www.beacon.example", "{window.owned=1}", "# heading\n\n- `item` #ff0000 **bold**", "\x1b]0;owned\x07 \u202egnp.exe",
]  # fmt: skip


@pytest.fixture
def arm(tmp_path, port):
    """A viewer of two worlds with an actuator."""
    (tmp_path / "arm.xml").write_text(ARM.format("b"))
    with mjs.view(tmp_path / "arm.xml", num_worlds=2, port=port, block=False, open_browser=False) as viewer:
        yield viewer


# ---------------------------------------------------------------------------------------------------------- who may connect


def test_requests_without_the_token_or_of_other_pages_are_refused(arm):
    own, path = f"127.0.0.1:{arm.port}", arm.url.partition("//")[2].partition("/")[2]
    status, headers, body = get(arm.url)
    assert status == 200 and b"<title>Viser</title>" in body and headers["Referrer-Policy"] == "no-referrer"
    assert "default-src 'none'" in headers["Content-Security-Policy"] and "Set-Cookie" not in headers
    for host in ("localhost", "localhost:9999", f"LOCALHOST:{arm.port}", "127.0.0.1:1", "[::1]:8080"):  # ports of tunnels
        assert get(arm.url, host=host)[0] == 200, host
        assert get(arm.url, host=host, origin=f"http://{host}")[0] == 200, host
    for token in ("", path[:-1], path + "x", path.swapcase(), "%C3%A9", "token", "../" + path):
        status, _, body = get(arm.url, path=f"/{token}")
        assert (status, b"no valid token" in body) == (403, True), token
    for host in ("evil.example", f"evil.example:{arm.port}", "127.0.0.1.evil.example", "localhost.evil.example", "localhost:", "192.168.1.1", "x@localhost", "localhost/"):
        assert get(arm.url, host=host)[0] == 403, host
    for origin in ("http://evil.example", "null", "http://127.0.0.1", f"http://127.0.0.1:{arm.port + 1}", f"http://localhost:{arm.port}", f"http://{own}.evil.example", "file://"):
        assert get(arm.url, origin=origin)[0] == 403, origin
    assert get(f"{arm.url}/../../../../etc/passwd")[0] == 404


def test_websockets_need_the_token_the_host_and_the_origin(arm):
    from websockets.exceptions import InvalidStatus

    for options in ({"origin": "http://evil.example"}, {"origin": "null"}, {"origin": None}, {"host": f"evil.example:{arm.port}"}, {"host": "127.0.0.1.evil.example"},
                    {"token": ""}, {"token": "wrong"}, {"token": "?websocket"}, {"origin": f"http://127.0.0.1:{arm.port + 1}"}, {"origin": f"http://localhost:{arm.port}"}):  # fmt: skip
        with pytest.raises(InvalidStatus, match="403"):
            RawClient(arm.url, **options)
    assert not arm.watched
    for options in ({}, {"host": "localhost:9999"}, {"host": "[::1]:81"}, {"origin": f"https://127.0.0.1:{arm.port}"}):
        with RawClient(arm.url, **options).read() as client:
            assert client.uuid("a"), options


def test_two_headers_of_a_name_are_refused(arm):
    """A proxy and the server could believe different ones."""
    path = "/" + arm.url.rpartition("/")[2]
    for extra in (f"Host: 127.0.0.1:{arm.port}\r\nHost: evil.example", f"Host: 127.0.0.1:{arm.port}\r\nOrigin: http://127.0.0.1:{arm.port}\r\nOrigin: http://evil.example", "X: y"):
        with socket.create_connection(("127.0.0.1", arm.port), 5) as plain:
            plain.sendall(f"GET {path} HTTP/1.1\r\n{extra}\r\n\r\n".encode())
            assert plain.recv(100).startswith(b"HTTP/1.1 403 "), extra


def test_every_viewer_has_its_own_token_and_other_servers_of_viser_none(arm, port):
    import viser

    with mjs.view(arm._source, port=port, block=False, open_browser=False) as other:
        assert other.url.rpartition("/")[2] != arm.url.rpartition("/")[2]
        assert get(f"http://127.0.0.1:{other.port}/{arm.url.rpartition('/')[2]}")[0] == 403
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        assert get(f"http://127.0.0.1:{server.get_port()}/", host="any.example")[0] == 200
    finally:
        server.stop()


@pytest.mark.parametrize("host, port, message", [
    ("127.0.0.1", 65536, r"port is 65536: must be in \[0, 65535\]"), ("127.0.0.1", -1, r"port is -1: must be in \[0, 65535\]"),
    ("", 8080, "host is empty: .*127.0.0.1.*0.0.0.0"), (" ", 8080, "host is empty"), ("256.1.1.1", 8080, "host is '256.1.1.1', which is not a known name"),
    ("no such host", 8080, "host is 'no such host', which is not a known name"), ("a" * 300, 8080, "not a known name"), ("8.8.8.8", 8080, "host is '8.8.8.8': this computer cannot listen there")])  # fmt: skip
def test_an_address_that_cannot_be_used_is_an_error_at_once(tmp_path, host, port, message):
    (tmp_path / "arm.xml").write_text(ARM.format("b"))
    with pytest.raises(ValueError, match=message):
        mjs.view(tmp_path / "arm.xml", host=host, port=port, block=False, open_browser=False)


def test_the_program_says_in_one_line_that_a_port_does_not_exist(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM.format("b"))
    command = [sys.executable, "-m", "mjsense", "view", str(tmp_path / "arm.xml"), "--no-open", "--port", "65536"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "") and re.fullmatch(r"mjsense: port is 65536: [^\n]+\n", done.stderr), done.stderr


def test_the_last_port_is_taken(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM.format("b"))
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 65535))
        taken.listen()
        with pytest.raises(ValueError, match="port is 65535: it and all ports up to 65535 are taken"):
            mjs.view(tmp_path / "arm.xml", port=65535, block=False, open_browser=False)


def test_other_addresses(tmp_path, port, capsys):
    (tmp_path / "arm.xml").write_text(ARM.format("b"))
    with mjs.view(tmp_path / "arm.xml", host="::1", port=port, block=False, open_browser=False) as viewer:
        assert viewer.url.startswith(f"http://[::1]:{port}/") and get(viewer.url)[0] == 200
        with RawClient(viewer.url).read() as client:
            assert client.uuid("a")
    assert "every person" not in capsys.readouterr().out
    with mjs.view(tmp_path / "arm.xml", host="0.0.0.0", port=port, block=False, open_browser=False) as viewer:
        said = capsys.readouterr().out
        assert said.count("every person on the network who has the address") == 1 and viewer.url.startswith(f"http://127.0.0.1:{port}/")
        assert get(viewer.url)[0] == get(viewer.url, host="192.168.1.7:8080")[0] == get(viewer.url, host=socket.gethostname())[0] == 200
        assert get(viewer.url, host="evil.example")[0] == get(viewer.url, path="/")[0] == 403
    with mjs.view(tmp_path / "arm.xml", host="localhost", port=0, block=False, open_browser=False) as viewer:
        assert viewer.port > 0 and get(viewer.url)[0] == 200
    assert "is taken" not in capsys.readouterr().out


# -------------------------------------------------------------------------------------------------------- what clients send

BAD = [math.nan, math.inf, -math.inf, -1e308, 1e300, 1e9, 2**63, -(2**63), -5, 1.5, "abc", "", "9" * 400, None, [], [1], {}, {"x": 1}, b"x", True, "1"]
GOOD = {"a": 0.5, "j": -0.25, "Speed": "2", "World": 1, "Seed": 7, "Group 3": True, "Stream 1": "qpos", "Play": True}


@pytest.mark.parametrize("label", GOOD)
def test_values_that_a_control_cannot_have_are_ignored(arm, label, capfd):
    good = GOOD[label]
    bad = [value for value in BAD if not (isinstance(good, bool) and value is True) and not (label == "Speed" and value == "1") and not (label == "Seed" and value in (1e9,))]
    with RawClient(arm.url).read().appear() as client:
        handle = arm._server.gui._gui_input_handle_from_uuid[client.uuid(label)]
        before = handle.value
        for value in bad:
            client.set(label, value)
        client.set("Group 5", True)  # messages arrive in order
        eventually(lambda: arm._server.gui._gui_input_handle_from_uuid[client.uuid("Group 5")].value)
        assert (handle.value, type(handle.value)) == (before, type(before))
        arm.update()
        assert not arm._playing and np.isfinite(arm._source.sim.ctrl).all()
        client.set(label, good)
        if label == "Play":
            eventually(lambda: arm._handle_events() and arm._playing)
        else:
            eventually(lambda: handle.value == good)
            arm.update()
    if label == "a":
        assert arm._source.sim.ctrl[0, 0] == pytest.approx(0.5, abs=1e-3)
    assert capfd.readouterr().err == ""


def test_messages_that_set_no_value_are_ignored(arm, capfd):
    with RawClient(arm.url).read().appear() as client:
        a, play, speed = (client.uuid(name) for name in ("a", "Play", "Speed"))
        handle = arm._server.gui._gui_input_handle_from_uuid[a]
        before = dict(vars(handle._impl))
        for updates in ({"min": math.nan}, {"max": 9.0}, {"update_cb": ["x"]}, {"removed": True}, {"props": 1}, {"uuid": "x"}, {"sync_cb": None}, {"nothing": 1},
                        {"gui_api": None}, {"__class__": 1}, {"__dict__": {}}, {"value": 0.5, "min": 0}, {}, {1: 2}, [], None, "value", {"is_button": True}):  # fmt: skip
            client.send("GuiUpdateMessage", uuid=a, updates=updates)
        client.send("GuiUpdateMessage", uuid=play, updates={"is_button": False})
        client.send("GuiUpdateMessage", uuid=speed, updates={"options": []})
        for kind, fields in (("GuiUpdateMessage", {}), ("GuiUpdateMessage", {"uuid": 1, "updates": {"value": 1}}), ("GuiUpdateMessage", {"uuid": [], "updates": {"value": 1}}),
                             ("GuiUpdateMessage", {"uuid": "x" * 1000, "updates": {"value": 1}}), ("Message", {}), ("", {}), (7, {}), ([], {}), ({}, {}), ("RunJavascriptMessage", {"source": "1"}),
                             ("GuiFormDirtyMessage", {"uuid": a}), ("GuiFormSubmitMessage", {"uuid": a}), ("ShareUrlRequest", {}), ("ShareUrlDisconnect", {}),
                             ("FileTransferStartUpload", {"source_component_uuid": a, "transfer_uuid": "t", "filename": "f", "mime_type": "m", "part_count": 9, "size_bytes": 1}),
                             ("CommandTriggerMessage", {"uuid": []}), ("TransformControlsUpdateMessage", {"name": []}), ("ScenePointerMessage", {}), ("GuiButtonHoldMessage", {}),
                             ("ViewerCameraMessage", {"wxyz": [math.nan] * 4}), ("ViewerCameraMessage", {}), ("GetRenderResponseMessage", {"payload": 1})):  # fmt: skip
            client.send(kind, **fields)
        for raw in (b"", b"\xc1", b"\x80", b"\x90", b"\x01", b"x" * 1000, b"\x81\xa4type\xa1Z", "a text", b"\x82\xa4type\xb0GuiUpdateMessage\xa7updates" + b"\x91" * 500_000 + b"\x90"):
            client.send_raw(raw)
        client.set("Group 5", True)
        eventually(lambda: arm._server.gui._gui_input_handle_from_uuid[client.uuid("Group 5")].value)
        assert dict(vars(handle._impl)) == before and not arm._server.gui._current_file_upload_states
        arm.update()
    assert capfd.readouterr().err == ""


def test_a_slider_may_be_rounded_beyond_its_end(arm):
    with RawClient(arm.url).read().appear() as client:
        client.set("a", 1.001)  # its steps are 0.002
        handle = arm._server.gui._gui_input_handle_from_uuid[client.uuid("a")]
        eventually(lambda: handle.value == 1.0)


def test_an_action_that_fails_does_not_end_the_viewer(arm, capsys):
    def fail():
        raise ValueError("there is\x1b[31m no such thing")

    arm._events[1] = fail
    arm.update()
    assert capsys.readouterr().out.endswith("The viewer cannot do this: there is?[31m no such thing\n")


def test_messages_and_pages_are_limited(arm):
    from websockets.exceptions import ConnectionClosed, InvalidStatus

    with RawClient(arm.url).read() as client:
        client.send_raw(bytes(2**20 + 1))
        with pytest.raises(ConnectionClosed):
            client.read()
    clients = [RawClient(arm.url) for _ in range(16)]
    with pytest.raises(InvalidStatus, match="503"):
        RawClient(arm.url)
    for client in clients:
        client.close()
    eventually(lambda: not arm._server._websock_server._client_state_from_id)
    RawClient(arm.url).close()


def handshake(viewer):
    """A socket with a websocket on it whose client never reads."""
    import viser

    host, _, path = viewer.url.partition("//")[2].partition("/")
    plain = socket.socket()
    plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    plain.connect(("127.0.0.1", viewer.port))
    plain.sendall(f"GET /{path} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                  f"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Protocol: viser-v{viser.__version__}\r\n\r\n".encode())  # fmt: skip
    assert plain.recv(12) == b"HTTP/1.1 101"
    return plain


def test_a_client_that_does_not_read_is_dropped(arm, monkeypatch):
    """Else each one holds what it was sent in memory."""
    from mjsense.viewer import gate

    monkeypatch.setattr(gate, "_STALLED", 0.3)
    waiting = arm._server._websock_server._client_state_from_id
    with RawClient(arm.url).read() as other, handshake(arm):
        eventually(lambda: len(waiting) == 2)
        for k in range(3):
            arm._server.scene.add_point_cloud(f"/points/{k}", np.zeros((300_000, 3), np.float32), np.zeros((300_000, 3), np.uint8))
        deadline = time.monotonic() + 20
        while len(waiting) == 2:
            assert time.monotonic() < deadline
            other.read(0.1)  # the client that reads stays
        time.sleep(1)
        assert len(waiting) == 1


def test_a_client_that_only_sends_pings_is_dropped(arm):
    """The answers would pile up in memory."""
    ping = b"\x89\xfd\x00\x00\x00\x00" + bytes(125)
    with handshake(arm) as plain:
        arm._server.scene.add_point_cloud("/points", np.zeros((300_000, 3), np.float32), np.zeros((300_000, 3), np.uint8))
        time.sleep(0.5)
        with pytest.raises(OSError):
            for _ in range(1000):
                plain.sendall(1000 * ping)  # 131 MB in total


def test_connections_that_speak_no_http_or_vanish(arm, capfd):
    """They print nothing and change nothing."""
    for payload in (b"\0" * 1000, b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 100_000, bytes(range(256)) * 16, b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nx", b"GET /\xff HTTP/1.1\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", arm.port), 5) as plain, contextlib.suppress(OSError):
            plain.sendall(payload)
            plain.settimeout(2)
            plain.recv(100)
    idle = [socket.create_connection(("127.0.0.1", arm.port), 5) for _ in range(300)]  # more than are kept
    for one in idle:
        one.close()

    def served():
        with contextlib.suppress(ConnectionError):
            return get(arm.url)[0] == 200

    eventually(served)
    vanishing = [RawClient(arm.url).appear() for _ in range(5)]
    eventually(lambda: len(arm._server.get_clients()) == 5)
    for client in vanishing:
        client.reset()
    eventually(lambda: not arm.watched)
    arm.update()
    with RawClient(arm.url).read() as client:
        assert client.uuid("a")
    assert capfd.readouterr().err == ""


# ------------------------------------------------------------------------------------------------------------ texts of files


def rewritten(folder, texts):
    """A recording whose instructions, outcomes and names of streams are these texts."""
    import h5py

    mjs.record("pick", out=folder, horizon=3, episodes=len(texts), keep_failures=True, width=32, height=24, replay=False)
    k = 0
    for path in sorted(folder.rglob("*.h5")):
        with h5py.File(path, "r+") as file:
            for name in sorted((name for name in file if name.startswith("traj_")), key=lambda name: int(name[5:])):
                trajectory = file[name]
                value = trajectory["obs_scene"][()]
                scene = json.loads(value if isinstance(value, str) else bytes(value).split(b"\0")[0])
                for key in ("instruction", "text", "task_description"):
                    scene[key] = texts[k]
                del trajectory["obs_scene"]
                trajectory["obs_scene"] = json.dumps(scene)
                trajectory.attrs["outcome"] = texts[k].replace("\x1b", "")
                k += 1
    assert k == len(texts)
    return folder


def all_texts(value):
    """Every string in a message."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for one in value.values():
            yield from all_texts(one)
    elif isinstance(value, list):
        for one in value:
            yield from all_texts(one)


def interpreted(messages):
    """Texts of files in messages whose contents the page interprets: Markdown, and HTML with elements other than our own."""
    for message in messages:
        for part in (message.get("props") or {}, message.get("updates") or {}):
            if any(word in part.get("_markdown", "") for word in ("owned", "beacon", "passwd", "heading", "exe")):
                yield part["_markdown"]
            if re.search(r"<(?!/?(div|b)\b)", part.get("content") or ""):
                yield part["content"]


def test_texts_of_a_recording_are_sent_as_text(tmp_path, port):
    with mjs.view(rewritten(tmp_path, HOSTILE), port=port, block=False, open_browser=False) as viewer, RawClient(viewer.url) as client:
        for k in range(len(HOSTILE)):
            viewer.show_episode(k)
            client.read(0.2)
    assert not list(interpreted(client.messages))
    sent = [text for message in client.messages for text in all_texts(message)]
    assert any("&lt;img src=x onerror=&#x27;window.owned=1&#x27;&gt;" in text for text in sent)
    assert not [text for text in sent if re.search("[\x00-\x08\x0b-\x1f\u202e]", text)]
    assert max(map(len, sent)) < 25_000


def test_a_text_without_end_is_shortened(tmp_path, port):
    with mjs.view(rewritten(tmp_path, ["a" * 60_000]), port=port, block=False, open_browser=False) as viewer, RawClient(viewer.url).read() as client:
        sent = [text for message in client.messages for text in all_texts(message)]
        assert 1000 < max(len(text) for text in sent if "aaaa" in text) < 10_000
        assert max(len(viewer._choice.value), len(viewer._outcome.options[1])) <= 140


def test_names_of_a_model_are_labels(tmp_path, port):
    name = "<img src=x onerror=owned=1>\u202e" + "n" * 500
    xml = ARM.format("b").replace('"j"', f'"{name.replace("<", "&lt;")}"')
    (tmp_path / "<b>.xml").write_text(xml)
    with mjs.view(tmp_path / "<b>.xml", port=port, block=False, open_browser=False) as viewer, RawClient(viewer.url).read() as client:
        labels = {text for message in client.messages for text in [(message.get("props") or {}).get("label")] if text}
        assert any(text.startswith("<img src=x onerror=owned=1>?nnn") and len(text) == 120 for text in labels)
        assert not list(interpreted(client.messages)) and viewer._sliders


def test_labels_are_different_and_lead_to_their_names():
    from mjsense.viewer.text import labels

    names = ["a" * 500 + "1", "a" * 500 + "2", "b\n", "b?", "b "]
    found = labels(names)
    assert list(found.values()) == names and len(found) == 5 and all(len(one) <= 124 and one.isprintable() for one in found)


def test_notebooks_show_texts_as_text(tmp_path):
    data = mjs.Dataset(rewritten(tmp_path, HOSTILE))
    for html in (data._repr_html_(), *(episode._repr_html_() for episode in data.episodes)):
        assert not re.search(r"<(?!/?(div|b|table|tr|th|td|details|summary|figure|figcaption|img src='data:)\b)", html)
        assert not re.search("[\x00-\x08\x0b-\x1f\u202e]", html)


@devtools.needs_chromium
def test_texts_in_the_page(tmp_path, port):
    """In a browser: nothing of the texts runs, is an element or is loaded; the page shows the characters."""
    with mjs.view(rewritten(tmp_path, HOSTILE), port=port, block=False, open_browser=False) as viewer:
        thread = threading.Thread(target=viewer.run, args=(False,))
        thread.start()
        try:
            with devtools.Page(viewer.url) as page:
                for k, text in enumerate(HOSTILE):
                    viewer._events[1] = lambda k=k: viewer.show_episode(k)
                    shown = re.sub(r"[\x00-\x09\x0b-\x1f\u202e]", "?", text).split("\n")[0]
                    deadline = time.monotonic() + 60
                    while shown not in (page.run("document.body?.innerText") or ""):
                        assert time.monotonic() < deadline, shown
                        time.sleep(0.1)
                    time.sleep(0.3)
                    assert page.run("window.owned") is None
                    assert page.run("document.querySelectorAll('iframe, h1, img[src=x], a[href*=beacon], a[href*=javascript], img[src*=beacon], ul, code').length") == 0
                page.call("Page.reload")  # the address, which the page has changed, is still right
                deadline = time.monotonic() + 60
                while "Episodes" not in (page.run("document.body?.innerText") or ""):
                    assert time.monotonic() < deadline
                    time.sleep(0.1)
                assert not page.console
        finally:
            viewer.close()
            thread.join()


@devtools.needs_chromium
def test_names_of_a_model_in_the_page(tmp_path, port):
    """In a browser: labels of controls, of curves and of the scene tree."""
    name = "&lt;img src=x onerror='window.owned=1'&gt;"
    xml = ARM.format(name).replace('"j"', f'"{name}"').replace('name="a"', f'name="{name}"')
    xml = xml.replace("</mujoco>", f'<sensor><jointpos name="{name}" joint="{name}"/></sensor></mujoco>')
    (tmp_path / "<img src=x>.xml").write_text(xml)
    with mjs.view(tmp_path / "<img src=x>.xml", port=port, block=False, open_browser=False) as viewer:
        thread = threading.Thread(target=viewer.run, args=(False,))
        thread.start()
        try:
            with devtools.Page(viewer.url) as page:
                viewer._events[1] = lambda: viewer._curves.choose("<img src=x onerror='window.owned=1'>")
                for tab in ("Curves", "Control", "Show", "Cameras"):
                    page.click("[role=tab]", tab)
                    time.sleep(1)
                    assert page.run("window.owned") is None and page.run("document.querySelectorAll('img[src=x]').length") == 0, tab
                    if tab == "Curves":
                        assert "<img src=x" in page.run("document.querySelector('.uplot').innerText")
                assert not page.console
        finally:
            viewer.close()
            thread.join()


@devtools.needs_chromium
def test_a_page_of_another_server_reaches_nothing(arm, tmp_path):
    """In a browser, which sends the Origin by itself; even with the token."""
    import http.server

    import viser

    scripts = "".join(f"""var w{k} = new WebSocket('ws://127.0.0.1:{arm.port}/{path}', ['viser-v{viser.__version__}']);
        w{k}.onopen = () => done('open'); w{k}.onerror = () => done('error');""" for k, path in enumerate(("", arm.url.rpartition("/")[2])))  # fmt: skip
    body = f"<script>window.answers = []; function done(what) {{ window.answers.push(what); }} {scripts}</script>".encode()

    class Evil(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Evil) as evil:
        threading.Thread(target=evil.serve_forever, daemon=True).start()
        with devtools.Page(f"http://127.0.0.1:{evil.server_port}") as page:
            deadline = time.monotonic() + 30
            while len(page.run("window.answers") or ()) < 2:
                assert time.monotonic() < deadline
                time.sleep(0.1)
            assert page.run("window.answers") == ["error", "error"]
        evil.shutdown()


# ---------------------------------------------------------------------------------------------------------------------- play


def test_hostile_commands_are_not_recorded(tmp_path, port):
    """Poses, keys and messages that no page sends do not end `play`, and what is recorded is finite and near the robot."""
    from mjsense.tasks.teleoperation.page import REACH

    words = ["play", "pick", "--scene", "table", "--seed", "3", "--out", str(tmp_path / "out"), "--port", str(port), "--no-open", "--keep-failures"]
    log = tmp_path / "log"
    with log.open("w") as out:
        player = subprocess.Popen([sys.executable, "-m", "mjsense", *words], stdout=out, stderr=out)
    try:
        eventually(lambda: player.poll() is not None or "Drive the robot at" in log.read_text(), 120)
        url = re.search(r"Drive the robot at (\S+)", log.read_text())[1]
        with RawClient(url).appear().read(2) as client:
            shown = [(message.get("updates") or {}).get("content", "") for message in client.messages]

            def pose(position, wxyz=(1, 0, 0, 0)):
                client.send("TransformControlsUpdateMessage", name="/target", position=position, wxyz=wxyz, owner="")

            client.set("Pause", False)
            for bad in (math.nan, math.inf, 1e300, 1e9, None, "a", [], True):
                pose([bad, 0, 0])
                pose([0.5, 0, 1], [bad, 0, 0, 0])
                pose([0.5, 0, 1], [1, bad, 0, 0])
            for position, wxyz in (([0.5, 0], [1, 0, 0, 0]), ([0.5, 0, 1, 2, 3], [1, 0, 0, 0]), (None, None), ([0.5, 0, 1], [0, 0, 0, 0]), ([0.5, 0, 1], [1e-9, 0, 0, 0]), ("abc", "abcd")):
                pose(position, wxyz)
            for label in ("Pause", "Close gripper"):
                for bad in (math.nan, None, [1], "xxx", 1e300):
                    client.set(label, bad)
                    client.send("GuiUpdateMessage", uuid=client.uuid(label), updates={"update_cb": [5]})
            up, end = client.uuid("Up", "RegisterCommand"), client.uuid("End the episode", "RegisterCommand")
            for _ in range(3000):
                client.send("CommandTriggerMessage", uuid=up)
            pose([900.0, 0, 1])  # a person can drag the handle there, the arm cannot follow
            time.sleep(2)
            client.send("CommandTriggerMessage", uuid=end)
            eventually(lambda: "1 of 1 episodes" in log.read_text() or player.poll() is not None, 60)
        assert player.wait(30) == 0, log.read_text()
    finally:
        player.kill()
        player.wait()
    episode = mjs.Dataset(tmp_path / "out").episodes[0]
    assert any(episode.task in text for text in shown), "the page shows the instruction"
    rows = [np.asarray(episode[name], np.float64) for name in episode.streams if name.startswith("actions/") and episode.streams[name].kind != "video"]
    assert rows and all(np.isfinite(row).all() for row in rows)
    commands = np.asarray(episode["actions/commanded_action/arm"], np.float64)
    assert len(commands) > 3 and np.abs(commands[:, :3]).max() <= REACH and commands[:, 2].max() > 1.5
    np.testing.assert_allclose(np.linalg.norm(commands[1:, 3:7], axis=1), 1, atol=1e-6)
    assert run_program("verify", tmp_path / "out").returncode == 0


def test_the_instruction_is_shown_and_given_to_policies(port):
    with mjs.view("pick", port=port, block=False, open_browser=False, cameras=[], seed=4) as viewer:
        before = viewer._source.instruction(0)
        assert before and before in viewer._clock.content and "World 0 of 1" in viewer._clock.content
        viewer._seed.value = 5
        viewer._reset()
        assert viewer._source.instruction(0) in viewer._clock.content


def test_a_policy_knows_its_instructions(tmp_path):
    seen = {}

    class Asks(mjs.Policy):
        def act(self, obs):
            for world in range(self.num_worlds):
                seen[int(self._mjs_episodes[world])] = self.instructions[world]
            return {}

    mjs.record("pick", policy=Asks, out=tmp_path, episodes=4, num_worlds=2, horizon=3, keep_failures=True, cameras=[])
    recorded = [episode.task for episode in mjs.Dataset(tmp_path).episodes]
    assert len(set(recorded)) > 1 and sorted(recorded) == sorted(seen[k] for k in range(4))


def test_ctrl_c_ends_a_viewer_with_clients(tmp_path, port):
    """Also ones that do not answer."""
    (tmp_path / "arm.xml").write_text(ARM.format("b"))
    command = [sys.executable, "-m", "mjsense", "view", str(tmp_path / "arm.xml"), "--no-open", "--port", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            url = process.stdout.readline().split()[1]
            client = RawClient(url).read().appear()
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=30)
        finally:
            process.kill()
    assert (process.returncode, errors) == (0, "")
    client.close()
