"""Claims about what the pages print: something runs each piece, and no rule about one is left over."""

import re

import pytest
from printed import plan
from printed.pieces import PAGES, ROOT

PIECES = plan.every_piece()


def test_every_block_of_every_page_is_run_or_has_a_reason_not_to_be():
    assert len(PIECES) > 50
    unknown = []
    for piece in PIECES:
        try:
            plan.fate(piece)
        except LookupError as error:
            unknown.append(str(error))
    assert unknown == []


@pytest.mark.parametrize("name", ["NOT_HERE", "ELSEWHERE", "TEXTS"])
def test_no_rule_about_a_block_is_left_over(name):
    kinds = {"TEXTS": ("text",), "NOT_HERE": ("command", "program")}.get(name, ("command",))
    texts = [piece.text for piece in PIECES if piece.kind in kinds]
    rules = getattr(plan, name)
    assert [rule for rule in rules if not any(re.match(rule, text, re.DOTALL) for text in texts)] == []


def test_no_page_of_the_plan_is_left_over():
    assert {page for page in plan.CLAIMED if not any(piece.mark for piece in PIECES if piece.page == page)} == set()
    assert plan.IN_SECONDS - {piece.page for piece in PIECES if plan.fate(piece) == plan.SHORT} == set()


def test_what_is_said_to_run_a_block_runs_it():
    for page, test in plan.CLAIMED.items():
        assert f'run_programs("{page}"' in (ROOT / test).read_text() or page == "docs/sweep.md", page
    for file in plan.ELSEWHERE.values():
        assert (ROOT / file).exists(), file


COMMANDS = sorted(
    {
        (page, code)
        for page in PAGES
        for code in re.findall(
            r"`((?:make|python|ros2 run) [^`\n]+)`",
            re.sub(r"```.*?```", "", (ROOT / page).read_text(), flags=re.DOTALL),
        )
    }
)


@pytest.mark.parametrize(("page", "code"), COMMANDS)
def test_command_in_a_sentence_names_what_exists(page, code):
    makefile = (ROOT / "Makefile").read_text()
    match code.split():
        case ["make", target, *_]:
            assert re.search(rf"^{target}:", makefile, re.MULTILINE)
        case ["python", "-m", module, *_]:
            assert list(ROOT.glob(f"*/{module.replace('.', '/')}.py")) or list(ROOT.glob(f"*/{module}/__main__.py"))
        case ["python", file, *_]:
            assert (ROOT / file).exists()
        case ["ros2", "run", package, name, *_]:
            assert f"{name} = " in (ROOT / package / "setup.py").read_text()


@pytest.mark.parametrize("page", PAGES)
def test_extras_that_a_page_has_installed_exist(page):
    known = set(re.findall(r'^        "(\w+)": \[', (ROOT / "afm_model" / "setup.py").read_text(), re.MULTILINE))
    named = re.findall(r"afm_model\[([\w,]+)\]", (ROOT / page).read_text())
    assert {extra for each in named for extra in each.split(",")} <= known
