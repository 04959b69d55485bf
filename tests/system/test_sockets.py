"""By default the nodes listen on this machine only: what docs/security.md says of sockets, read from /proc/net."""

import os
import re
import socket
import subprocess
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import pytest
from support import ROOT, Command, Graph, Observer

NODES = ["afm_sim_node", "afm_controller_node", "afm_recorder_node"]
LOOPBACK = "127.0.0.1"
LISTENING = "0A"


class Socket(NamedTuple):
    """A line of /proc/net."""

    address: str
    port: int
    waiting: int  # bytes that have arrived and nobody has read
    inode: str


def sockets(pid: int, kind: str) -> list[Socket]:
    """Sockets of a process that can receive: UDP all, TCP those that listen."""
    mine = set()
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(OSError):
            mine.update(re.findall(r"socket:\[(\d+)\]", os.readlink(entry)))
    found = []
    for line in Path(f"/proc/{pid}/net/{kind}").read_text().splitlines()[1:]:
        fields = line.split()
        if fields[9] in mine and (kind.startswith("udp") or fields[3] == LISTENING):
            address, port = fields[1].split(":")
            # Words of four bytes, as they stand in the memory of this machine.
            words = [bytes.fromhex(address[i : i + 8])[::-1] for i in range(0, len(address), 8)]
            family = socket.AF_INET if len(words) == 1 else socket.AF_INET6
            waiting = int(fields[4].split(":")[1], 16)
            found.append(Socket(socket.inet_ntop(family, b"".join(words)), int(port, 16), waiting, fields[9]))
    return found


def elsewhere(pid: int) -> dict[str, Socket]:
    """UDP sockets that are not on the loopback."""
    return {each.inode: each for each in sockets(pid, "udp") if each.address != LOOPBACK}


@pytest.mark.parametrize("name", NODES)
def test_node_in_the_environment_of_env_sh_listens_on_the_loopback_only(name: str, tmp_path: Path) -> None:
    node = f"{ROOT}/ros2_ws/install/{name}/lib/{name}/{name}"
    clean = "unset FASTRTPS_DEFAULT_PROFILES_FILE FASTDDS_DEFAULT_PROFILES_FILE ROS_AUTOMATIC_DISCOVERY_RANGE"
    arguments = f"--ros-args -p path:={tmp_path}/run.rrd" if name == "afm_recorder_node" else ""
    with (
        Graph() as graph,
        Command("bash", "-c", f"{clean}; . {ROOT}/env.sh && exec {node} {arguments}", folder=tmp_path) as process,
    ):
        observer = graph.add(Observer())
        full_name = (name, "/afm")
        process.wait_until(lambda: full_name in observer.get_node_names_and_namespaces(), graph)
        pid = process.process.pid
        for kind in ("tcp", "tcp6", "udp6"):
            assert sockets(pid, kind) == []
        here = [each for each in sockets(pid, "udp") if each.address == LOOPBACK]
        first = 7400 + 250 * int(os.environ["ROS_DOMAIN_ID"])
        assert len([each for each in here if first <= each.port < first + 250]) >= 2
        # Those elsewhere only send: nobody reads what comes, while all that comes to the loopback is read.
        outside = elsewhere(pid)
        ports = Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for each in outside.values():
                assert int(ports[0]) <= each.port <= int(ports[1]), each
                sender.sendto(b"RTPS", (LOOPBACK if each.address == "0.0.0.0" else each.address, each.port))
            for each in here:
                sender.sendto(b"nothing that anybody could mean", (LOOPBACK, each.port))
        listening = {each.inode for each in here if first <= each.port < first + 250}
        process.wait_until(
            lambda: all(each.waiting == 0 for each in sockets(pid, "udp") if each.inode in listening), graph
        )
        assert [each for each in elsewhere(pid).values() if each.inode in outside and each.waiting == 0] == []
        process.interrupt()
        assert process.wait(graph) == 0, process.told


def test_range_that_is_opened_takes_the_profile_away_and_a_profile_of_ones_own_stays() -> None:
    def told(before: str) -> list[str]:
        ask = "echo ${FASTRTPS_DEFAULT_PROFILES_FILE-none}; echo $ROS_AUTOMATIC_DISCOVERY_RANGE"
        script = f"{before}; . {ROOT}/env.sh; {ask}"
        result = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
        return result.stdout.splitlines()

    ours = f"{ROOT}/afm_bringup/config/loopback.xml"
    none = "unset FASTRTPS_DEFAULT_PROFILES_FILE FASTDDS_DEFAULT_PROFILES_FILE ROS_AUTOMATIC_DISCOVERY_RANGE"
    assert told(none) == [ours, "LOCALHOST"]
    assert told(f"{none}; . {ROOT}/env.sh; export ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET") == ["none", "SUBNET"]
    assert told(f"{none}; export FASTRTPS_DEFAULT_PROFILES_FILE=/mine.xml") == ["/mine.xml", "LOCALHOST"]
    assert told(f"{none}; export ROS_STATIC_PEERS=192.0.2.7") == ["none", "LOCALHOST"]
