# SPDX-License-Identifier: MIT
"""`bulwark replay --format` and `bulwark export`: logs that leave and come back."""

import json
import shutil

import can
import lcm
import numpy as np
import pytest
from mcap.reader import make_reader
from sim_case import columns, numbers, write_scenario

from blw.logs import lcm_types

SCENARIO = """
steps = 60
seed = 3
[controller]
kind = "feedback"
method = "truth"
gain = [[1.0, 1.5]]
[[attack]]
sensor = "a"
kind = "drop"
from = 20
to = 30
[[attack]]
sensor = "a"
kind = "bias"
value = 30.0
from = 40
to = 50
"""


@pytest.fixture(scope="module")
def run(bulwark, tmp_path_factory):
    """A run of `cart` with its design."""
    folder = tmp_path_factory.mktemp("run")
    from sim_case import CART
    (folder / "cart.toml").write_text(CART)
    scenario = write_scenario(folder, SCENARIO)
    done = bulwark("run", scenario, "--out", folder, "--method", "guard")
    assert done.returncode == 0, done.stderr
    return folder


def exported(bulwark, run, log_format, *arguments):
    done = bulwark("export", run, "--format", log_format, *arguments)
    assert done.returncode == 0, done.stderr
    return run / f"run.{'log' if log_format == 'candump' else log_format}"


@pytest.mark.parametrize("log_format", ["candump", "lcm"])
def test_export_replayed_gives_the_same_bits(bulwark, run, tmp_path, log_format):
    if log_format == "lcm" and shutil.which("lcm-gen") is None:
        pytest.skip("lcm-gen (liblcm-bin) is not installed")
    log = exported(bulwark, run, log_format)
    done = bulwark("replay", log, "--format", log_format, "--design", run / "design" / "cart.json",
                   "--out", tmp_path / "again", "--method", "guard")
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    for method in ("kalman", "guard"):
        assert (run / f"{method}.csv").read_bytes() \
            == (tmp_path / "again" / f"{method}.csv").read_bytes()


def test_export_to_candump_tells_what_the_node_sent(bulwark, run, tmp_path):
    log = exported(bulwark, run, "candump", "--method", "guard")
    frames = list(can.CanutilsLogReader(log))
    counts = {identifier: sum(frame.arbitration_id == identifier for frame in frames)
              for identifier in (0x080, 0x100, 0x180, 0x200, 0x280, 0x281)}
    missing = columns(run / "log.csv")["a"].count("")
    assert counts == {0x080: 61, 0x100: 61 - missing, 0x180: 60, 0x200: 60, 0x280: 60, 0x281: 60}
    times = [frame.timestamp for frame in frames]
    assert times == sorted(times)
    states = np.array([np.frombuffer(frame.data, "<f4") for frame in frames
                       if frame.arbitration_id == 0x200])
    np.testing.assert_array_equal(states, numbers(
        run / "guard.csv", ["pos_m", "vel_m_s"]).astype(np.float32))


def test_export_to_lcm_raises_alarms(bulwark, run):
    if shutil.which("lcm-gen") is None:
        pytest.skip("lcm-gen (liblcm-bin) is not installed")
    events = list(lcm.EventLog(str(exported(bulwark, run, "lcm")), "r"))
    alarms = [lcm_types.types().alarm_t.decode(event.data) for event in events
              if event.channel == "BLW_ALARM"]
    excluded = {alarm.seq: list(alarm.excluded) for alarm in alarms}
    first = min(seq for seq, sensors in excluded.items() if any(sensors))
    assert 40 <= first < 45 and excluded[first] == [True, False, False]
    assert {alarm.method for alarm in alarms} == {"guard"}


def test_export_to_mcap_reads_back_with_its_schemas(bulwark, run):
    path = exported(bulwark, run, "mcap")
    log, track = columns(run / "log.csv"), columns(run / "guard.csv")
    with path.open("rb") as file:
        messages = [(schema, channel, message.log_time, json.loads(message.data))
                    for schema, channel, message in make_reader(file).iter_messages()]
    found = {}
    for schema, channel, time_ns, said in messages:
        assert schema.encoding == "jsonschema" and channel.message_encoding == "json"
        properties = json.loads(schema.data)["properties"]
        assert set(said) <= set(properties)
        assert time_ns == round(1e9 * said["t_s"])
        found.setdefault(channel.topic, []).append(said)
    assert [said.get("a") for said in found["/measurement"]] == [
        float(cell) if cell else None for cell in log["a"]][1:]
    assert [said["pos_m"] for said in found["/guard/estimate"]] == [
        float(cell) for cell in track["pos_m"]]
    assert [";".join(said["excluded"]) for said in found["/guard/decision"]] == track["excluded"]
    assert len(found["/truth"]) == 61 and len(found["/oracle/estimate"]) == 60


@pytest.mark.parametrize("arguments, message", [
    (["--format", "lcm", "--dbc", "LOG"], "--dbc does not go with --format lcm"),
    (["--format", "csv", "--dbc", "LOG"], "--dbc does not go with --format csv"),
    (["--format", "lcm", "--map", "LOG"], "--map does not go with --format lcm"),
    (["--format", "candump", "--dbc", "LOG"], "--dbc does not go with --format candump without"),
    (["--format", "candump"], "run.csv:1: not a line of candump -L"),
    (["--format", "lcm"], "not an LCM event log"),
])
def test_replay_given_a_wrong_format_refuses(bulwark, refused, run, tmp_path, arguments, message):
    log = tmp_path / "run.csv"
    log.write_bytes((run / "log.csv").read_bytes())
    words = [log if word == "LOG" else word for word in arguments]
    done = bulwark("replay", log, "--design", run / "design" / "cart.json", "--out",
                   tmp_path / "out", *words)
    assert message in refused(done)
    assert not (tmp_path / "out").exists()


def test_export_given_an_unknown_method_refuses(bulwark, refused, run):
    assert "has no method 'bank'; there are: oracle, kalman, guard" in refused(
        bulwark("export", run, "--format", "mcap", "--method", "bank"))
