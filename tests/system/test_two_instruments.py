"""Two instruments at a time: in namespaces of one ROS domain, or each in a domain of its own."""

import json
import os
import re
import socket
from pathlib import Path

import pytest
from support import Command, Graph, Observer, assert_nothing_left, executable, session, write_scenario

from afm_bringup.domain import claim_domain
from afm_model import ControllerParameters, SimParameters, build, simulate

SIMULATOR = {"run.duration": 0.004, "plant.control_period": 2e-6}
SHARED = {"/diagnostics", "/parameter_events", "/rosout"}
"""Topics that are everybody's; what is on /diagnostics carries the full name of its node."""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    return write_scenario(tmp_path / "short.yaml", afm_sim_node=SIMULATOR)


@pytest.fixture(scope="module")
def trajectory() -> str:
    """Of the same scenario without any topic."""
    return simulate(build(SimParameters, SIMULATOR), ControllerParameters()).trajectory_sha256


def sha256(out: Path) -> str:
    return str(json.loads((out / "scorecard.json").read_text())["trajectory_sha256"])


def test_two_sessions_in_two_namespaces_of_one_domain_share_nothing(
    scenario: Path, trajectory: str, tmp_path: Path
) -> None:
    names: set[str] = set()
    outs = [tmp_path / "out 1", tmp_path / "out 2"]
    with Graph() as graph:
        # Before the sessions: the composed one is short, and its topics are to be seen while it is there.
        observer = graph.add(Observer("observer", "lab1"))
        with (
            session(scenario, outs[0], "--namespace", "lab1", folder=tmp_path) as first,
            session(scenario, outs[1], "--composed", "--namespace", "/left/lab2", folder=tmp_path) as second,
        ):

            def ended() -> bool:
                names.update(name for name, _ in observer.get_topic_names_and_types())
                return first.ended and second.ended

            graph.spin_until(ended)
            assert (first.wait(), second.wait()) == (0, 0), first.text + second.text
    assert [sha256(out) for out in outs] == [trajectory, trajectory]
    assert {"/lab1/measurement", "/lab1/clock", "/left/lab2/measurement", "/left/lab2/clock"} <= names
    assert {name for name in names if not name.startswith(("/lab1/", "/left/lab2/"))} <= SHARED
    assert_nothing_left()


@pytest.mark.long
def test_two_sessions_at_one_instant_take_domains_of_their_own_and_say_which(
    scenario: Path, trajectory: str, tmp_path: Path
) -> None:
    outs = [tmp_path / "out 1", tmp_path / "out 2"]
    alone = ("env", "-u", "ROS_DOMAIN_ID", executable("afm_bringup", "session"), scenario)
    alone += ("--composed", "--no-picture", "--out")
    with Command(*alone, outs[0], folder=tmp_path) as first, Command(*alone, outs[1], folder=tmp_path) as second:
        assert (first.wait(), second.wait()) == (0, 0), first.text + second.text
    domains = [
        re.search(r"^ROS domain (\d+), of this session alone", command.text, re.M) for command in (first, second)
    ]
    numbers = {int(found[1]) for found in domains if found}
    assert len(numbers) == 2
    assert int(os.environ["ROS_DOMAIN_ID"]) not in numbers
    assert [sha256(out) for out in outs] == [trajectory, trajectory]
    assert_nothing_left()


def test_domain_is_claimed_once() -> None:
    claims = [claim_domain() for _ in range(3)]
    try:
        assert len({domain for domain, _ in claims} | {int(os.environ["ROS_DOMAIN_ID"])}) == 4
    finally:
        for _, claim in claims:
            claim.close()


def test_domain_in_which_some_program_has_a_port_is_not_claimed() -> None:
    domain, claim = claim_domain()
    claim.close()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        port.bind(("127.0.0.1", 7400 + 250 * domain + 10))
        another, claim = claim_domain()
        claim.close()
    assert another != domain


def test_namespace_that_ros_does_not_allow_is_refused_in_a_sentence(scenario: Path, tmp_path: Path) -> None:
    with session(scenario, tmp_path / "out", "--namespace", "lab 1", folder=tmp_path) as command:
        assert command.wait() == 2
    assert command.text.startswith("error: --namespace lab 1 is not allowed: ")
    assert len(command.text.splitlines()) == 1
    assert not (tmp_path / "out").exists()
