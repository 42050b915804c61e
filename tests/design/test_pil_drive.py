# SPDX-License-Identifier: MIT
"""When the frames of the steps are sent."""

from blw import pil_drive, wire

SENSORS = 3


def step(k, *missing):
    """Sync and measurements of step k."""
    return [(wire.ID_SYNC, wire.put_sync(k, 0xABC))] + [
        (wire.ID_MEASUREMENT + i, wire.put_value(wire.ID_MEASUREMENT, i, k,
                                                 None if i in missing else 1.5))
        for i in range(SENSORS)]


class Node:
    """Answers a step that is whole, or that the next sync has ended; has no deadline."""

    def __init__(self):
        self.heard = []

    def send(self, frames):
        self.heard += frames

    def receive(self):
        whole = sum(data[pil_drive.FLAGS_BYTE] for identifier, data in self.heard
                    if identifier != wire.ID_SYNC) == SENSORS
        ended = sum(identifier == wire.ID_SYNC for identifier, _ in self.heard) == 2
        if not whole and not ended:
            return []
        self.heard = self.heard[-1:] if ended else []
        return [(wire.ID_STATUS, bytes(8)), (wire.ID_SENSORS, bytes(8))]


def test_drive_given_missing_samples_gets_every_answer_without_a_deadline():
    steps = [step(1), step(2, 1), step(3, 0, 2), step(4), step(5)]
    assert [len(found) for found in pil_drive.drive(Node(), steps)] == [2] * 5


def test_drive_given_missing_samples_sends_every_frame_once_and_in_order():
    node, all_heard = Node(), []
    node.send = lambda frames: (all_heard.extend(frames), Node.send(node, frames))
    steps = [step(1, 0), step(2, 1), step(3)]
    assert len(list(pil_drive.drive(node, steps))) == 3
    assert all_heard == [frame for frames in steps for frame in frames]


def test_drive_given_no_sample_in_the_last_step_leaves_it_to_the_deadline():
    assert [len(found) for found in pil_drive.drive(Node(), [step(1), step(2, 1)])] == [2, 0]
