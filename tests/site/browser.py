# SPDX-License-Identifier: Apache-2.0
"""Opens the pages of the built site that have tables in headless Chromium, one after the other in a frame of a given width, and
measures them.

    python tests/site/browser.py site 1280    prints what does not fit, page by page
"""

import contextlib
import functools
import http.server
import json
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

HARNESS = """<!doctype html>
<iframe id="frame" style="border: 0; width: WIDTHpx; height: 2000px"></iframe>
<script>
const frame = document.getElementById("frame"), found = {};
// Finds tables that do not fit in their column and so are cut off or must be scrolled, and resources of other servers.
function look() {
  const inside = frame.contentDocument;
  const column = inside.querySelector("article").getBoundingClientRect();
  const wide = [...inside.querySelectorAll("article table")].filter((table) => {
    const wrap = table.closest(".md-typeset__scrollwrap") || table.parentElement;
    return table.getBoundingClientRect().right > column.right + 1 || wrap.scrollWidth > wrap.clientWidth + 1
        || [...table.querySelectorAll("th, td")].some((cell) => cell.scrollWidth > cell.clientWidth + 1);
  }).map((table) => table.querySelector("tr").innerText.replace(/\\s+/g, " ").trim());
  const foreign = frame.contentWindow.performance.getEntriesByType("resource").map((entry) => entry.name)
      .filter((name) => !name.startsWith(location.origin) && !name.startsWith("data:"));
  return {tables: inside.querySelectorAll("article table").length, wide, foreign, page_wide: inside.documentElement.scrollWidth - WIDTH};
}
(async () => {
  for (const page of PAGES) {
    await new Promise((resolve) => { frame.onload = resolve; frame.src = page; });
    await new Promise((resolve) => setTimeout(resolve, 150));
    found[page] = look();
  }
  fetch("/result", {method: "POST", body: JSON.stringify(found)});
})();
</script>"""


def chromium():
    """The browser's path, or None."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def measure(site, width, timeout=400):
    """{page: {"tables": count, "wide": [first rows], "foreign": [URLs], "page_wide": pixels}} of the pages with tables."""
    pages = sorted(
        str(p.relative_to(site)) for p in Path(site).rglob("*.html") if "api" not in p.parts and "<table" in p.read_text()
    )
    answer = queue.Queue()

    class Handler(http.server.SimpleHTTPRequestHandler):
        def do_GET(self):
            if self.path != "/harness":
                return super().do_GET()
            text = HARNESS.replace("WIDTH", str(width)).replace("PAGES", json.dumps(pages)).encode()
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(text)

        def do_POST(self):
            answer.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *args): ...

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler, directory=site)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with running(f"http://127.0.0.1:{server.server_port}/harness", f"--window-size={width + 20},2100"):
            found = answer.get(timeout=timeout)
        server.shutdown()
    return found


@contextlib.contextmanager
def running(url, *options):
    """Headless Chromium without a network, at this page."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [chromium(), "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}",
                   "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", *options, url]  # fmt: skip
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            try:
                yield process
            finally:
                process.kill()


def search_from_disk(site, word, timeout=60):
    """What the page shows that is opened as a file with a search for this word: HTML."""
    with running(f"{(Path(site) / 'frames.html').as_uri()}?q={word}", "--dump-dom", "--virtual-time-budget=10000") as process:
        return process.communicate(timeout=timeout)[0].split("md-search-result__list", 1)[-1].split("</ol>", 1)[0]


if __name__ == "__main__":
    result = measure(sys.argv[1], int(sys.argv[2]))
    for page, found in result.items():
        if found["wide"] or found["foreign"] or found["page_wide"] > 0:
            print(page, found)
    print(sum(len(f["wide"]) for f in result.values()), "of", sum(f["tables"] for f in result.values()), "tables do not fit")
