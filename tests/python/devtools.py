# SPDX-License-Identifier: Apache-2.0
"""Headless Chromium, driven over its DevTools protocol."""

import base64
import itertools
import json
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "site"))
from browser import chromium

needs_chromium = pytest.mark.skipif(chromium() is None, reason="needs Chromium (apt-get install chromium)")


class Page:
    """A page in a browser of its own, without a network. ``console`` collects errors."""

    def __init__(self, url, width=1280, height=800):
        from websockets.sync.client import connect  # a dependency of viser

        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        command = [chromium(), "--headless=new", "--no-sandbox", f"--user-data-dir={self._profile.name}", "--remote-debugging-port=0",
                   "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", f"--window-size={width},{height}",
                   "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", "about:blank"]  # fmt: skip
        self._process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        address = next(line for line in self._process.stderr or () if "DevTools listening on" in line).split("ws://")[1].split("/")[0]
        self._drain = threading.Thread(target=self._process.stderr.read, daemon=True)
        self._drain.start()
        pages = []
        while not pages:
            with urllib.request.urlopen(f"http://{address}/json") as answer:
                pages = [page for page in json.load(answer) if page["type"] == "page"]
        self._socket = connect(pages[0]["webSocketDebuggerUrl"], max_size=None)
        self._ids = itertools.count(1)
        self.console = []
        for domain in ("Runtime", "Page", "Log"):
            self.call(f"{domain}.enable")
        self.opened = time.monotonic()
        self.call("Page.navigate", url=url)

    def call(self, method, **params):
        number = next(self._ids)
        self._socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            message = json.loads(self._socket.recv(timeout=60))
            if message.get("id") == number:
                assert "error" not in message, message["error"]
                return message["result"]
            about = message.get("params", {})
            if message["method"] == "Runtime.exceptionThrown":
                self.console.append(json.dumps(about)[:500])
            elif message["method"] == "Runtime.consoleAPICalled" and about["type"] == "error":
                self.console.append(" ".join(str(a.get("value", a.get("description"))) for a in about["args"]))
            elif message["method"] == "Log.entryAdded" and about["entry"]["level"] == "error":
                self.console.append(about["entry"]["text"])

    def run(self, script):
        """The value of an expression in JavaScript."""
        return self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)["result"].get("value")

    def click(self, selector, text):
        """Clicks the element of this selector and text. A click that the element did not receive is repeated, because a busy machine moves
        the elements of a page late."""
        before, end = None, time.monotonic() + 60
        while not self.run("window.clicked"):
            where = self.run(f"""(() => {{
                const found = [...document.querySelectorAll({json.dumps(selector)})].find((e) => e.textContent.trim() == {json.dumps(text)});
                if (!found) return null;
                found.addEventListener("click", () => {{ window.clicked = true; }});
                const box = found.getBoundingClientRect();
                return [box.x + box.width / 2, box.y + box.height / 2]; }})()""")
            if where and where == before:
                for kind in ("mousePressed", "mouseReleased"):
                    self.call("Input.dispatchMouseEvent", type=kind, x=where[0], y=where[1], button="left", clickCount=1)
            assert time.monotonic() < end, f"no {selector} with the text {text}"
            before = where
            time.sleep(0.5)
        self.run("window.clicked = false")

    def screenshot(self, path):
        Path(path).write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def close(self):
        self._socket.close()
        self._process.kill()
        self._process.wait()
        self._drain.join()
        self._process.stderr.close()
        self._profile.cleanup()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()
