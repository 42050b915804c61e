# SPDX-License-Identifier: MIT
"""Plant, nodes and attackers on LCM, CAN, CAN FD and SLCAN: counts and bits, never times.

BULWARK_FRAMES is the length of the paced run, 10000 if it is not set.
"""

import csv
import json
from pathlib import Path

import pytest
from conftest import Prepared, Recorded, on

#: Fault -> counter of the node that has to tell it.
COUNTERS = {"babble": "babbling", "crc": "bad_crc", "stale": "stale", "early": "out_of_order",
            "duplicate": "duplicate", "sync": "bad_sync", "garbage": "bad_layout"}
#: LCM has no frame with a wrong checksum or length to send.
FAULTS = [pytest.param(transport, fault, marks=pytest.mark.xdist_group(transport))
          for transport in ("lcm", "can") for fault in COUNTERS
          if transport == "can" or fault not in ("crc", "garbage")]
SENSORS = 4
INPUTS = 1
FAR = 0.3


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def clean(node: dict) -> bool:
    """Nothing went wrong that a node counts."""
    harmless = ("steps", "taken", "restarts", "link")
    return all(count == 0 for name, count in node.items() if name not in harmless)


def told(said: str) -> list[str]:
    """What a process tells of its link; LCM itself adds lines of its own."""
    return [line.rpartition(": ")[2] for line in said.splitlines() if line.startswith("blw_bus: ")]


@on("lcm", "can", "canfd", "slcan")
@pytest.mark.parametrize("method", ["kalman", "guard"])
def test_node_on_a_bus_given_no_fault_yields_the_bits_of_one_process(
        recorded: Recorded, prepared: Prepared, method: str) -> None:
    written = (recorded.out / "lockstep" / f"{method}.csv").read_bytes()
    assert written == (prepared.inproc / "benign" / f"{method}.csv").read_bytes()


@on("lcm", "can", "canfd", "slcan")
def test_paced_run_loses_and_reorders_nothing(recorded: Recorded) -> None:
    paced = recorded.case("paced")
    node = paced["node"]["kalman"]
    assert paced["status"] == [0, 0]
    assert node["steps"] == paced["steps"] == paced["plant"]["steps"]
    assert node["taken"] == paced["steps"] * (SENSORS + INPUTS)
    assert clean(node)
    assert paced["plant"]["unsent"] == 0


@on("lcm", "can", "slcan")
def test_restarted_node_catches_up(recorded: Recorded) -> None:
    again = recorded.case("restart")
    assert again["status"] == [0, 0, 0]
    whole = rows(recorded.out / "witness" / "guard.csv")
    late = rows(recorded.out / "restart" / "guard.csv")
    assert len(whole) == 400
    assert 50 < len(late) < 400
    assert late[-1]["k"] == whole[-1]["k"] == "400"
    for state in ("cart_m", "angle_rad"):
        assert float(late[-1][state]) == pytest.approx(float(whole[-1][state]), abs=1e-4)


@pytest.mark.parametrize(("transport", "fault"), FAULTS)
def test_faulty_neighbour_changes_no_estimate_and_is_told(recorded: Recorded, prepared: Prepared,
                                                          fault: str) -> None:
    node = recorded.case(fault)["node"]["guard"]
    counter = COUNTERS[fault]
    assert node[counter] >= 50, node
    assert node["conflict"] == 0
    written = (recorded.out / fault / "guard.csv").read_bytes()
    assert written == (prepared.inproc / "benign" / "guard.csv").read_bytes()


@on("lcm", "can")
def test_intruder_silences_his_victim_but_does_not_speak_for_it(recorded: Recorded) -> None:
    node = recorded.case("intruder")["node"]["guard"]
    assert node["conflict"] >= 50
    estimates = rows(recorded.out / "intruder" / "guard.csv")
    truth = rows(recorded.out / "intruder.plant" / "log.csv")[1:]
    silenced = [row for row in estimates[100:200] if "missing" in row["status"]]
    assert len(silenced) >= 80
    for row, true in zip(estimates, truth, strict=True):
        assert abs(float(row["cart_m"]) - float(true["x:cart_m"])) < FAR


@on("lcm", "can", "canfd", "slcan")
@pytest.mark.parametrize("method", ["lasso", "canonical"])
def test_split_deployment_yields_the_bits_of_the_central_node(recorded: Recorded,
                                                              method: str) -> None:
    done = recorded.case(f"split_{method}")
    assert done["status"] == [0] * 8
    written = (recorded.out / f"split_{method}" / f"{method}.csv").read_bytes()
    assert written == (recorded.out / f"split_{method}.central" / f"{method}.csv").read_bytes()
    assert done["node"][method]["taken"] == 400 * (SENSORS * SENSORS + INPUTS)  # r = n = 4
    assert clean(done["node"][method])


def assert_attacked_as_in_one_process(recorded: Recorded, prepared: Prepared, kind: str) -> None:
    """The same exclusions, and estimates but for the rounding of y before the attacker sees it."""
    there = rows(recorded.out / f"gateway_{kind}" / "guard.csv")
    here = rows(prepared.inproc / kind / "guard.csv")
    assert [row["excluded"] for row in there] == [row["excluded"] for row in here]
    for one, other in zip(there, here, strict=True):
        assert float(one["cart_m"]) == pytest.approx(float(other["cart_m"]), abs=1e-5)
    log = rows(prepared.inproc / kind / "log.csv")
    attacked = [row for row in log if float(row["a:cart2"] or 0.0)]
    said = json.loads(recorded.case(f"gateway_{kind}")["said"][2])
    assert said["forged"] == len(attacked) >= 98  # what is repeated may be the same by chance
    assert said["withheld"] == 0


@on("lcm", "can", "slcan")
def test_gateway_that_adds_a_bias_attacks_as_in_one_process(recorded: Recorded,
                                                            prepared: Prepared) -> None:
    assert_attacked_as_in_one_process(recorded, prepared, "bias")
    assert any(row["excluded"] == "cart2"
               for row in rows(recorded.out / "gateway_bias" / "guard.csv")[100:200])


@on("lcm", "can")
@pytest.mark.parametrize("kind", ["replay", "delay"])
def test_gateway_that_repeats_the_past_attacks_as_in_one_process(
        recorded: Recorded, prepared: Prepared, kind: str) -> None:
    assert_attacked_as_in_one_process(recorded, prepared, kind)


@on("lcm", "can")
def test_suppressed_sensor_is_missing_as_in_one_process(recorded: Recorded,
                                                       prepared: Prepared) -> None:
    node = recorded.case("gateway_drop")["node"]["guard"]
    there = rows(recorded.out / "gateway_drop" / "guard.csv")
    here = rows(prepared.inproc / "drop" / "guard.csv")
    assert [row["status"] for row in there] == [row["status"] for row in here]
    assert sum("missing" in row["status"] for row in there) == 100
    assert node["lost"] == (100 if recorded.transport == "can" else 0)  # LCM says "no sample"


@on("lcm", "can")
def test_node_of_another_model_refuses(recorded: Recorded) -> None:
    done = recorded.case("other_model")
    assert done["status"] == [0, 0, 1]
    assert "no plant of model pendulum was heard" in done["said"][2]
    assert clean(done["node"]["guard"])


@on("slcan")
@pytest.mark.parametrize("method", ["kalman", "guard"])
def test_node_on_a_serial_line_yields_the_bits_of_one_process(
        recorded: Recorded, prepared: Prepared, method: str) -> None:
    done = recorded.case("terminal")
    assert done["status"] == [0, 0]
    assert clean(done["node"][method])
    assert done["node"][method]["link"]["malformed"] == 0
    written = (recorded.out / "terminal" / f"{method}.csv").read_bytes()
    assert written == (prepared.inproc / "benign" / f"{method}.csv").read_bytes()


@on("lcm", "can", "slcan")
def test_lost_link_is_reported_and_recovered(recorded: Recorded) -> None:
    done = recorded.case("link_lost")
    node = done["node"]["guard"]
    assert done["status"][0] == 0
    assert node["blind"] >= 5
    assert node["no_sync"] >= 5
    assert done["plant"]["link"]["lost"] >= 1
    assert node["steps"] - node["blind"] >= 60
    assert "blind" not in rows(recorded.out / "link_lost" / "guard.csv")[-1]["status"]
    for said in done["said"]:
        assert told(said) == ["link lost", "back"]


@on("can")
def test_bus_off_is_reported_and_recovered(recorded: Recorded, prepared: Prepared) -> None:
    done = recorded.case("bus_off")
    assert done["status"] == [0, 0]
    for link in (done["node"]["guard"]["link"], done["plant"]["link"]):
        assert link["bus_off"] == 1
        assert link["lost"] == link["errors"] == 0
    for said in done["said"]:
        assert told(said) == ["bus off", "back"]
    assert clean(done["node"]["guard"])
    written = (recorded.out / "bus_off" / "guard.csv").read_bytes()
    assert written == (prepared.inproc / "benign" / "guard.csv").read_bytes()
