"""A ROS domain that nobody else on this machine uses. Imports nothing of ROS: the domain is chosen before that."""

import os
import socket
from pathlib import Path

_DOMAINS = range(1, 102)
"""All that Linux has ports for; 0 is everybody's."""
_PORTS_PER_DOMAIN, _FIRST_PORT = 250, 7400


def claim_domain() -> tuple[int, socket.socket]:
    """A free ROS domain.

    Returns
    -------
    int
        Its number.
    socket
        Keep it: it claims the number for this process, and no longer than this process lives.

    Raises
    ------
    RuntimeError
        If all are in use.
    """
    used = _domains_with_ports()
    # The process id spreads the first guess.
    for offset in range(len(_DOMAINS)):
        domain = _DOMAINS[(os.getpid() + offset) % len(_DOMAINS)]
        if domain in used:
            continue
        claim = socket.socket(socket.AF_UNIX)
        try:
            claim.bind(f"\0afm-domain-{domain}")  # a name without a file: only one process can have it
        except OSError:
            claim.close()
        else:
            return domain, claim
    raise RuntimeError(f"no ROS domain from {_DOMAINS[0]} to {_DOMAINS[-1]} is free: set ROS_DOMAIN_ID")


def _domains_with_ports() -> set[int]:
    """Domains in which some node of this machine, of whatever program, has a UDP port open."""
    ports = []
    for table in ("udp", "udp6"):
        try:
            lines = Path(f"/proc/net/{table}").read_text().splitlines()[1:]
        except OSError:
            continue
        ports += [int(line.split()[1].rpartition(":")[2], 16) for line in lines]
    return {(port - _FIRST_PORT) // _PORTS_PER_DOMAIN for port in ports}
