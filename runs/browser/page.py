"""The page: HTML, styles, scripts and the drawing package in one file that loads nothing from anywhere.

Data stand in it as JSON. What is only needed once a point is selected, such as its trajectory, stands in blocks that are compressed, and
read when they are asked for.
"""

from __future__ import annotations

import base64
import gzip
import html
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec

STATIC = Path(__file__).parent / "static"
SCRIPTS = (
    *("words.js", "state.js", "looks.js", "scatter.js", "parallel.js", "preferences.js", "point.js", "flight.js", "table.js"),
    *("study.js", "main.js"),
)
"""In the order in which they build on each other."""
EMBEDDED, LIVE = "embedded.js", ("progress.js", "live.js")
"""Where data come from: this file, or a server."""
POLICY = "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; connect-src 'none'"
"""Content Security Policy: nothing from another place. 'unsafe-eval': the drawing package compiles programs for the graphics card."""
LIVE_POLICY = "default-src 'none'; script-src 'self' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; connect-src 'self'"
"""That of a page with a server: nothing but from that."""


def page(data: Mapping[str, Any], blocks: Mapping[str, bytes]) -> bytes:
    """A whole page.

    Parameters
    ----------
    data : plain data
        See `front_page` and `study_page`; "title" is that of the page.
    blocks : {name: bytes}
        Compressed by `packed`. Names are letters, digits and hyphens.

    Raises
    ------
    ValueError
        The drawing package is not installed.
    """
    parts = [
        _head(str(data["title"]), POLICY),
        b'<script type="application/json" id="page">',
        safe_json(data),
        b"</script>\n",
    ]
    parts += [b"<script>\n", _scripts(*SCRIPTS, EMBEDDED), b"</script>\n"]
    # What needs no figure is there before the drawing package has been read, and all figures before the details of points.
    parts += [b"<script>\n", plotly(), b"\n</script>\n<script>drawFigures();</script>\n"]
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


@lru_cache(maxsize=1)
def plotly() -> bytes:
    """The script of plotly, from its Python package. Raises ValueError if that is not installed."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        raise ValueError("pages for the browser need plotly: pip install 'macs-trajectories[browser]'") from None
    return str(get_plotlyjs()).encode()
