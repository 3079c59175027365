"""A headless Chromium for tests that open pages: requests and errors of pages.

Driven by selenium (extra ``browser``) and the ``chromedriver`` beside the browser; nothing is
downloaded. Without any of the three the tests that need it are skipped and say which is missing.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path

import pytest

WIDTHS = (1366, 390)
_FLAGS = (
    "headless", "no-sandbox", "disable-gpu", "disable-quic", "no-first-run",
    "disable-background-networking", "disable-component-update", "disable-sync",
    "disable-dev-shm-usage", "hide-scrollbars",
)  # fmt: skip

#: Run in the page: what is wider than the window, pictures that are broken, controls without a name.
_OVERFLOW = """
const [width] = arguments; // of the window: a phone shows a page that is too wide at a smaller scale
const wide = document.documentElement.scrollWidth - width;
if (wide <= 0) return [];
const hidden = (e) => { for (; e; e = e.parentElement) {
  const s = getComputedStyle(e); if (s.overflowX !== 'visible' || s.position === 'fixed') return true;
} return false; };
const found = [...document.body.querySelectorAll('*')].filter(
  (e) => e.getBoundingClientRect().right > width + 0.5 && !hidden(e.parentElement));
const name = (e) => e.tagName + (e.id ? '#' + e.id : '') + ' ' + (e.getAttribute('class') || '');
return [wide + ' px', ...found.slice(0, 6).map((e) => name(e) + ': ' + e.textContent.trim().slice(0, 60))];
"""
_BROKEN = """
return [...document.images].filter((i) => i.complete && !i.naturalWidth).map((i) => i.src.slice(0, 200));
"""
_UNNAMED = """
const text = (ids) => ids.split(/\\s+/).map((i) => document.getElementById(i)?.textContent || '').join('');
const named = (e) => (e.getAttribute('aria-label') || text(e.getAttribute('aria-labelledby') || '')
  || [...(e.labels || [])].map((l) => l.textContent).join('')
  || (e.matches('button, a') && e.textContent) || e.getAttribute('alt') || '').trim();
const wanted = 'input, select, button, textarea, img, svg[role], [role=slider], a[href]';
return [...document.querySelectorAll(wanted)].filter((e) => !named(e)).map((e) => e.outerHTML.slice(0, 120));
"""


def missing() -> str:
    """What the browser tests lack, in words; empty if nothing."""
    if not _browser():
        return "no chromium on the PATH (Debian: apt-get install chromium chromium-driver)"
    if not shutil.which("chromedriver"):
        return "no chromedriver on the PATH (Debian: apt-get install chromium-driver)"
    try:
        import selenium  # noqa: F401
    except ImportError:
        return "no selenium (the extra `browser`)"
    return ""


def _browser() -> str | None:
    names = ("chromium", "chromium-browser", "google-chrome")
    return next((found for name in names if (found := shutil.which(name))), None)


class Browser:
    """A browser with an empty profile, and what happened in it since a page was opened."""

    def __init__(self, profile: Path):
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        options = webdriver.ChromeOptions()
        options.binary_location = _browser()
        for flag in (*_FLAGS, f"user-data-dir={profile}"):
            options.add_argument(f"--{flag}")
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        service = Service(executable_path=shutil.which("chromedriver"))
        self.driver = webdriver.Chrome(options=options, service=service)
        self.driver.set_script_timeout(120)
        self.width = 0
        self.complaints: list[str] = []
        self.requests: list[str] = []

    def find(self, selector: str):
        """The first element of a CSS selector."""
        return self.driver.find_element("css selector", selector)

    def open(self, path: Path, width: int = 1366, height: int = 900, hash: str = "") -> None:
        """Open a file at a width in pixels; a phone's width comes with touch and its pixel ratio."""
        self.driver.get("about:blank")  # a changed hash alone would not load the page
        self._drain()
        self.complaints, self.requests = [], []
        self.width = width
        phone = width < 600
        size = dict(width=width, height=height, deviceScaleFactor=2 if phone else 1, mobile=phone)
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self.driver.get(path.resolve().as_uri() + (f"#{hash}" if hash else ""))
        self._drain()

    def palette(self, scheme: str) -> None:
        """Prefer a light or a dark palette from now on."""
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})

    def run(self, script: str, *arguments: object) -> object:
        """Return what a script of the page returns; promises are waited for."""
        whole = (
            "const done = arguments[arguments.length - 1];"
            f"(async (...given) => {{ {script} }})(...[...arguments].slice(0, -1))"
            ".then((value) => done({value}), (error) => done({error: String(error.stack)}));"
        )
        answer = self.driver.execute_async_script(whole, *arguments)
        assert "error" not in answer, answer["error"]
        return answer.get("value")

    def errors(self) -> dict[str, list[str]]:
        """Errors of the present page, by kind."""
        self._drain()
        elsewhere = [
            u for u in self.requests if not u.startswith(("file:", "data:", "about:", "blob:"))
        ]
        found = {
            "wider than the window": self.driver.execute_script(_OVERFLOW, self.width),
            "broken picture": self.driver.execute_script(_BROKEN),
            "console": self.complaints,
            "request to elsewhere": elsewhere,
        }
        return {kind: what for kind, what in found.items() if what}

    def left_out(self) -> str:
        """What an explorer says that it could not read of its address."""
        return self.run(
            "return document.getElementById('left-out')?.textContent.split(': ')[1] ?? '';"
        )

    def unnamed(self) -> list[str]:
        """Controls and pictures that have no name for a screen reader."""
        return self.driver.execute_script(_UNNAMED)

    def picture(self, path: Path, whole: bool = True) -> None:
        """Save what the page looks like."""
        import base64

        options = {"captureBeyondViewport": whole}
        if whole:
            size = self.driver.execute_cdp_cmd("Page.getLayoutMetrics", {})["cssContentSize"]
            options["clip"] = {**size, "scale": 1}
        data = self.driver.execute_cdp_cmd("Page.captureScreenshot", options)["data"]
        path.write_bytes(base64.b64decode(data))

    def _drain(self) -> None:
        for entry in self.driver.get_log("browser"):
            if entry["level"] in ("SEVERE", "WARNING"):
                self.complaints.append(f"{entry['level']}: {entry['message']}")
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                self.requests.append(message["params"]["request"]["url"])


def opened():
    """Yield a browser, or skip with the reason; for a fixture."""
    lacking = missing()
    if lacking:
        pytest.skip(f"browser tests: {lacking}")
    with tempfile.TemporaryDirectory() as profile:
        browser = Browser(Path(profile))
        try:
            yield browser
        finally:
            browser.driver.quit()
