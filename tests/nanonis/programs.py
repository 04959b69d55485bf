"""Programs of others, unchanged: the ports that they know lead to those of a server of the tests."""

import os
import subprocess
import sys
from pathlib import Path

from pypi import installed

from afm_nanonis.server import PORTS

from .conftest import Served

_SITE = """
import os, socket
free = dict(zip({ports}, map(int, os.environ["PORTS"].split(","))))
connect = socket.socket.connect
def at_free_port(self, place):
    return connect(self, (place[0], free.get(place[1], place[1])) if isinstance(place, tuple) else place)
socket.socket.connect = at_free_port
"""
"""Python runs it at its start: several tests may run at one time, and a port may be taken."""


def redirect(folder: Path) -> None:
    """Lead programs that find packages in this folder to the ports of `places`."""
    (folder / "sitecustomize.py").write_text(_SITE.format(ports=PORTS))


def programs(folder: Path, *packages: str) -> Path:
    """Install packages from PyPI into a folder, for `run`."""
    redirect(installed(folder, *packages))
    return folder


def places(served: Served, *folders: Path) -> dict[str, str]:
    """Environment of a program: where it finds packages, and the ports of a server."""
    found = {"PYTHONPATH": os.pathsep.join(map(str, folders)), "PORTS": ",".join(map(str, served.server.ports))}
    # --no-daemon of nspmctl is taken off by its first half, and its second half starts one.
    return os.environ | found | {"MPLBACKEND": "Agg", "NSPMCTL_NO_DAEMON": "1"}


def run(served: Served, folder: Path, *program: Path | str) -> str:
    """Output of a Python program that finds packages in a folder, and has to succeed."""
    done = subprocess.run(
        [sys.executable, *program],
        env=places(served, folder),
        cwd=served.front.folder,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout
