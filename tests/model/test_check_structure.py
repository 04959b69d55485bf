"""Claims about tools/check_structure.py: circles of imports and names that stand twice are found."""

import runpy
from pathlib import Path

import pytest

check = runpy.run_path(str(Path(__file__).parents[2] / "tools" / "check_structure.py"))

FILES = {
    "__init__.py": "",
    "engine.py": "from .pacing import Pacing\n\nclass Engine:\n    pass\n",
    "pacing.py": "from typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n    from .engine import Engine\n\n"
    "class Pacing:\n    pass\n",
    "late.py": "from afm_toy import engine\n\ndef load():\n    import afm_toy.later\n",
    "later.py": "from . import late\n\nclass State:\n    pass\n\nclass _Own:\n    pass\n",
    "other.py": "class Engine:\n    pass\n\nclass State:\n    pass\n\nclass _Own:\n    pass\n",
}


@pytest.fixture
def known(tmp_path):
    package = tmp_path / "afm_toy" / "afm_toy"
    package.mkdir(parents=True)
    for name, text in FILES.items():
        (package / name).write_text(text)
    return check["modules"](tmp_path)


def test_imports_for_types_and_in_functions_close_a_circle(known):
    found = check["circles"](check["imports"](known))
    assert sorted(found) == [["afm_toy.engine", "afm_toy.pacing"], ["afm_toy.late", "afm_toy.later"]]


def test_class_of_two_files_is_found_but_not_the_records_of_parts_and_what_belongs_to_a_file(known):
    assert check["twice"](known) == {"Engine": ["afm_toy.engine", "afm_toy.other"]}


def test_our_packages_have_no_circle_and_no_class_name_twice():
    ours = check["modules"](check["ROOT"])
    assert len(ours) > 400
    assert check["circles"](check["imports"](ours)) == [] and check["twice"](ours) == {}
