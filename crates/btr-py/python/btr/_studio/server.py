"""The page's server: viser's, which answers only the browser that has the token, under its own names and origin."""

from __future__ import annotations

import contextlib
import hmac
import http
import io
import ipaddress
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from html import escape
from typing import Any, Union
from urllib.parse import parse_qs, urlsplit

import viser
from websockets.asyncio import server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

Answer = Callable[[ServerConnection, Request], Union[Response, None]]

LOOPBACK = "127.0.0.1"
LAST_WORD_S = 0.3
"""How long the server stays for its last message to open pages."""
# The client needs inline scripts, WebAssembly and workers of its own; nothing is loaded from or sent to other places.
POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; "
    "connect-src 'self' data: blob: ws://{host} wss://{host}; "
    "frame-ancestors 'none'; form-action 'none'; base-uri 'none'"
)
CLICKS = "/clicks/"
"""Address of a click, which a number follows."""
CLICKED = "X-Btr-Studio"
"""Header of a click. No foreign page can send it: a browser would first ask whether it may."""
VISERS_TITLE = b"<title>Viser</title>"
_PATCHING = threading.Lock()


class Guard:
    """Decides which requests are answered: those to this machine's own names, from the page itself, with the token."""

    def __init__(self, host: str) -> None:
        self.token = secrets.token_urlsafe(24)
        """What the page's address holds, and then a cookie."""
        self.stands = False
        """Whether a server asks this guard."""
        self.title = "btr studio"
        """Title of the page."""
        self.clicked: Callable[[int], None] = lambda _: None
        """Called with the number of each click, on a thread of its own."""
        machine = socket.gethostname().lower()
        self._names = {"localhost", host.lower(), machine, f"{machine}.local"}

    def refusal(self, request: Request) -> Union[str, None]:
        """Why a request is refused, token aside; None if it is not."""
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(hosts) != 1 or not self._is_own(hosts[0]):
            return "this page has another host"
        is_socket = request.headers.get("Upgrade", "").lower() == "websocket"
        own = [f"http://{hosts[0]}", f"https://{hosts[0]}"]
        if any(origin not in own for origin in origins) or (is_socket and len(origins) != 1):
            return "this page has another origin"
        return None

    def knows(self, token: str) -> bool:
        """Whether this is the token."""
        return hmac.compare_digest(token.encode(), self.token.encode())

    def answer(self, connection: ServerConnection, request: Request, answer: Answer) -> Union[Response, None]:
        """The answer to a request: a refusal, the cookie for the token, or what `answer` gives."""
        why = self.refusal(request)
        if why is not None:
            return _closed(connection.respond(http.HTTPStatus.FORBIDDEN, f"{why}\n"))
        name = f"btr_studio_{connection.local_address[1]}"
        address = urlsplit(request.path)
        if any(map(self.knows, parse_qs(address.query).get("token", []))):
            # The token does not stay in the address, where others might see it.
            response = connection.respond(http.HTTPStatus.FOUND, "")
            response.headers["Location"] = "/"
            response.headers["Set-Cookie"] = f"{name}={self.token}; Path=/; HttpOnly; SameSite=Lax"
            return _closed(response)
        if not any(map(self.knows, _cookies(request, name))):
            return _closed(connection.respond(http.HTTPStatus.FORBIDDEN, "open the address that btr studio printed\n"))
        number = request.path.removeprefix(CLICKS)
        if number != request.path and number.isdecimal() and CLICKED in request.headers:
            threading.Thread(target=self.clicked, args=(int(number),), name="btr studio click", daemon=True).start()
            return _closed(connection.respond(http.HTTPStatus.OK, ""))
        # The page's title is changed in its text.
        if request.path == "/" and "Accept-Encoding" in request.headers:
            del request.headers["Accept-Encoding"]
        response_or_none = answer(connection, request)
        if response_or_none is None:
            return None
        return _closed(_titled(response_or_none, self.title), request.headers["Host"])

    def _is_own(self, host: str) -> bool:
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        # A foreign page reaches this machine only under a name of its own, never as a plain address.
        return name in self._names or _is_address(name)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _cookies(request: Request, name: str) -> Iterator[str]:
    for header in request.headers.get_all("Cookie"):
        for cookie in header.split(";"):
            key, _, value = cookie.strip().partition("=")
            if key == name:
                yield value


def _titled(response: Response, title: str) -> Response:
    """viser's page with another title; any other response as it is."""
    if VISERS_TITLE in response.body:
        ours = f"<title>{escape(title)}</title>".encode(errors="replace")
        response.body = response.body.replace(VISERS_TITLE, ours, 1)
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))
    return response


def _closed(response: Response, host: str = "") -> Response:
    """A response that no other page may frame, and whose page reaches nothing else."""
    headers = {"X-Frame-Options": "DENY", "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff"}
    for key, value in {**headers, "Content-Security-Policy": POLICY.format(host=host)}.items():
        response.headers[key] = value
    return response


class Server(viser.ViserServer):
    """viser's server without its tunnel to the internet, behind a guard."""

    guard: Guard
    """What answers before viser does."""

    def request_share_url(self, verbose: bool = True) -> None:
        """Shares nothing: a page must not publish a robot's logs."""

    def stop(self) -> None:
        """Tells open pages that this is the end, and ends."""
        clients = self.get_clients().values()
        for client in clients:
            client.add_notification("btr studio has ended", "", with_close_button=False)
            client.flush()
        if clients:
            # Another thread sends it.
            time.sleep(LAST_WORD_S)
        super().stop()


def serve(host: str, port: int) -> tuple[Server, str]:
    """A server at this host and the first free port from `port` on, and the address of its page. Raises `RuntimeError`
    if this version of viser cannot be guarded."""
    guard = Guard(host)
    # viser tells an address that would not be answered.
    with _guarding(guard), contextlib.redirect_stdout(io.StringIO()):
        server = Server(host=host, port=port, label="btr studio", verbose=False)
    if not guard.stands:
        server.stop()
        raise RuntimeError("this version of viser is not known to btr studio: pip install 'viser>=1.1,<1.2'")
    server.guard = guard
    shown = LOOPBACK if host in ("0.0.0.0", "::", "") else host
    shown = f"[{shown}]" if ":" in shown else shown
    return server, f"http://{shown}:{server.get_port()}/?token={guard.token}"


@contextlib.contextmanager
def _guarding(guard: Guard) -> Iterator[None]:
    """Has the server that begins meanwhile ask the guard. viser itself has no place for this."""
    original: Any = websockets_server.serve

    def guarded(*arguments: Any, process_request: Answer, **options: Any) -> Any:
        guard.stands = True

        def asked(connection: ServerConnection, request: Request) -> Union[Response, None]:
            return guard.answer(connection, request, process_request)

        return original(*arguments, process_request=asked, **options)

    with _PATCHING:
        setattr(websockets_server, "serve", guarded)
        try:
            yield
        finally:
            setattr(websockets_server, "serve", original)
