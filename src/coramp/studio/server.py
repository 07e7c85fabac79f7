"""The studio's server: this machine only, three addresses, nothing kept."""

import errno
import select
import socket
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import closing, suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, ClassVar
from urllib.parse import parse_qsl, urlsplit

from coramp.errors import CorampError
from coramp.studio.answers import Answers
from coramp.studio.dials import studio_of

HOST = "127.0.0.1"
READ_S = 10.0
"""So long a client may take to send a request, and to take a piece of the answer."""
HTML, LINES, TOML = "text/html", "application/x-ndjson", "application/toml"
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class StudioServer(ThreadingHTTPServer):
    """Serves one studio on this machine; ``address`` is where its page lies."""

    daemon_threads = True

    def __init__(self, scenario: str, port: int) -> None:
        """Takes the port, 0 for any that is free; raises CorampError where it cannot."""
        if not 0 <= port <= 65535:
            raise CorampError(f"--port: {port} is out of range; allowed is 0 (any) to 65535")
        self.answers = Answers(studio_of(scenario))
        self.reading: dict[socket.socket, float] = {}
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as error:
            in_use = error.errno == errno.EADDRINUSE
            reason = "is in use" if in_use else f"cannot be taken ({error.strerror})"
            raise CorampError(
                f"--port: {port} {reason}; give another, or 0 for any that is free"
            ) from None

    @property
    def address(self) -> str:
        """The page's address."""
        return f"http://{HOST}:{self.server_port}/"

    @property
    def names(self) -> set[str]:
        """What browsers may call this server; a foreign name could be another site's."""
        return {f"{name}:{self.server_port}" for name in (HOST, "localhost")}

    def service_actions(self) -> None:
        """Hangs up on clients that take too long to send a request; called twice a second."""
        now_s = time.monotonic()
        for connection, until_s in list(self.reading.items()):
            if now_s > until_s:
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)

    def server_close(self) -> None:
        """Gives the port back, and ends the processes of runs in SUMO."""
        super().server_close()
        self.answers.close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that went away is no error; says anything else in one line."""
        del request, client_address
        error = sys.exc_info()[1]
        if not isinstance(error, ConnectionError | TimeoutError):
            print(f"Error: {type(error).__name__}: {error}", file=sys.stderr)


class _Handler(BaseHTTPRequestHandler):
    server: StudioServer
    protocol_version = "HTTP/1.1"
    paths: ClassVar[dict[str, str]] = {"/": HTML, "/runs": LINES, "/scenario.toml": TOML}
    timeout = READ_S

    def handle_one_request(self) -> None:
        """Reads a request and answers it; the server hangs up if reading takes too long."""
        self.server.reading[self.connection] = time.monotonic() + READ_S
        try:
            super().handle_one_request()
        finally:
            self.server.reading.pop(self.connection, None)

    def do_GET(self) -> None:
        self.server.reading.pop(self.connection, None)
        if self.headers.get("Host") not in self.server.names:
            return self._send(HTTPStatus.FORBIDDEN, "text/plain", "another site's name\n")
        if self.headers.get("Transfer-Encoding") or self.headers.get("Content-Length", "0") != "0":
            self.close_connection = True  # or what follows would be read as the next request
            return self._send(HTTPStatus.BAD_REQUEST, "text/plain", "a body is not read here\n")
        try:
            asked = urlsplit(self.path)
            settings = dict(parse_qsl(asked.query, keep_blank_values=True))
        except ValueError:
            return self._send(HTTPStatus.BAD_REQUEST, "text/plain", "the address is not valid\n")
        kind = self.paths.get(asked.path)
        if kind is None:
            return self._send(HTTPStatus.NOT_FOUND, "text/plain", "there is no such page\n")
        answers = self.server.answers
        if kind == LINES:
            return self._send_lines(answers.lines(settings))
        try:
            text = answers.scenario_toml(settings) if kind == TOML else answers.page()
        except CorampError as error:
            return self._send(HTTPStatus.BAD_REQUEST, "text/plain", "\n".join(error.messages))
        return self._send(HTTPStatus.OK, kind, text)

    def _send(self, status: HTTPStatus, kind: str, text: str) -> None:
        content = text.encode()
        self._send_head(status, kind, ("Content-Length", str(len(content))))
        self.wfile.write(content)

    def _send_lines(self, lines: Generator[str]) -> None:
        """Sends each line as soon as it is there; leaves off once the client has gone away."""
        self._send_head(HTTPStatus.OK, LINES, ("Transfer-Encoding", "chunked"))
        with closing(lines):
            for line in lines:
                if self._has_gone():
                    self.close_connection = True
                    return
                content = f"{line}\n".encode()
                self.wfile.write(b"%x\r\n%b\r\n" % (len(content), content))
        self.wfile.write(b"0\r\n\r\n")

    def _has_gone(self) -> bool:
        """Whether the client has closed its side; what it sends meanwhile stays unread."""
        readable, _, _ = select.select([self.connection], [], [], 0.0)
        return bool(readable) and not self.connection.recv(1, socket.MSG_PEEK)

    def _send_head(self, status: HTTPStatus, kind: str, length: tuple[str, str]) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header(*length)
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")
        if self.close_connection:
            self.send_header("Connection", "close")
        if kind == TOML:
            name = self.server.answers.saved_name
            self.send_header("Content-Disposition", f'attachment; filename="{name}.toml"')
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the library names it
        """Says nothing of what goes well."""


def serve(scenario: str, port: int, say: Callable[[str], None]) -> None:
    """Serves the studio of a scenario until it is interrupted; ``say`` is told its address.

    Raises CorampError for a scenario that is not valid and for a port that cannot be taken.
    """
    with StudioServer(scenario, port) as server:
        # The first picture is computed while the browser opens.
        threading.Thread(target=server.answers.get_ready, daemon=True).start()
        say(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            return
