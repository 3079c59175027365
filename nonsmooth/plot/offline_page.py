"""Self-contained HTML pages with styles, scripts and data inside.

Parts that all pages share (colours; ``controls.js`` for planes, draggable points and sliders) are in
the folder ``web``.
"""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from ..model import FilippovSystem, OptionError
from .driver import described, module

WEB = Path(__file__).parent / "web"
#: In the page's head, so that a browser loads nothing from elsewhere.
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
#: The same, with WebAssembly and a worker whose program is in the page.
_POLICY_OF_DRIVER = _POLICY.replace("; img", " 'wasm-unsafe-eval'; worker-src blob:; img")


def offline_page(
    title: str,
    body: str,
    *,
    styles: Sequence[str] = (),
    scripts: Sequence[str] = (),
    data: Mapping[str, Any] | None = None,
    systems: Mapping[str, FilippovSystem] | None = None,
) -> str:
    """Put a page together that opens from a file, without a server and without a network.

    Parameters
    ----------
    title : str
        What the browser's tab says.
    body : str
        HTML of what is between ``<body>`` and the scripts.
    styles, scripts : sequence of str, optional
        Further style sheets and scripts (their text), after those that all pages share.
    data : mapping, optional
        What ``Page.data(name)`` gives the scripts: anything that JSON can hold.
    systems : mapping, optional
        Systems that the scripts integrate: ``await Engine.of(name)`` is the library's own driver, compiled to
        WebAssembly, with that system. ``engine.simulate(x, p, {tEnd, tol})`` is one run.

    Returns
    -------
    str
        The page, as HTML.

    Raises
    ------
    OptionError
        Data that JSON cannot hold, such as NaN; a title or a body that is no text.

    Examples
    --------
    >>> page = offline_page("A page", "<p id='p'></p>", data={"one": {"a": "</script>"}})
    >>> page.count("<script"), "https" in page
    (2, False)
    """
    for name, text in (("title", title), ("body", body)):
        if not isinstance(text, str):
            raise OptionError(f"{name} is {text!r}, not a text.")
    sheets = "\n".join([_shared("page.css"), *styles])
    blocks = [_data(name, value) for name, value in (data or {}).items()]
    shared = [_shared("controls.js")]
    if systems:
        blocks += [_data(f"system-{name}", described(own)) for name, own in systems.items()]
        blocks.append(_data("module", module()))
        shared.append(_shared("engine.js"))
    blocks += [f"<script>\n{text}</script>" for text in (*shared, *scripts)]
    policy = _POLICY_OF_DRIVER if systems else _POLICY
    return "\n".join(
        [
            "<!doctype html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            '<link rel="icon" href="data:,">',
            f"<title>{html.escape(title)}</title>",
            f"<style>\n{sheets}</style></head>",
            f"<body>\n{body}",
            *blocks,
            "</body></html>\n",
        ]
    )


def installed_version() -> str:
    """Version of the installed distribution, for the foot of a page; empty in a bare checkout."""
    try:
        return metadata.version("nonsmooth-dynamics")
    except metadata.PackageNotFoundError:
        return ""


def _shared(name: str) -> str:
    return (WEB / name).read_text(encoding="utf-8")


def _data(name: str, value: Any) -> str:
    try:
        text = json.dumps(value, ensure_ascii=False, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise OptionError(
            f"data {name!r} is {type(value).__name__} {str(value)[:60]!r}, which JSON cannot hold ({error}). "
            "Give finite numbers, texts, and lists and dicts of them."
        ) from error
    text = text.replace("<", "\\u003c")  # no end of the script inside a text
    return f'<script type="application/json" id="data-{html.escape(name)}">{text}</script>'
