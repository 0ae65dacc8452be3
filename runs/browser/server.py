"""The server: a few routes, each of which only reads.

It serves no file by its path, and answers nothing but GET and HEAD. On an address of this machine it answers only to names of this
machine, so that a page of another place cannot read it by a name that leads here ("DNS rebinding").
"""

from __future__ import annotations

import gzip
import ipaddress
import logging
import re
import socket
import socketserver
import sys
from functools import lru_cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

import msgspec

from .live import Followed
from .page import LIVE_POLICY, live_page, live_scripts, plotly

log = logging.getLogger(__name__)

NAMES = frozenset({"localhost", "127.0.0.1", "[::1]"})
"""Names of this machine that a browser may have asked for."""
HEADERS = {
    "Content-Security-Policy": f"{LIVE_POLICY}; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
HTML, SCRIPT, JSON = "text/html; charset=utf-8", "text/javascript; charset=utf-8", "application/json"


class Server(ThreadingHTTPServer):
    """A server of one page."""

    daemon_threads = True
    request_queue_size = 1024  # connections that wait to be answered: a browser with many pages opens them at once

    def __init__(self, followed: Followed, host: str = "127.0.0.1", port: int = 0) -> None:
        self.followed, self.page = followed, live_page(followed.title)
        plotly()
        try:
            self.address_family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
            super().__init__(address[:2], Handler)  # type: ignore[arg-type]
        except socket.gaierror as error:
            raise ValueError(f"--host {host}: {error.strerror}") from None
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise ValueError(
                f"port {port} of {host} cannot be had ({reason}): give another --port, or --port 0 for any that is free"
            ) from None
        bound = str(self.server_address[0])
        self.local = ipaddress.ip_address(bound.partition("%")[0]).is_loopback
        self.url = f"http://{f'[{bound}]' if ':' in bound else bound}:{self.server_address[1]}/"

    def server_bind(self) -> None:
        """Without asking for the name of this machine, which may take long where there is no network."""
        socketserver.TCPServer.server_bind(self)
        self.server_name, self.server_port = str(self.server_address[0]), int(self.server_address[1])

    def handle_error(self, request: Any, client_address: Any) -> None:
        """An error is a line of the log; none, if the browser has only gone away."""
        error = sys.exc_info()[1]
        if not isinstance(error, ConnectionError | TimeoutError):
            log.error("%s: %s", type(error).__name__, error)


class Handler(BaseHTTPRequestHandler):
    """Answers one request after the other of one connection."""

    protocol_version = "HTTP/1.1"
    server_version, sys_version = "macs", ""
    timeout = 60.0
    server: Server

    def do_GET(self) -> None:
        """Answer with the content of a route."""
        if self.headers.get("Content-Length", "0") != "0" or "Transfer-Encoding" in self.headers:
            self.close_connection = True  # what follows is no request
        if self.server.local and not _is_local(self.headers.get("Host", "")):
            self._send(HTTPStatus.FORBIDDEN, "text/plain", f"This server only answers at {self.server.url}\n".encode())
            return
        try:
            found = self._found(urlsplit(self.path).path)
        except ValueError:  # it is no address
            found = None
        if found is None:
            self._send(HTTPStatus.NOT_FOUND, "text/plain", b"There is no such page.\n")
            return
        kind, content, packed = found
        if not packed and len(content) > 1000 and "gzip" in self.headers.get("Accept-Encoding", ""):
            content, packed = _compressed(content), True
        self._send(HTTPStatus.OK, kind, content, packed)

    do_HEAD = do_GET  # noqa: N815 - as http.server has it

    def __getattr__(self, name: str) -> Any:
        """All other methods are refused."""
        if name.startswith("do_"):
            return self._refuse
        raise AttributeError(name)

    def _refuse(self) -> None:
        self.close_connection = True  # what it sends along is not read
        self._send(HTTPStatus.METHOD_NOT_ALLOWED, "text/plain", b"This server only answers GET and HEAD.\n")

    def _found(self, path: str) -> tuple[str, bytes, bool] | None:
        """Kind, content and whether it is compressed, of a route; None if there is none."""
        followed = self.server.followed
        if path == "/":
            return HTML, self.server.page, False
        if path == "/plotly.js":
            return SCRIPT, plotly(), False
        if path == "/scripts.js":
            return SCRIPT, live_scripts(), False
        if path == "/status.json":
            return JSON, msgspec.json.encode(followed.status()), False
        if (named := re.fullmatch(r"/(data|going|measures)\.json", path)) and (content := followed.answer(named[1])):
            return JSON, content, False
        if (named := re.fullmatch(r"/details/([0-9a-f-]{1,40})\.json", path)) and (content := followed.details(named[1])):
            return JSON, content, True
        return None

    def _send(self, status: HTTPStatus, kind: str, content: bytes, packed: bool = False) -> None:
        self.send_response(status)
        own = {"Content-Type": kind, "Content-Length": str(len(content)), "Cache-Control": "no-store", **HEADERS}
        own |= {"Content-Encoding": "gzip"} if packed else {}
        own |= {"Allow": "GET, HEAD"} if status == HTTPStatus.METHOD_NOT_ALLOWED else {}
        own |= {"Connection": "close"} if self.close_connection else {}
        for name, value in own.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: a line for each request would say nothing to anybody."""


@lru_cache(maxsize=8)
def _compressed(content: bytes) -> bytes:
    return gzip.compress(content, compresslevel=1, mtime=0)


def _is_local(host: str) -> bool:
    """Whether the Host header names this machine, with or without a port."""
    return re.sub(r":\d*$", "", host).lower() in NAMES
