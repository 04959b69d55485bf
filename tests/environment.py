"""The environment of a test run, to be set before anything of ROS is imported."""

import os
import signal
import socket
import uuid

_claims: list[socket.socket] = []
"""Of ROS domains, held for as long as this process lives."""


def prepare() -> None:
    """Mark what this run starts, take a ROS domain of its own, and give back to Ctrl-C what it does in a terminal."""
    try:
        from afm_bringup.domain import claim_domain

        # Two clones, or two users, may test at the same time on one machine.
        domain, claim = claim_domain()
        _claims.append(claim)
    except ImportError:  # the tests of the model need no ROS
        domain = 0
    os.environ |= {
        "AFM_TEST_RUN": uuid.uuid4().hex,
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_PYTHON_CHECK_FIELDS": "1",
        # Matrices are small here: threads of BLAS cost twenty times what they do where processors have something to do.
        "OPENBLAS_NUM_THREADS": "1",
        # The tests judge what is printed: wide, without colours.
        "COLUMNS": "200",
        "NO_COLOR": "1",
    }
    # A shell has what it runs in the background ignore SIGINT, and processes inherit that: those of this run as well.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # The same of SIGHUP under nohup.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
