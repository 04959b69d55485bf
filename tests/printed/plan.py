"""What runs each piece: by pattern, so that a page may be rewritten; a piece that nothing runs is a fault.

`fate` asks in this order: a reason not to run it here; what else runs it; then its page, with `make test` or the long
tests.
"""

import re
from functools import cache

from .pieces import PAGES, ROOT, Piece, pieces

NOT_HERE = {
    r"docker |AFM_UID=.* docker ": "it needs Docker",
    r"sudo apt ": "it changes the system",
    r"pip install ": "it changes the environment of the tests, and needs the network",
    r"jupyter |rqt_plot |rerun out/": "it opens a window and stays",
    r"ros2 run afm_recorder_node (live|view) |.* --live": "it opens a browser "
    "(test_live.py, test_view_command.py run it without)",
    r"dask ": "it needs other machines",
    r"export ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET": "it needs another machine",
    r"export RMW_IMPLEMENTATION=": "it needs a middleware that the wheels do not have",
    r"ros2 (launch|bag) ": "it needs a full ROS 2 (test_launch.py, test_bag_qos.py run what is ours)",
    r"ros2 run controller_manager ": "it needs ros2_control "
    "(test_ros2_control.py runs what the component does without it)",
    r"python examples/learn_scan_line.py|simulator = process_simulator": "it needs torch, 3 GB with CUDA "
    "(test_scan_line.py, test_inference.py run what is ours)",
    r"train, test = nonlinear_benchmarks": "it needs nonlinear_benchmarks (test_stick_slip_data.py loads with it)",
    r"ros2 security |for node .* ros2 security |export ROS_SECURITY|.* --enclave ": "it "
    "needs the ros2 security of a full ROS 2",
    r"import socket\nfrom nanonis_spm|from nanonisTCP ": "it needs a client of others from PyPI "
    "(tests/nanonis/test_clients.py runs the suites of both)",
    r"self\.z = HeightLoop": "they are lines of a class (test_height_loop.py runs one with them)",
    r"rm examples/cpp_controller|colcon build |.*ros2 run cpp_controller": "it needs the rclcpp of a full ROS 2 "
    "(test_controller_examples.py compiles it without)",
}
"""Commands that are not run by the tests, and the reason."""

ELSEWHERE = {
    r"make ": ".ci/run",
    r"python -m pytest ": ".ci/run",
    r"python examples/learn_tracking.py": "tests/model/studies/test_learning.py",
    r"python examples/stick_slip_data.py": "tests/model/studies/test_stick_slip_data.py",
    r"ros2 run afm_bringup joint_bridge": "tests/nodes/test_joint_bridge.py",
    r"python examples/nanonis_two_materials.py": "tests/nanonis/test_physics.py",
    r"afm nanonis ": "tests/nanonis/test_commands.py",
    r"ros2 run afm_nanonis server ": "tests/nanonis/test_commands.py",
    r".* compare .* --robust ": "tests/predictive/test_wrong_models.py",
    r"python tools/measure_numerics.py --write": "tests/model/test_docs_numbers.py",
}
"""Commands that something else runs, in the same or in a shorter form."""

CLAIMED = {
    "docs/files.md": "tests/model/files/test_docs_files.py",
    "docs/library.md": "tests/model/test_library.py",
    "docs/microscope.md": "tests/model/test_docs_microscope.py",
    "docs/images.md": "tests/model/test_docs_images.py",
    "docs/verbs.md": "tests/model/microscope/test_docs_verbs.py",
    "docs/dynamic.md": "tests/model/microscope/test_tune.py",
    "docs/tapping.md": "tests/model/microscope/test_tune.py",
    "docs/sweep.md": "tests/model/test_sweep.py",
}
"""Pages whose programs and files with a name, `<!-- name -->`, are run by a test of what they give."""

TEXTS = {
    r"tracking error, rms|the same trajectory in all|f0 = |tracking error along x, rms": "what a command prints",
    r" *law  runs  finished|warning: |\[\[ 9\.15": "what a command prints",
    r"flowchart|law -> command|measurement --> estimate|control tick +0": "a drawing",
    r"<hardware>": "a part of a robot description",
    r"-p run\.spin_time:=": "arguments of a node",
    r"\[project\.entry-points": "a file of a package",
}
"""Texts that nobody runs, and what they are."""

IN_SECONDS = {f"docs/{name}.md" for name in ("first_run", "verbs", "sweep", "library")}
"""Pages with commands that run with `make test`; pages without commands do, too."""
SHORT, LONG = "make test", "the long tests"


def fate(piece: Piece) -> str:
    """Return what runs a piece: a reason not to, a file, a place where the same is run, `SHORT` or `LONG`.

    Raises
    ------
    LookupError
        If nothing does.
    """
    if piece.kind in ("command", "program") and (reason := _first(NOT_HERE, piece)):
        return f"not here: {reason}"
    if piece.kind == "command":
        if (other := _first(ELSEWHERE, piece) or _same(piece)) is not None:
            return other
    if piece.kind == "text":
        if what := _first(TEXTS, piece):
            return f"not here: it is {what}"
        raise LookupError(f"{piece.where}: nothing runs this; if it is not to be run, tests/printed/plan.py says why")
    if piece.kind == "program" and (example := _example(piece)):
        return example
    if piece.mark and piece.page in CLAIMED:
        return CLAIMED[piece.page]
    return SHORT if piece.page in IN_SECONDS or not has_commands(piece.page) else LONG


def _first(rules: dict[str, str], piece: Piece) -> str | None:
    return next((what for pattern, what in rules.items() if re.match(pattern, piece.text, re.DOTALL)), None)


def _same(piece: Piece) -> str | None:
    """Where a command stands first, if not here; what sets up a terminal or starts a node is run again."""
    if re.match(r"\. |cd |cp |export |[A-Z_]+=\$|ros2 run (afm_\w+_node) \1 ", piece.text):
        return None
    first = next(each for each in every_piece() if bare(each) == bare(piece))
    return None if first.page == piece.page else f"{first.page}:{first.line}"


def bare(piece: Piece) -> str:
    """Return a command without its comment."""
    return re.sub(r"\s+#.*", "", piece.text) if piece.kind == "command" else piece.text


@cache
def has_commands(page: str) -> bool:
    """Whether a page has commands."""
    return any(piece.kind == "command" for piece in pieces(page))


def _example(piece: Piece) -> str:
    """Return the file of examples/ that a program is, which has tests; empty if it is none."""
    for file in ROOT.glob("examples/**/*.py"):
        if file.read_text() == piece.text:
            return str(file.relative_to(ROOT))
    return ""


def listing() -> list[str]:
    """Return a line for each piece, with what runs it, or why nothing does."""
    return [f"{piece.where}\n    {fate(piece)}" for piece in every_piece()]


def not_run() -> list[str]:
    """Return a line for each reason not to run a command, with how many commands have it."""
    reasons = [said for piece in every_piece() if piece.kind == "command" and (said := _first(NOT_HERE, piece))]
    return [f"{reasons.count(reason):3d} printed commands not run here: {reason}" for reason in dict.fromkeys(reasons)]


@cache
def every_piece() -> tuple[Piece, ...]:
    """Return all pieces of all pages."""
    return tuple(piece for page in PAGES for piece in pieces(page))
