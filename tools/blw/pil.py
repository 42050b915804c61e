# SPDX-License-Identifier: MIT
"""Firmware in the loop: the example node of port/firmware in QEMU, driven over its serial line by
what the simulator measured, its answers held against the library on the host, bit by bit.
"""

import csv
import struct
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from blw import pil_drive, wire
from blw.atomic import write_changed, write_files
from blw.build import BUILD, StepFailed, build_programs
from blw.cost.cases import owner
from blw.cost.targets import TARGETS
from blw.design import Design, json_text
from blw.emit_c import files
from blw.pil_drive import Frame

TARGET = TARGETS["m4f"]
FOLDER = BUILD / "pil"
REPORT = "pil.json"
MAX_ITERATIONS = 255

#: The host may be busy with other things; only a last step with missing samples waits so long.
DEADLINE_US = 2_000_000

#: The estimate [n] as bytes of float32, and the solver's iterations.
Answer = tuple[bytes, int]

#: From where the serial line is, and the frames of all steps, to the answers to all of them.
Driver = Callable[[Path, list[list[Frame]]], list[list[Frame]]]


@dataclass(frozen=True)
class Outcome:
    """Of a run: steps, frames to and from the firmware, and the answers that are missing or differ
    in a bit from the library's on the host."""

    steps: int
    sent: int
    received: int
    lost: int
    different: int

    @property
    def ok(self) -> bool:
        return self.steps > 0 and self.lost == 0 and self.different == 0


def check(design: Design, method: str, out: Path, driver: Driver | None = None) -> Outcome:
    """Send the measurements of out/log.csv to the firmware, compare its answers with
    out/<method>.csv, both written by the simulator, and write out/pil.json.

    driver: sends and receives, if not this process.  Raises StepFailed.
    """
    program = firmware(design, method)
    wanted = _expected(out / f"{method}.csv", design.model.states)
    with _machine(program) as line:
        steps = _frames(out / "log.csv", design)
        heard = (driver or _drive_here)(line, steps)
    got = [_answer(frames, design.model.n) for frames in heard]
    outcome = Outcome(
        steps=len(steps), sent=sum(map(len, steps)), received=sum(map(len, heard)),
        lost=sum(answer is None for answer in got) + len(wanted) - len(got),
        different=sum(map(_differ, got, wanted)))
    write_files(out, {REPORT: json_text(asdict(outcome))})
    return outcome


def firmware(design: Design, method: str) -> Path:
    """Build the example node with the method's tables.  Raises StepFailed."""
    name = design.model.name
    folder = FOLDER / name
    lines = [f"blw_add_node({name} {one} {owner(design, one)} {folder} {DEADLINE_US})"
             for one in design.methods]
    write_changed(folder, {**files(design), "node.cmake": "\n".join(lines) + "\n"})
    program = f"node.{name}.{method}"
    build_programs(TARGET.name, [program])
    return BUILD / TARGET.name / "port" / "firmware" / program


@contextmanager
def _machine(program: Path) -> Iterator[Path]:
    """QEMU with the firmware; the path of its serial line, a socket."""
    with tempfile.TemporaryDirectory(prefix="bulwark.") as folder:
        line = Path(folder, "uart")
        machine = subprocess.Popen(
            [TARGET.qemu, "-machine", TARGET.machine, "-kernel", program, "-display", "none",
             "-monitor", "none", "-serial", f"unix:{line},server=on,wait=on"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        try:
            yield line
        except OSError as error:
            machine.terminate()
            raise StepFailed(f"{TARGET.qemu}: {error}: {machine.stderr.read().strip()}") from None
        finally:
            machine.terminate()
            machine.communicate()


def _drive_here(line: Path, steps: list[list[Frame]]) -> list[list[Frame]]:
    return list(pil_drive.drive(pil_drive.open_line(f"slcan:unix:{line}"), steps))


def _frames(log: Path, design: Design) -> list[list[Frame]]:
    """Per step of a log.csv: sync, the inputs that acted up to it, its measurements."""
    model = design.model
    identity = wire.model_id(model.sha256)
    with log.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    steps = []
    for last, row in zip(rows, rows[1:], strict=False):
        k = int(row["k"])
        values = [(wire.ID_INPUT, i, last[name]) for i, name in enumerate(model.inputs)]
        values += [(wire.ID_MEASUREMENT, i, row[name]) for i, name in enumerate(model.sensors)]
        steps.append([(wire.ID_SYNC, wire.put_sync(k, identity))] + [
            (base + i, wire.put_value(base, i, k, float(text) if text else None))
            for base, i, text in values])
    return steps


def _answer(frames: list[Frame], n: int) -> Answer | None:
    """The estimate [n] as bytes of float32 and the iterations; None if it is not complete."""
    by_id = dict(frames)
    status = by_id.get(wire.ID_STATUS)
    x_hat = b"".join(data for identifier, data in sorted(by_id.items())
                     if wire.ID_ESTIMATE <= identifier < wire.ID_STATUS)
    if status is None or len(x_hat) != 4 * n:
        return None
    _, _, _, _, iterations, check_sum, _ = struct.unpack("<HBBBBBB", status)
    values = list(struct.unpack(f"<{n}f", x_hat))
    return (x_hat, iterations) if check_sum == wire.crc_of_values(values) else None


def _differ(answer: Answer | None, wanted: Answer) -> bool:
    return answer is not None and answer != wanted


def _expected(path: Path, states: list[str]) -> list[Answer]:
    """The same of every step, from the file of a method that the simulator wrote."""
    with path.open(encoding="utf-8", newline="") as stream:
        return [(struct.pack(f"<{len(states)}f", *(float(row[state]) for state in states)),
                 min(int(row["iterations"]), MAX_ITERATIONS)) for row in csv.DictReader(stream)]
