"""What the figures were measured on, and running things for them."""

import os
import platform
import re
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_prefix

PACKAGES = ("numpy", "numba", "rclpy", "rerun-sdk")


def facts() -> dict[str, Any]:
    """Processor, system, versions."""
    cpu = re.search(r"model name\s*:\s*(.*)", Path("/proc/cpuinfo").read_text())
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "of the ROS 2 that is sourced"
    return {
        "processor": cpu[1] if cpu else platform.processor(),
        "cores": len(os.sched_getaffinity(0)),
        "kernel": platform.release(),
        "python": platform.python_version(),
        "ros": os.environ.get("ROS_DISTRO", ""),
        "rmw": os.environ.get("RMW_IMPLEMENTATION", "default"),
        "versions": versions,
        "load_at_begin": os.getloadavg()[0],
    }


def executable(package: str, name: str) -> str:
    """Path of an installed node."""
    return str(Path(get_package_prefix(package)) / "lib" / package / name)


@contextmanager
def running(*commands: list[str], log: Path) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes that are ended by SIGINT; their output is appended to `log`."""
    with log.open("ab") as file:
        processes = [subprocess.Popen(command, stdout=file, stderr=file) for command in commands]
        try:
            yield processes
        finally:
            for process in processes:
                process.send_signal(signal.SIGINT)
            for process in processes:
                try:
                    process.wait(30.0)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def cpu_seconds(pid: int) -> float:
    """Processor time that a process has used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_megabytes(pid: int) -> float:
    """Resident memory of a process."""
    return int(re.search(r"VmRSS:\s*(\d+)", Path(f"/proc/{pid}/status").read_text())[1]) / 1024.0  # type: ignore[index]
