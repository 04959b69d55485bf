"""Verbs with the law in a controller node: the same bytes."""

from pathlib import Path

from quick_lever import INSTRUMENT, KNOWN, LAW
from support import Graph, write_scenario
from verbs_bench import APPROACH, SCAN, Bench, assert_same, scan_in_process

from afm_controller_node.node import ControllerNode


def test_bytes_are_the_same_with_the_law_in_a_controller_node(tmp_path: Path) -> None:
    image, sha = scan_in_process()
    file = write_scenario(tmp_path / "both.yaml", afm_sim_node=INSTRUMENT, afm_controller_node=LAW | KNOWN)
    with Graph(["--ros-args", "--params-file", str(file)]) as graph:
        graph.add(ControllerNode())
        bench = Bench(graph)
        bench.do(APPROACH)
        bench.do(SCAN)
        assert_same(bench.image(SCAN, 1), image)
        assert bench.simulator.run.instrument.trajectory_sha256() == sha
