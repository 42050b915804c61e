# SPDX-License-Identifier: MIT
"""Runs of plant, nodes and attackers on one bus; what they report, as JSON on standard output.

Run inside the kernel or the network that has the bus (in_uml.sh, in_netns.sh), so everything is
told by file names: cases.py BLW_BUS DESIGN OTHER_DESIGN SCENARIO_FOLDER OUT TRANSPORT FRAMES
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

LINKS = {"can": ("can:vcan0", "can:vcan1"), "canfd": ("canfd:vcan0", "canfd:vcan1"),
         "lcm": ("lcm:udpm://239.255.76.67:7667?ttl=0", "lcm:udpm://239.255.76.67:7668?ttl=0")}
FAULTS = ("babble", "crc", "stale", "early", "duplicate", "sync", "garbage")
FRAMES_PER_STEP = {"can": 6, "canfd": 3, "lcm": 3}  # sync, 1 input, 4 measurements
TIMEOUT_S = 120
#: A deadline that no busy machine misses; the next sync ends a step that lacks a frame anyway.
PATIENT_US = 20_000_000


class Bus:
    """Starts processes on one transport; every one is waited for or stopped."""

    def __init__(self, program: str, design: str, scenarios: Path, out: Path, transport: str):
        self.program, self.design, self.scenarios, self.out = program, design, scenarios, out
        self.link, self.sensor_link = LINKS[transport]
        self.transport = transport

    def start(self, part: str, *arguments: object, link: str = "") -> subprocess.Popen:
        """A process that is on the bus when this returns."""
        command = [self.program, part, *arguments, "--link", link or self.link]
        if "--design" not in arguments:
            command += ["--design", self.design]
        process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True)
        process.said = process.stdout.readline()
        return process

    def node(self, name: str, *arguments: object, methods: str = "kalman,guard",
             speaker: str = "guard", idle_s: int = 20,
             deadline_us: int = PATIENT_US) -> subprocess.Popen:
        """A node that writes to the folder of that name."""
        return self.start("node", "--out", self.out / name, "--method", methods, "--speaker",
                          speaker, "--idle-s", idle_s, "--deadline-us", deadline_us, *arguments)

    def plant(self, name: str, scenario: str, *arguments: object,
              **options: str) -> subprocess.Popen:
        """A plant that writes to the folder of that name."""
        return self.start("plant", self.scenarios / scenario, "--out", self.out / f"{name}.plant",
                          *arguments, **options)

    def results(self, name: str, *processes: subprocess.Popen) -> dict:
        """Wait for the processes; statuses, and the reports of node and plant."""
        try:
            said = [process.communicate(timeout=TIMEOUT_S)[0] for process in processes]
        finally:
            for process in processes:
                process.kill()
        return {"status": [process.returncode for process in processes], "said": said,
                "node": self.report(f"{name}/node.json"),
                "plant": self.report(f"{name}.plant/plant.json")}

    def report(self, name: str) -> dict | None:
        """A report that a process wrote, if it did."""
        path = self.out / name
        return json.loads(path.read_text()) if path.is_file() else None


def lockstep(bus: Bus, _: int) -> dict:
    """Nobody attacks, and the plant waits for each answer."""
    node = bus.node("lockstep")
    return bus.results("lockstep", node, bus.plant("lockstep", "benign.toml"))


def paced(bus: Bus, frames: int) -> dict:
    """So many frames at 2000 a second; nobody waits for anybody."""
    steps = -(-frames // FRAMES_PER_STEP[bus.transport])
    scenario = bus.out / "paced.toml"
    text = (bus.scenarios / "benign.toml").read_text()
    scenario.write_text(text.replace("steps = 400", f"steps = {steps}"))
    node = bus.node("paced", methods="kalman", speaker="kalman")
    pace = 500 * FRAMES_PER_STEP[bus.transport]
    plant = bus.start("plant", scenario, "--out", bus.out / "paced.plant", "--pace-us", pace)
    return bus.results("paced", node, plant) | {"steps": steps}


def restart(bus: Bus, _: int) -> dict:
    """A node is killed in the middle and starts again; another one listens all the time."""
    witness = bus.node("witness", "--mute")
    first = bus.node("killed")
    plant = bus.plant("restart", "benign.toml", "--pace-us", 10_000)
    time.sleep(1.5)
    first.kill()
    first.wait()
    first.stdout.close()
    second = bus.node("restart")
    return bus.results("restart", second, plant, witness)


def fault(name: str) -> Callable[[Bus, int], dict]:
    """A broken neighbour: one of FAULTS."""

    def case(bus: Bus, _: int) -> dict:
        node = bus.node(name)
        neighbour = bus.start("attack", bus.scenarios / "benign.toml", "--fault", name)
        plant = bus.plant(name, "benign.toml", "--pace-us", 5000)
        return bus.results(name, node, plant, neighbour)

    return case


def intruder(bus: Bus, _: int) -> dict:
    """Forged frames beside the true ones."""
    node = bus.node("intruder", "--quarantine", 3)
    attacker = bus.start("attack", bus.scenarios / "bias.toml")
    plant = bus.plant("intruder", "bias.toml", "--pace-us", 20_000)
    return bus.results("intruder", node, plant, attacker)


def split(method: str) -> Callable[[Bus, int], dict]:
    """Five processes: a node at each of the four sensors, and the fusion node; the sensors are
    attacked, and a central node listens."""

    def case(bus: Bus, _: int) -> dict:
        name = f"split_{method}"
        common = ("--method", method, "--deadline-us", PATIENT_US)
        fusion = bus.start("node", "--out", bus.out / name, "--fusion", *common)
        nodes = [bus.start("node", "--out", bus.out / name, "--sensor", sensor, *common)
                 for sensor in ("cart1", "cart2", "cart3", "angle")]
        central = bus.node(f"{name}.central", "--mute", methods=method, speaker=method)
        attacker = bus.start("attack", bus.scenarios / "bias.toml", "--sensor-link",
                             bus.sensor_link)
        plant = bus.plant(name, "bias.toml", link=bus.sensor_link)
        return bus.results(name, fusion, plant, central, attacker, *nodes)

    return case


def gateway(bus: Bus, _: int) -> dict:
    """The sensor's frames are changed on their way."""
    node = bus.node("gateway")
    attacker = bus.start("attack", bus.scenarios / "bias.toml", "--sensor-link", bus.sensor_link)
    plant = bus.plant("gateway", "bias.toml", link=bus.sensor_link)
    return bus.results("gateway", node, plant, attacker)


def suppressed(bus: Bus, _: int) -> dict:
    """The sensor's frames are withheld on their way."""
    node = bus.node("suppressed", deadline_us=100_000)
    attacker = bus.start("attack", bus.scenarios / "drop.toml", "--sensor-link", bus.sensor_link)
    plant = bus.plant("suppressed", "drop.toml", link=bus.sensor_link)
    return bus.results("suppressed", node, plant, attacker)


def other_model(bus: Bus, _: int, other: str) -> dict:
    """A node of another model hears the plant and refuses."""
    stranger = bus.node("stranger", "--design", other, methods="kalman", speaker="kalman",
                        idle_s=2)
    node = bus.node("other_model")
    plant = bus.plant("other_model", "benign.toml")
    return bus.results("other_model", node, plant, stranger)


def link_lost(bus: Bus, _: int) -> dict:
    """The interface goes down for a second in the middle of a run."""
    interface = "lo" if bus.transport == "lcm" else "vcan0"
    node = bus.node("link_lost", "--period-us", 50_000, deadline_us=25_000)
    plant = bus.plant("link_lost", "short.toml", "--pace-us", 50_000)
    time.sleep(1.5)
    for state, pause in (("down", 1.0), ("up", 0.0)):
        subprocess.run(["ip", "link", "set", interface, state], check=True)
        time.sleep(pause)
    if bus.transport == "lcm":
        subprocess.run(["ip", "route", "add", "224.0.0.0/4", "dev", "lo"], check=True)
    return bus.results("link_lost", node, plant)


def main(arguments: Sequence[str]) -> None:
    """Every case in turn."""
    program, design, other, scenarios, out, transport, frames = arguments
    bus = Bus(program, design, Path(scenarios), Path(out), transport)
    cases = {"lockstep": lockstep, "paced": paced}
    cases |= {f"split_{method}": split(method) for method in ("lasso", "canonical")}
    if transport != "canfd":  # the same code but for the frames
        cases |= {"restart": restart, "gateway": gateway, "intruder": intruder,
                  "suppressed": suppressed, "link_lost": link_lost,
                  "other_model": lambda bus, n: other_model(bus, n, other)}
        cases |= {name: fault(name) for name in FAULTS}
    print(json.dumps({name: case(bus, int(frames)) for name, case in cases.items()}))


if __name__ == "__main__":
    main(sys.argv[1:])
