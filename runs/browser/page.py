"""The page: HTML, styles, scripts and the drawing package in one file that loads nothing from anywhere.

Data stand in it as JSON. What is only needed once a point is selected, such as its trajectory, stands in blocks that are compressed, and
read when they are asked for. The drawing package stands in it as text, which the page hands to the browser as a script of its own: browsers
compile scripts that are loaded beside the page, but those that stand in it only in turn.
"""

from __future__ import annotations

import base64
import gzip
import html
import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec

STATIC = Path(__file__).parent / "static"
SCRIPTS = (
    *("words.js", "state.js", "looks.js", "scatter.js", "parallel.js", "preferences.js", "point.js", "flight.js", "along.js"),
    *("table.js", "study.js", "main.js"),
)
"""In the order in which they build on each other."""
EMBEDDED, LIVE = "embedded.js", ("progress.js", "live.js")
"""Where data come from: this file, or a server."""
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob:; style-src 'unsafe-inline'; img-src data: blob:; connect-src 'none'"
)
"""Content Security Policy: nothing from another place. 'unsafe-eval': the drawing package compiles programs for the graphics card. "blob:":
the page hands that package to the browser under an address that only the page has."""
LIVE_POLICY = "default-src 'none'; script-src 'self' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; connect-src 'self'"
"""That of a page with a server: nothing but from that."""


def page(data: Mapping[str, Any], blocks: Mapping[str, bytes]) -> bytes:
    """A whole page."""
    parts = [
        _head(str(data["title"]), POLICY),
        b'<script type="application/json" id="page">',
        safe_json(data),
        b"</script>\n",
    ]
    parts += [b"<script>\n", _scripts(*SCRIPTS, EMBEDDED), b"</script>\n"]
    # What needs no figure is there before the drawing package; that is compiled while the details of points, which come last, are read.
    parts += [b'<script type="text/plain" id="package">', plotly(), b"</script>\n<script>readPackage();</script>\n"]
    for name, content in blocks.items():
        parts += [f'<script type="application/octet-stream" id="block-{name}">'.encode(), base64.b64encode(content), b"</script>\n"]
    return b"".join([*parts, b"</body>\n</html>\n"])


def packed(content: Any) -> bytes:
    """Plain data as compressed JSON; the same data give the same bytes."""
    return gzip.compress(msgspec.json.encode(content), compresslevel=6, mtime=0)


def safe_json(content: Any) -> bytes:
    """Plain data as JSON that cannot end the script element in which it stands, whatever texts are in it."""
    return msgspec.json.encode(content).replace(b"<", b"\\u003c")


def _head(title: str, policy: str) -> bytes:
    """The page up to its data."""
    text = (STATIC / "page.html").read_text(encoding="utf-8")
    style = (STATIC / "page.css").read_text(encoding="utf-8")
    for mark, content in (("{{policy}}", policy), ("{{style}}", style), ("{{title}}", html.escape(title))):  # the user's words last
        text = text.replace(mark, content)
    return text.encode()


def live_page(title: str) -> bytes:
    """A page without data, which its scripts ask its server for."""
    return _head(title, LIVE_POLICY) + b'<script src="scripts.js"></script>\n<script src="plotly.js" defer></script>\n</body>\n</html>\n'


def live_scripts() -> bytes:
    """Our own scripts of such a page."""
    return _scripts(*SCRIPTS, *LIVE)


@lru_cache(maxsize=2)
def _scripts(*names: str) -> bytes:
    """Our own scripts, one after the other."""
    return b"\n".join((STATIC / name).read_bytes() for name in names)


WRAPPER = re.compile(r"(/\*.*?\*/\n)\(\s*function\(root, factory\).*? self : this, \(\) => \{(.*)return Plotly;\s*\}\)\);\s*", re.DOTALL)
"""What plotly's script has around it for loaders of modules: its licence before, and inside what a page needs."""


@lru_cache(maxsize=1)
def plotly() -> bytes:
    """The script of plotly, from its Python package. Raises ValueError if that is not installed.

    It comes without the function for loaders of modules, which is around all of it: browsers would read it all twice, first to find where
    that function ends, then because it is called.
    """
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        raise ValueError("pages for the browser need plotly: pip install 'macs-trajectories[browser]'") from None
    script = str(get_plotlyjs())
    found = WRAPPER.fullmatch(script)
    return (script if found is None else found[1] + found[2]).encode()
