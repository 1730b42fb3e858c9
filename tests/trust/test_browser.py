"""The report in a browser: headless Chromium finds nothing wrong, fetches nothing, and has it fit a narrow screen."""

from __future__ import annotations

import http.server
import json
import os
import re
import shutil
import subprocess
import threading

import pytest

MEASURE = """<!DOCTYPE html><meta charset=utf-8><link rel=icon href="data:,">
<iframe id=f src="report.html" style="border:0;width:%dpx;height:900px"></iframe>
<script>
document.getElementById("f").onload = (event) => {
  const page = event.target.contentDocument, root = page.documentElement, seen = {};
  seen.width = root.clientWidth;
  seen.scroll = root.scrollWidth;
  seen.ink = getComputedStyle(page.body).color;
  seen.paper = getComputedStyle(page.body).backgroundColor;
  seen.line = getComputedStyle(page.querySelector("figure svg path[style*='--estimate']")).stroke;
  seen.loaded = event.target.contentWindow.performance.getEntriesByType("resource").length;
  seen.drawn = [...page.querySelectorAll("figure svg")].every(
    (svg) => svg.getBoundingClientRect().width > 250 && svg.getBoundingClientRect().right <= root.clientWidth + 1);
  const wide = (each) => each.scrollWidth > each.clientWidth + 1;
  seen.cut = [...page.querySelectorAll("h1, h2, p, figcaption")].filter(wide).length;
  seen.formulas = [...page.querySelectorAll("math")].every((math) => math.getBoundingClientRect().height > 8);
  seen.columns = new Set([...page.querySelectorAll("figure")].map((e) => e.getBoundingClientRect().left)).size;
  const out = document.createElement("pre");
  out.id = "seen";
  out.textContent = JSON.stringify(seen);
  document.body.append(out);
};
</script>"""


@pytest.fixture(scope="module")
def chromium():
    """The browser, which the build server must have."""
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if found is None:
        message = "no chromium; apt-get install chromium"
        pytest.fail(message) if os.environ.get("CI") else pytest.skip(message)
    return found


@pytest.fixture(scope="module")
def site(tmp_path_factory, linear):
    """A report on a server of its own, and what is asked of it."""
    folder, asked = tmp_path_factory.mktemp("site"), []
    (folder / "report.html").write_text(linear[2].html)
    for width in (400, 1400):
        (folder / f"at{width}.html").write_text(MEASURE % width)

    class Handler(http.server.SimpleHTTPRequestHandler):
        def __init__(self, *arguments):
            super().__init__(*arguments, directory=str(folder))

        def log_message(self, *arguments):
            pass

        def do_GET(self):
            asked.append(self.path)
            super().do_GET()

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}", asked
    server.shutdown()


def seen_by(chromium, profile, url, *options):
    """What the page has measured, and what the console has."""
    command = [
        chromium, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-extensions",
        "--disable-background-networking", "--disable-component-update", "--no-first-run", "--enable-logging=stderr",
        "--v=0", f"--user-data-dir={profile}", "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
        "--hide-scrollbars", "--window-size=1600,1000", "--virtual-time-budget=8000", *options, "--dump-dom", url,
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=120, check=False)
    match = re.search(r'<pre id="seen">(.*?)</pre>', done.stdout)
    assert match, done.stderr[-2000:]
    return json.loads(match.group(1)), [line for line in done.stderr.splitlines() if "CONSOLE" in line]


@pytest.mark.parametrize(("width", "columns", "scheme"), [(400, 1, "dark"), (1400, 2, "light")])
def test_in_chromium(chromium, site, tmp_path, width, columns, scheme):
    address, asked = site
    asked.clear()
    preferred = ["--blink-settings=preferredColorScheme=0"] if scheme == "dark" else []
    seen, console = seen_by(chromium, tmp_path, f"{address}/at{width}.html", *preferred)
    assert console == []
    assert asked == [f"/at{width}.html", "/report.html"]
    assert seen["loaded"] == 0
    assert seen["width"] == width
    assert seen["scroll"] == width
    assert seen["cut"] == 0
    assert seen["drawn"]
    assert seen["formulas"]
    assert seen["columns"] >= columns
    light = sum(map(int, re.findall(r"\d+", seen["paper"])[:3])) > sum(map(int, re.findall(r"\d+", seen["ink"])[:3]))
    assert light == (scheme == "light")
    assert seen["line"] == ("rgb(111, 177, 255)" if scheme == "dark" else "rgb(31, 95, 168)")
