"""A page as headless Chromium shows it, where there is one."""

import json
import os
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium")
SEEN = """<script>addEventListener("load", () => {
const all = [...document.images], page = document.documentElement;
const fetched = performance.getEntriesByType("resource").map(entry => entry.name);
document.title = JSON.stringify({
  widths: all.map(image => image.naturalWidth), tall: page.scrollHeight,
  wide: page.scrollWidth <= innerWidth, fetched: fetched.filter(name => !name.startsWith("data:")),
}); })</script>"""


def in_browser(page: str, folder: Path) -> dict:
    """What a browser says of a page once it has loaded.

    ``widths`` of its pictures as decoded (0 where one is not), ``tall`` px, whether it is no
    ``wide``r than a window of 1000 px, and what it ``fetched`` beside itself.
    """
    (folder / "page.html").write_text(page.replace("</body>", f"{SEEN}</body>"), encoding="utf-8")
    options = "--headless --no-sandbox --disable-gpu --window-size=1000,800 --dump-dom".split()
    shown = subprocess.run(
        [BROWSER, *options, (folder / "page.html").as_uri()], capture_output=True, text=True,
        timeout=60, env={"HOME": str(folder), "PATH": os.environ["PATH"]},
    ).stdout  # fmt: skip
    return json.loads(unescape(re.search("<title>(.*?)</title>", shown).group(1)))
