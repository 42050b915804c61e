# SPDX-License-Identifier: MIT
"""A bus of SLCAN lines: every line of text that one member sends goes to all others, whole."""

import os
import selectors
import socket
import threading
import tty
from pathlib import Path

CHUNK = 65536


class Hub:
    """Members connect to the stream socket `path`, or open a pseudo-terminal of pty()."""

    def __init__(self, path: Path):
        self.path = path
        self._stop = threading.Event()
        self._lines: dict[int, bytes] = {}    # received, without an end yet
        self._waiting: dict[int, bytes] = {}  # to be sent
        self._kept: list[int] = []            # ends of terminals that nobody may have open yet
        self._listen()

    def _listen(self) -> None:
        self._door = socket.socket(socket.AF_UNIX)
        self._door.bind(str(self.path))
        self._door.listen()
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._door, selectors.EVENT_READ)
        self._stop.clear()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def pty(self) -> str:
        """The name of a new terminal that is a member; raw, so that it echoes nothing."""
        own, others = os.openpty()
        tty.setraw(others)
        self._kept.append(others)
        self._join(own)
        return os.ttyname(others)

    def close(self) -> None:
        """Hang up on everybody."""
        self._stop.set()
        self._thread.join()
        for member in list(self._lines):
            self._leave(member)
        self._door.close()
        self.path.unlink()

    def open(self) -> None:
        """After close(): let them come again."""
        self._listen()

    def _join(self, member: int) -> None:
        os.set_blocking(member, False)
        self._lines[member] = self._waiting[member] = b""
        self._selector.register(member, selectors.EVENT_READ)

    def _leave(self, member: int) -> None:
        self._selector.unregister(member)
        del self._lines[member], self._waiting[member]
        os.close(member)

    def _run(self) -> None:
        while not self._stop.is_set():
            for key, events in self._selector.select(timeout=0.01):
                if key.fileobj is self._door:
                    self._join(self._door.accept()[0].detach())
                elif key.fd in self._lines:
                    self._serve(key.fd, events)

    def _serve(self, member: int, events: int) -> None:
        try:
            if events & selectors.EVENT_WRITE:
                self._flush(member)
            if events & selectors.EVENT_READ:
                self._hear(member)
        except OSError:
            self._leave(member)

    def _hear(self, member: int) -> None:
        text = os.read(member, CHUNK)
        if not text:
            raise ConnectionResetError
        whole, _, self._lines[member] = (self._lines[member] + text).rpartition(b"\r")
        said = b"".join(line + b"\r" for line in whole.split(b"\r") if line)
        for other in [other for other in self._lines if other != member]:
            self._waiting[other] += said
            self._flush(other)

    def _flush(self, member: int) -> None:
        """What the member takes now; the rest when it can be written to."""
        try:
            sent = os.write(member, self._waiting[member]) if self._waiting[member] else 0
        except BlockingIOError:
            sent = 0
        except OSError:
            sent = len(self._waiting[member])  # it has gone, which reading will tell
        self._waiting[member] = self._waiting[member][sent:]
        write = selectors.EVENT_WRITE if self._waiting[member] else 0
        self._selector.modify(member, selectors.EVENT_READ | write)
