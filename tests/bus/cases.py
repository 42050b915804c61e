# SPDX-License-Identifier: MIT
"""Runs of plant, nodes and attackers on one bus; what they report, as JSON on standard output.

Run inside the kernel or the network that has the bus (in_uml.sh, in_netns.sh), so everything is
told by file names: cases.py BLW_BUS DESIGN OTHER_DESIGN SCENARIO_FOLDER OUT TRANSPORT FRAMES
"""

import json
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from hub import Hub

LINKS = {"can": ("can:vcan0", "can:vcan1"), "canfd": ("canfd:vcan0", "canfd:vcan1"),
         "lcm": ("lcm:udpm://239.255.76.67:7667?ttl=0", "lcm:udpm://239.255.76.67:7668?ttl=0")}
FAULTS = ("babble", "crc", "stale", "early", "duplicate", "sync", "garbage")
FRAMES_PER_STEP = {"can": 6, "canfd": 3, "lcm": 3, "slcan": 6}  # sync, 1 input, 4 measurements
PACE_US = 3000
STANDSTILL_S = 1.5                      # 500 steps of paced
OUTAGE_S = 1.5                          # 15 steps of link_lost
TIMEOUT_S = 400
#: A deadline that no busy machine misses; the next sync ends a step that lacks a frame anyway.
PATIENT_US = 20_000_000
CAN_FRAME = struct.Struct("=IB3x8s")  # struct can_frame: identifier, length, data
ANSWERED = 0x281                      # identifier of the last frame of an answer of four sensors
ERROR, BUS_OFF, RESTARTED = 0x2000_0000, 0x40, 0x100  # CAN_ERR_... of linux/can/error.h


class Bus:
    """Starts processes on one transport; every one is waited for or stopped."""

    def __init__(self, program: str, design: str, scenarios: Path, out: Path, transport: str):
        self.program, self.design, self.scenarios, self.out = program, design, scenarios, out
        self.transport = transport
        if transport == "slcan":
            folder = Path(tempfile.mkdtemp(prefix="blw."))  # the name of a socket has to be short
            self.hubs = [Hub(folder / side) for side in ("node", "sensor")]
            self.link, self.sensor_link = (f"slcan:unix:{hub.path}" for hub in self.hubs)
        else:
            self.link, self.sensor_link = LINKS[transport]

    def start(self, part: str, *arguments: object, link: str = "") -> subprocess.Popen:
        """A process that is on the bus when this returns."""
        command = [self.program, part, *arguments, "--link", link or self.link]
        if "--design" not in arguments:
            command += ["--design", self.design]
        process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True)
        said = process.stdout.readline()
        if said.startswith("blw_bus: "):
            raise SystemExit(said)
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
                          "--patience-ms", PATIENT_US // 1000, *arguments, **options)

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
    """So many frames, a step every PACE_US; nobody waits for anybody.  The plant stands still for a
    while, and may not make up for it: the bus does not hold what that would be at once."""
    steps = -(-frames // FRAMES_PER_STEP[bus.transport])
    scenario = bus.out / "paced.toml"
    text = (bus.scenarios / "benign.toml").read_text()
    scenario.write_text(text.replace("steps = 400", f"steps = {steps}"))
    node = bus.node("paced", methods="kalman", speaker="kalman")
    plant = bus.start("plant", scenario, "--out", bus.out / "paced.plant", "--pace-us", PACE_US)
    for what in (signal.SIGSTOP, signal.SIGCONT):
        time.sleep(STANDSTILL_S)
        plant.send_signal(what)
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


def gateway(kind: str) -> Callable[[Bus, int], dict]:
    """The sensor's frames are changed, replayed, delayed or withheld on their way.

    No clock decides what a node misses: the plant waits for each answer, or, where frames are
    withheld, the next sync ends the step.
    """

    def case(bus: Bus, _: int) -> dict:
        name, scenario = f"gateway_{kind}", f"{kind}.toml"
        node = bus.node(name)
        attacker = bus.start("attack", bus.scenarios / scenario, "--sensor-link", bus.sensor_link)
        pace = ("--pace-us", 10_000) if kind == "drop" else ()
        plant = bus.plant(name, scenario, *pace, link=bus.sensor_link)
        return bus.results(name, node, plant, attacker)

    return case


#: Transport -> recorder and player of its own, without the file.
RECORDERS = {"can": ["candump", "-L", "-r", "8388608", "vcan0"],
             "lcm": ["/usr/bin/lcm-logger", "--quiet", "--force", "--lcm-url=URL"]}
#: Where the kernel lists who listens, and the entry of one: all frames of vcan0, port 7667.
LISTENERS = {"can": ("/proc/net/can/rcvlist_all", "vcan0 "), "lcm": ("/proc/net/udp", ":1DF3 ")}
PLAYERS = {"can": ["canplayer", "vcan0=vcan0", "vcan0=can0", "-t", "-g", "1", "-I"],
           "lcm": ["lcm-logplayer", "--speed=20", "--lcm-url=URL"]}


def listens(transport: str) -> bool:
    """Whether a recorder, which does not say so itself, is on the bus."""
    table, entry = LISTENERS[transport]
    return entry in Path(table).read_text()


def stock(bus: Bus, _: int) -> dict:
    """The transport's own recorder listens to a run; its own player plays that and our export."""
    url = bus.link.partition(":")[2]
    recorder, player = ([word.replace("URL", url) for word in command[bus.transport]]
                        for command in (RECORDERS, PLAYERS))
    files = {"recorded": bus.out / f"recorded.{bus.transport}",
             "exported": bus.scenarios / f"exported.{bus.transport}"}
    log = files["recorded"]
    with log.open("wb") as file:
        heard = subprocess.Popen([*recorder, *([log] if bus.transport == "lcm" else [])],
                                 stdout=file)
        while not listens(bus.transport):
            time.sleep(0.01)
        node = bus.node("stock")
        plant = bus.plant("stock", "brief.toml")
        reports = {"stock": bus.results("stock", node, plant)}
        time.sleep(1.0)  # it does not say what it has written
        heard.terminate()
        heard.wait()
    for name, file in files.items():
        node = bus.node(name, idle_s=3)
        subprocess.run([*player, file], check=True, stdout=subprocess.DEVNULL)
        reports[name] = bus.results(name, node)
    return reports


def other_model(bus: Bus, _: int, other: str) -> dict:
    """A node of another model hears the plant and refuses."""
    stranger = bus.node("stranger", "--design", other, methods="kalman", speaker="kalman",
                        idle_s=2)
    node = bus.node("other_model")
    plant = bus.plant("other_model", "benign.toml")
    return bus.results("other_model", node, plant, stranger)


def link_lost(bus: Bus, _: int) -> dict:
    """The interface goes down, or the line is hung up, for a while in the middle of a run.

    A machine that stands still makes it longer: the run takes several times as long.
    """
    node = bus.node("link_lost", "--period-us", 100_000, deadline_us=300_000)
    plant = bus.plant("link_lost", "short.toml", "--pace-us", 100_000)
    time.sleep(1.5)
    if bus.transport == "slcan":
        bus.hubs[0].close()
        time.sleep(OUTAGE_S)
        bus.hubs[0].open()
    else:
        interface_down("lo" if bus.transport == "lcm" else "vcan0")
    return bus.results("link_lost", node, plant)


def interface_down(interface: str) -> None:
    """For a while."""
    for state, pause in (("down", OUTAGE_S), ("up", 0.0)):
        subprocess.run(["ip", "link", "set", interface, state], check=True)
        time.sleep(pause)
    if interface == "lo":
        subprocess.run(["ip", "route", "add", "224.0.0.0/4", "dev", "lo"], check=True)


def bus_off(bus: Bus, _: int) -> dict:
    """The controller says that it is off the bus, and that it has been restarted.

    vcan has no controller, but passes on the error frames that somebody else sends.
    """
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as controller:
        controller.bind((bus.link.partition(":")[2],))
        node = bus.node("bus_off")
        plant = bus.plant("bus_off", "benign.toml", "--pace-us", 10_000)
        while CAN_FRAME.unpack(controller.recv(CAN_FRAME.size))[0] != ANSWERED:
            pass  # then nobody sends until it is time for the next step
        for what in (BUS_OFF, RESTARTED):
            controller.send(CAN_FRAME.pack(ERROR | what, 8, bytes(8)))
            time.sleep(0.003)
    return bus.results("bus_off", node, plant)


def terminal(bus: Bus, _: int) -> dict:
    """Node and plant on pseudo-terminals, as on serial lines."""
    node_line, plant_line = (f"slcan:{bus.hubs[0].pty()}" for _ in range(2))
    node = bus.start("node", "--out", bus.out / "terminal", "--method", "kalman,guard",
                     "--speaker", "guard", "--deadline-us", PATIENT_US, link=node_line)
    return bus.results("terminal", node, bus.plant("terminal", "benign.toml", link=plant_line))


def main(arguments: Sequence[str]) -> None:
    """Every case in turn."""
    program, design, other, scenarios, out, transport, frames = arguments
    bus = Bus(program, design, Path(scenarios), Path(out), transport)
    cases = {"lockstep": lockstep, "paced": paced}
    cases |= {f"split_{method}": split(method) for method in ("lasso", "canonical")}
    if transport != "canfd":  # the same code but for the frames
        cases |= {"restart": restart, "gateway_bias": gateway("bias"), "link_lost": link_lost}
    if transport in ("can", "lcm"):  # slcan: the same frames as can
        cases |= {f"gateway_{kind}": gateway(kind) for kind in ("replay", "delay", "drop")}
        cases |= {"intruder": intruder, "stock": stock,
                  "other_model": lambda bus, n: other_model(bus, n, other)}
        cases |= {name: fault(name) for name in FAULTS}
    if transport == "can":
        cases |= {"bus_off": bus_off}
    if transport == "slcan":
        cases |= {"terminal": terminal}
    print(json.dumps({name: case(bus, int(frames)) for name, case in cases.items()}))


if __name__ == "__main__":
    main(sys.argv[1:])
