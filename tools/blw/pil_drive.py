# SPDX-License-Identifier: MIT
"""Drives a node over a serial line or a CAN interface: the frames of a step, then its answer.

Needs nothing but Python's own library, so that it also runs inside user-mode Linux:

    python -m blw.pil_drive slcan:unix:PATH|can:INTERFACE STEPS ANSWERS

STEPS has a line per step, of frames ID#DATA in hex; ANSWERS gets the frames that came back, a line
per step that was answered.
"""

import re
import select
import socket
import struct
import sys
import time
from collections.abc import Iterable, Iterator
from itertools import chain, pairwise
from pathlib import Path
from typing import Protocol

Frame = tuple[int, bytes]

MEASUREMENTS = range(0x100, 0x140)
STATUS = 0x280
FLAGS_BYTE = 6
PATIENCE_S = 5.0
CHUNK = 65536

_SLCAN_FRAME = re.compile(rb"t([0-9A-Fa-f]{3})[0-8]((?:[0-9A-Fa-f]{2})*)")
_CAN_FRAME = struct.Struct("=IB3x8s")


class Line(Protocol):
    """Something that frames go over."""

    def send(self, frames: list[Frame]) -> None: ...

    def receive(self) -> list[Frame]:
        """What has come, after waiting for it up to PATIENCE_S; [] if nothing came."""


class SlcanLine:
    """SLCAN text over a stream socket that somebody listens on, or is about to."""

    def __init__(self, path: str) -> None:
        until = time.monotonic() + PATIENCE_S
        while True:
            self._socket = socket.socket(socket.AF_UNIX)
            try:
                self._socket.connect(path)
                break
            except OSError:
                self._socket.close()
                if time.monotonic() > until:
                    raise
                time.sleep(0.02)
        self._rest = b""

    def send(self, frames: list[Frame]) -> None:
        self._socket.sendall(b"".join(b"t%03X%d%s\r" % (identifier, len(data),
                                                        data.hex().upper().encode())
                                      for identifier, data in frames))

    def receive(self) -> list[Frame]:
        while select.select([self._socket], [], [], PATIENCE_S)[0]:
            data = self._socket.recv(CHUNK)
            *lines, self._rest = (self._rest + data).split(b"\r")
            found = [one for one in map(_SLCAN_FRAME.fullmatch, lines) if one]
            if found or not data:
                return [(int(one[1], 16), bytes.fromhex(one[2].decode())) for one in found]
        return []


class CanLine:
    """A SocketCAN interface."""

    def __init__(self, interface: str) -> None:
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.bind((interface,))

    def send(self, frames: list[Frame]) -> None:
        for identifier, data in frames:
            self._socket.send(_CAN_FRAME.pack(identifier, len(data), data))

    def receive(self) -> list[Frame]:
        if not select.select([self._socket], [], [], PATIENCE_S)[0]:
            return []
        identifier, size, data = _CAN_FRAME.unpack(self._socket.recv(_CAN_FRAME.size))
        return [(identifier, data[:size])]


def open_line(place: str) -> Line:
    """slcan:unix:PATH or can:INTERFACE."""
    kind, _, rest = place.partition(":")
    return CanLine(rest) if kind == "can" else SlcanLine(rest.removeprefix("unix:"))


def drive(line: Line, steps: Iterable[list[Frame]]) -> Iterator[list[Frame]]:
    """Send the frames of every step; yield those that came back up to the step's status and the
    sensors after it, or [] if they did not.

    A node waits for a sample that is missing until its deadline, or until the next sync: that is
    sent at once, and the rest of its step after the answer.
    """
    sent = 0  # frames of this step that went ahead
    for frames, following in pairwise(chain(steps, [[]])):
        line.send(frames[sent:])
        sent = 1 if following and any(map(_is_missing, frames)) else 0
        line.send(following[:sent])
        yield _answer(line)


def _is_missing(frame: Frame) -> bool:
    """A measurement that says that there is no sample."""
    identifier, data = frame
    return identifier in MEASUREMENTS and not data[FLAGS_BYTE] & 1


def _answer(line: Line) -> list[Frame]:
    """Every frame until the sensors' that follows the status: the last of a report."""
    found: list[Frame] = []
    while True:
        frames = line.receive()
        if not frames:
            return []
        found += frames
        if any(identifier == STATUS for identifier, _ in found) and found[-1][0] > STATUS:
            return found


def text(frames: list[Frame]) -> str:
    """A line of ID#DATA words."""
    return " ".join(f"{identifier:03x}#{data.hex()}" for identifier, data in frames)


def parse(line: str) -> list[Frame]:
    """The frames of such a line."""
    words = (word.split("#") for word in line.split())
    return [(int(identifier, 16), bytes.fromhex(data)) for identifier, data in words]


def main(place: str, steps: str, answers: str) -> None:
    lines = Path(steps).read_text(encoding="utf-8").splitlines()
    with Path(answers).open("w", encoding="utf-8") as stream:
        for found in drive(open_line(place), map(parse, lines)):
            stream.write(text(found) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
