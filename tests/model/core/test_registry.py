"""Claims about when a name runs a module: at start, from where one works; never later."""

import subprocess
import sys
from pathlib import Path

PROGRAM = """
import sys
from afm_model.core import registry
from afm_model.core.errors import ParameterError

def told(where):
    try:
        return registry.find("law", where).name
    except ParameterError as error:
        return str(error)

path = list(sys.path)
print(told("mine:LAW"))
print(told("leaves:LAW"))
print(told("colorsys:LAW"))
print(registry.load("uses:LAW").name)
registry.close()
print(told("mine:LAW"))
print(told("later:LAW"))
print(sys.path == path, "" in sys.path, "later" in sys.modules)
"""
LAW = "class LAW:\n    name, family = {!r}, 'law'\n"


def test_modules_of_the_working_folder_are_loaded_at_start_and_hide_none_of_others(tmp_path: Path) -> None:
    program, work = tmp_path / "program.py", tmp_path / "work"
    work.mkdir()
    program.write_text(PROGRAM)
    for name, content in {
        "mine": LAW.format("one of mine"),
        "leaves": "raise SystemExit('I leave')\n",
        "colorsys": LAW.format("in place of an installed one"),
        "uses": "import mine\nLAW = mine.LAW\n",
        "later": LAW.format("too late"),
    }.items():
        (work / f"{name}.py").write_text(content)
    done = subprocess.run([sys.executable, program], cwd=work, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [
        "one of mine",
        "law leaves:LAW cannot be loaded: SystemExit: I leave",
        "law colorsys:LAW cannot be loaded: AttributeError: module 'colorsys' has no attribute 'LAW'",
        "one of mine",
        "one of mine",
        "law later:LAW was not loaded when the node started, and later nothing is: start it with "
        "process.parts:=later:LAW",
        "True False False",
    ]
