"""What a command does at its begin and end: a ROS domain that nobody else on this machine uses, why it ends.

Imports nothing of ROS: the domain is chosen before that.
"""

import os
import socket
import sys
from contextlib import suppress
from pathlib import Path

_DOMAINS = range(1, 102)
"""All that Linux has ports for; 0 is everybody's."""
_PORTS_PER_DOMAIN, _FIRST_PORT = 250, 7400


class NoDomainError(RuntimeError):
    """Every ROS domain is in use; the message is one sentence."""


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
    NoDomainError
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
    raise NoDomainError(f"no ROS domain from {_DOMAINS[0]} to {_DOMAINS[-1]} is free: set ROS_DOMAIN_ID")


def claimed_domain(of: str = "") -> socket.socket | None:
    """Take a free ROS domain, unless one is chosen; to be kept as long as it is used.

    Parameters
    ----------
    of : str
        Who uses the domain: its number is then printed.

    Raises
    ------
    NoDomainError
        If none is free.
    """
    # rcl takes an empty one for none.
    if os.environ.get("ROS_DOMAIN_ID"):
        return None
    domain, claim = claim_domain()
    os.environ["ROS_DOMAIN_ID"] = str(domain)
    if of:
        print(f"ROS domain {domain}, of {of} alone. To listen: export ROS_DOMAIN_ID={domain}", file=sys.stderr)
    return claim


def end(text: object, code: int) -> int:
    """Say why it ends, if the terminal is still there; the exit code."""
    with suppress(OSError):  # the terminal may be gone
        print(text, file=sys.stderr, flush=True)
    return code


def _domains_with_ports() -> set[int]:
    """Domains in which any node of this machine has a UDP port open."""
    ports = []
    for table in ("udp", "udp6"):
        try:
            lines = Path(f"/proc/net/{table}").read_text().splitlines()[1:]
        except OSError:
            continue
        ports += [int(line.split()[1].rpartition(":")[2], 16) for line in lines]
    return {(port - _FIRST_PORT) // _PORTS_PER_DOMAIN for port in ports}
