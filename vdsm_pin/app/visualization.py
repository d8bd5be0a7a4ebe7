"""The 3D view of a problem and its motion: an offline page, or a local server.

The page is drawn by Meshcat's viewer. The server needs no display and no second
process: it hands the page out, and tells it when a file has changed.
"""

import hashlib
import sys
import time
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Lock
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from vdsm_pin.app.subjects import ProblemOrCell, read_problem_or_cell, subject_of
from vdsm_pin.errors import InvalidInput, VdsmError
from vdsm_pin.io.atomic import write_text
from vdsm_pin.report.drawing import Drawing
from vdsm_pin.report.folder import check_outputs
from vdsm_pin.report.html import message_page, view_page
from vdsm_pin.report.page_data import drawing_of

HOST: Final = "127.0.0.1"
_LONGEST_WAIT: Final = 20.0  # seconds a page waits for one answer
_LOOK: Final = 0.25  # seconds between looks at the files


def drawing(problem: ProblemOrCell, trajectory: Path | None) -> Drawing:
    """How the motion of a file looks, or the arm or robot where it begins.

    Raises:
        InvalidInput: If the trajectory is bad.
    """
    subject = subject_of(problem)
    motion = subject.at_start() if trajectory is None else subject.read(trajectory)
    return drawing_of(problem, motion)


def write_page(path: Path, problem: str, trajectory: Path | None) -> None:
    """Write the view as one offline page.

    Raises:
        InvalidInput: If a file is bad or the page cannot be written.
    """
    asked = read_problem_or_cell(problem)
    motion = () if trajectory is None else (trajectory,)
    check_outputs((*asked.files, *motion), files=[(path, (".html", ".htm"))])
    write_text(path, view_page(drawing(asked, trajectory)))


class ViewServer(ThreadingHTTPServer):
    """Serves one page to this machine.

    Args:
        problem: Built-in name or path.
        trajectory: The motion; None for the arm at the start.
        port: To listen on; 0 for any free one.
        watch: Whether the page reloads when a file changes.

    Raises:
        InvalidInput: If a file is bad or the port is taken.
    """

    daemon_threads = True

    def __init__(
        self, problem: str, trajectory: Path | None, port: int, watch: bool
    ) -> None:
        self._problem, self._trajectory = problem, trajectory
        self.watch, self.ended = watch, False
        self._files: tuple[Path, ...] = ()
        self._seen, self._page, self._lock = "", "", Lock()
        drawing(self._read(), trajectory)  # bad files are refused at once
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as error:
            reason = error.strerror or error
            message = f"port {port} cannot be used: {reason}; --port 0 is free"
            raise InvalidInput(message) from error

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{HOST}:{self.server_address[1]}/"

    def state(self) -> str:
        """A word that changes when a file does."""
        facts = []
        for path in self._files:
            try:
                status = path.stat()
                facts.append((status.st_mtime_ns, status.st_size))
            except OSError:
                facts.append((0, 0))
        return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]

    def _read(self) -> ProblemOrCell:
        """Read the problem; from now on its files are watched."""
        problem = read_problem_or_cell(self._problem)
        motion = () if self._trajectory is None else (self._trajectory,)
        self._files = (*problem.files, *motion)
        return problem

    def current_page(self) -> str:
        """The page of the files as they are now, or what is wrong with them."""
        with self._lock:  # two tabs may ask at once
            state = self.state()
            if state != self._seen:
                live = state if self.watch else ""
                try:
                    self._page = view_page(
                        drawing(self._read(), self._trajectory), live
                    )
                except VdsmError as error:
                    self._page = message_page(str(error), live)
                self._seen = state
            return self._page

    def changed_since(self, seen: str) -> bool:
        """Wait for a change of the files, but not for ever."""
        until = time.monotonic() + _LONGEST_WAIT
        while time.monotonic() < until and not self.ended:
            if self.state() != seen:
                return True
            time.sleep(_LOOK)
        return False

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Pass over readers that went away, and what an interrupt cuts off."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)

    def server_close(self) -> None:
        """Let go of the port and of the pages that wait."""
        self.ended = True
        super().server_close()


class _Handler(BaseHTTPRequestHandler):
    """Answers the two addresses there are."""

    server: ViewServer

    def do_GET(self) -> None:
        """The page, or whether it is out of date."""
        address = urlsplit(self.path)
        if address.path == "/":
            self._answer("text/html; charset=utf-8", self.server.current_page())
        elif address.path == "/changed":
            seen = parse_qs(address.query).get("seen", [""])[0]
            answer = "yes" if self.server.changed_since(seen) else "no"
            self._answer("text/plain; charset=utf-8", answer)
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def _answer(self, kind: str, text: str) -> None:
        body = text.encode("utf-8")
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *arguments: object) -> None:
        """Requests are not worth a line."""


def serve(
    problem: str,
    trajectory: Path | None,
    *,
    port: int,
    watch: bool,
    announce: Callable[[str], object],
) -> None:
    """Serve the view until Ctrl-C.

    Raises:
        InvalidInput: If a file is bad or the port is taken.
    """
    with ViewServer(problem, trajectory, port, watch) as server:
        announce(f"{server.url}  (Ctrl-C ends)")
        try:
            server.serve_forever(poll_interval=_LOOK)
        except KeyboardInterrupt:
            announce("closed")
