# SPDX-License-Identifier: MIT
"""The logs of candump and lcm-logger, played by canplayer and lcm-logplayer, read by Python."""

import re
import subprocess
import sys
from pathlib import Path

import lcm
import pytest
from conftest import BRIEF, Prepared, Recorded, call, on

from blw.build import bus
from blw.logs import lcm_types

SENSORS = 4


def assert_brief_bits(written: Path, prepared: Prepared) -> None:
    assert written.read_bytes() == (prepared.inproc / "brief" / "guard.csv").read_bytes()


@on("lcm", "can")
@pytest.mark.parametrize("log", ["recorded", "exported"])
def test_node_that_hears_the_stock_player_yields_the_bits_of_the_run(
        recorded: Recorded, prepared: Prepared, log: str) -> None:
    told = recorded.case("stock")
    assert told["stock"]["status"] == [0, 0]
    assert told[log]["status"] == [0]
    assert_brief_bits(recorded.out / log / "guard.csv", prepared)


@on("lcm", "can")
def test_replay_of_the_stock_recorder_s_log_yields_the_bits_of_the_run(
        recorded: Recorded, prepared: Prepared, tmp_path: Path) -> None:
    log = recorded.out / f"recorded.{recorded.transport}"
    done = call([sys.executable, "-m", "blw", "replay", log, "--format",
                 "lcm" if recorded.transport == "lcm" else "candump", "--design", prepared.design,
                 "--method", "guard", "--out", tmp_path])
    assert done.returncode == 0, done.stderr
    assert_brief_bits(tmp_path / "guard.csv", prepared)


@on("can")
def test_node_on_the_replay_link_given_candump_s_log_yields_the_bits_of_the_run(
        recorded: Recorded, prepared: Prepared, tmp_path: Path) -> None:
    done = call([bus("f32"), "node", "--design", prepared.design, "--method", "kalman,guard",
                 "--link", f"replay:{recorded.out / 'recorded.can'}", "--out", tmp_path])
    assert done.returncode == 0, done.stderr
    assert_brief_bits(tmp_path / "guard.csv", prepared)


@on("can")
def test_cantools_decodes_candump_s_log_by_the_generated_dbc(recorded: Recorded,
                                                             prepared: Prepared) -> None:
    dbc = prepared.design.with_suffix(".dbc")
    with (recorded.out / "recorded.can").open() as log:
        done = subprocess.run([sys.executable, "-m", "cantools", "decode", "--single-line", dbc],
                              stdin=log, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    counts = {name: len(re.findall(rf":: {name}\(", done.stdout))
              for name in ("sync", "y_cart1", "y_angle", "u_force_N", "x_0", "x_1", "status",
                           "sensors_0")}
    assert counts.pop("sync") == BRIEF + 3  # the end is said three times
    assert set(counts.values()) == {BRIEF}, counts
    assert "Unknown frame id" not in done.stdout


@on("lcm")
def test_python_lcm_reads_the_logger_s_log(recorded: Recorded) -> None:
    types = lcm_types.types()
    read = {"BLW_MEASUREMENT": types.measurement_t, "BLW_ESTIMATE": types.estimate_t,
            "BLW_INPUT": types.input_t}
    events = [(event.channel, read[event.channel].decode(event.data))
              for event in lcm.EventLog(str(recorded.out / "recorded.lcm"), "r")
              if event.channel in read]
    for channel in read:
        said = [message.seq for name, message in events if name == channel]
        first = 0 if channel == "BLW_INPUT" else 1  # an input counts from the step it acts in
        assert said == list(range(first, BRIEF + first)), channel
    assert all(message.m == SENSORS and all(message.valid) for name, message in events
               if name == "BLW_MEASUREMENT")
