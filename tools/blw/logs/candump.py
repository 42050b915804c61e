# SPDX-License-Identifier: MIT
"""candump -L logs: our own frames by their identifiers, anything else through a signal map."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import can
import cantools
import numpy as np

from blw import wire
from blw.errors import BulwarkError
from blw.logs.signal_map import Source
from blw.logs.steps import MOST_STEPS, Names, Steps, on_grid

#: In an identifier: the frame tells of an error on the bus (linux/can.h).
ERROR_FLAG = 0x20000000


def frames(path: Path) -> Iterator[tuple[int, can.Message]]:
    """Line number and frame of every data frame.  Raises BulwarkError for a line that is none."""
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = _Counted(file)
        reader = iter(can.CanutilsLogReader(lines))
        while True:
            try:
                frame = next(reader, None)
                data_frame = frame is not None and _is_data_frame(frame, lines.text)
            except (ValueError, IndexError):
                raise BulwarkError(f"{path}:{lines.number}: not a line of candump -L: "
                                   f"{lines.text.strip()[:60]!r}") from None
            if frame is None:
                return
            if not math.isfinite(frame.timestamp):
                raise BulwarkError(f"{path}:{lines.number}: the time is {frame.timestamp}")
            if data_frame:
                yield lines.number, frame


def _is_data_frame(frame: can.Message, line: str) -> bool:
    """python-can knows some of the error frames only, and takes half a byte for a whole one.

    Raises ValueError for the latter: it is where a log was cut off.
    """
    identifier, _, data = line.split()[2].partition("#")
    if frame.is_remote_frame or int(identifier, 16) & ERROR_FLAG:
        return False
    flags = 1 if frame.is_fd else 0
    if (len(data.lstrip("#")) - flags) % 2 != 0:
        raise ValueError("half a byte")
    return True


class _Counted:
    """The lines of a file for a reader that knows no line numbers."""

    def __init__(self, file):
        self._file = file
        self.number = 0
        self.text = ""

    def __iter__(self) -> Iterator[str]:
        for line in self._file:
            self.number, self.text = self.number + 1, line
            yield line

    def read(self) -> str:
        """What makes this a file for python-can; never called."""
        return self._file.read()

    def close(self) -> None:
        self._file.close()


def read_foreign(path: Path, sources: Sequence[Source], names: Names) -> Steps:
    """A log of somebody else's frames.  Raises BulwarkError."""
    by_id: dict[tuple[int, bool], list[Source]] = {}
    for source in sources:
        message = source.message
        by_id.setdefault((message.frame_id, message.is_extended_frame), []).append(source)
    found: list[tuple[float, int, float]] = []
    start = math.inf
    for line, frame in frames(path):
        start = min(start, frame.timestamp)
        identifier = (frame.arbitration_id, frame.is_extended_id)
        wanted = [source for source in by_id.get(identifier, ())
                  if source.entry.channel in (None, frame.channel)]
        if wanted:
            found += _values(f"{path}:{line}", frame, wanted)
    if not found:
        raise BulwarkError(f"{path}: has no frame of any message in the signal map")
    means = [False] * len(names.signals)
    for source in sources:
        means[source.column] = source.entry.combine == "mean"
    return on_grid(found, names, means, str(path), start)


def _values(where: str, frame: can.Message,
            sources: list[Source]) -> Iterator[tuple[float, int, float]]:
    message = sources[0].message
    try:
        said = message.decode(bytes(frame.data), decode_choices=False)
    except (cantools.Error, ValueError) as error:
        raise BulwarkError(f"{where}: {message.name}: {error}") from None
    for source in sources:
        entry = source.entry
        value = entry.unit_factor * float(said.get(source.signal, math.nan)) + entry.offset
        if math.isfinite(value) and (entry.valid is None or said.get(entry.valid)):
            yield frame.timestamp, source.column, value


def read_own(path: Path, names: Names) -> Steps:
    """A log of the frames of blw_wire.h: measurements and inputs, classic or FD, by their step.

    Frames with a wrong checksum or length are left out and counted; so are samples that two frames
    of one step contradict each other about.
    """
    found = _OwnFrames(names)
    for line, frame in frames(path):
        if frame.is_extended_id:
            continue
        try:
            found.take(frame.arbitration_id, bytes(frame.data))
        except wire.FrameError:
            found.dropped["with a wrong checksum or layout"] += 1
        if len(found.values) > 0 and found.span > MOST_STEPS:
            raise BulwarkError(f"{path}:{line}: its step is {found.span} steps from the first")
    if not found.values:
        raise BulwarkError(f"{path}: has no measurement frame of this model; a foreign log needs a "
                           "signal map (--map) and its DBC (--dbc)")
    return found.steps()


class _OwnFrames:
    """Values by (step, column) as the frames of a log come in."""

    def __init__(self, names: Names):
        self.names = names
        self.values: dict[tuple[int, int], float | None] = {}
        self.dropped: Counter[str] = Counter()
        self.now: int | None = None
        self.low = self.high = 0

    @property
    def span(self) -> int:
        return self.high - self.low

    def take(self, identifier: int, data: bytes) -> None:
        """One frame; an input of step k is the u(k-1) that led to it.  Raises wire.FrameError."""
        k = wire.get_sync(identifier, data)
        if k is not None and k != wire.K_END:
            self.now = k
        values = wire.get_values(identifier, data)
        if values is None:
            return
        size = len(self.names.sensors)
        base, limit = ((0, size) if values.base == wire.ID_MEASUREMENT
                       else (size, len(self.names.inputs)))
        step = self._step(values.seq)
        for index, value in enumerate(values.value, start=values.first):
            if index >= limit:
                self.dropped["of a sensor or input that the model lacks"] += 1
            elif value is not None:
                self._put(step - (base > 0), base + index, value)

    def _step(self, seq: int) -> int:
        """The step nearest to the last one whose low 16 bits are seq."""
        half = wire.SEQ // 2
        last = seq if self.now is None else self.now
        self.now = max(0, last + (seq - last + half) % wire.SEQ - half)
        first = not self.values
        self.low = self.now if first else min(self.low, self.now)
        self.high = self.now if first else max(self.high, self.now)
        return self.now

    def _put(self, step: int, column: int, value: float) -> None:
        if self.values.setdefault((step, column), value) != value:
            self.values[step, column] = None
            self.dropped["that contradict an earlier one of the same step"] += 1

    def steps(self) -> Steps:
        """All rows; the initial one is that before the first sample."""
        sensors = len(self.names.sensors)
        first = min((k for k, column in self.values if column < sensors), default=1) - 1
        first = max(0, min(first, self.low - 1))
        grid = np.full((self.high - first + 1, len(self.names.signals)), math.nan)
        for (k, column), value in self.values.items():
            grid[k - first, column] = math.nan if value is None else value
        t_s = self.names.dt_s * np.arange(first, self.high + 1)
        return Steps(self.names, first, t_s, grid, dropped=dict(self.dropped))
