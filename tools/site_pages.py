"""Hooks of mkdocs: pages made of README, code and figures; links that leave docs/; formulae as MathML."""

import ast
import html
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parent.parent
PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
LINK = re.compile(r"(\]\()([^)\s#]+)((?:#[^)\s]*)?\))")
FOLDERS = {"msgs/msg": "messages.md", "msgs/srv": "messages.md", "msgs/action": "messages.md"}
CSS = """
.md-grid { max-width: 75rem; }
.md-typeset table:not([class]) { font-size: .68rem; }
.md-typeset table:not([class]) :is(th, td) { min-width: 0; padding: .5em .8em; }
.md-typeset td:first-child code { white-space: nowrap; }
.md-typeset img { background: white; }
.md-typeset pre > code { white-space: pre-wrap; }
.equation { display: flex; align-items: center; margin: 1em 0; overflow-x: auto; }
.equation math { flex: 1; }
"""


def python() -> str:
    """Every public name of the packages in Python, with its docstring."""
    lines = ["# Python", "", "Every public name of every package, by its docstring.", ""]
    classes = {"ScoreSummary"}  # has a page of its own
    for init in sorted((ROOT / "afm_model" / "afm_model").rglob("__init__.py")):
        names = [
            ast.literal_eval(node.value)
            for node in ast.parse(init.read_text()).body
            if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__"
        ]
        if names:
            package = ".".join(init.parent.relative_to(ROOT / "afm_model").parts)
            # A class is passed on by packages above: it is shown once.
            members = "".join(f"\n        - {name}" for name in names[0] if name not in classes)
            classes |= {name for name in names[0] if name[0].isupper() and not name.isupper()}
            lines += [f"::: {package}", f"    options:\n      members:{members}", ""]
    return "\n".join([*lines, "::: afm_recorder_node.reader", ""])


def messages() -> str:
    """Every message, service and action, as it is declared."""
    lines = [
        "# Messages, services, actions",
        "",
        "Their fields, as they are declared in the package `afm_msgs`. SI units.",
        "",
    ]
    for kind, title in (("msg", "Messages"), ("srv", "Services"), ("action", "Actions")):
        lines += [f"## {title}", ""]
        for path in sorted((ROOT / "msgs" / kind).glob(f"*.{kind}")):
            lines += [f"### {path.stem}", "", "```sh", path.read_text().rstrip(), "```", ""]
    return "\n".join(lines)


def scenarios() -> str:
    """Every scenario of the package, as it is run."""
    lines = [
        "# Scenarios",
        "",
        "`ros2 run afm_bringup session NAME`, `load_scenario(NAME)`; how to write one: [Sessions](sessions.md).",
        "",
    ]
    for path in sorted((ROOT / "afm_model" / "afm_model" / "scenarios").glob("*.yaml")):
        lines += [f"## {path.stem}", "", "```yaml", path.read_text().rstrip(), "```", ""]
    return "\n".join(lines)


def gallery() -> str:
    """Every figure of the pages, with its caption and the page that explains it."""
    lines, seen = ["# Gallery", "", "All figures are drawn by the software (`make figures`, `make maps`).", ""], set()
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        text = page.read_text()
        title = re.search(r"^# (.*)$", text, re.MULTILINE)
        for caption, figure in re.findall(r"!\[([^\]]*)\]\((?:docs/)?(figures/[^)]+)\)", text):
            if figure not in seen and title:
                target = PAGES.get(page.name, page.name)
                lines += [f"[![{caption}]({figure})]({target})", "", f"{caption} ([{title[1]}]({target}))", ""]
            seen.add(figure)
    return "\n".join(lines)


MADE = {
    "python.md": python,
    "messages.md": messages,
    "scenarios.md": scenarios,
    "gallery.md": gallery,
    "score.md": lambda: "# Score\n\nIts words are in the [glossary](glossary.md).\n\n::: afm_model.ScoreSummary\n",
}


def relinked(text: str, folder: Path) -> tuple[str, list[Path]]:
    """A page of `folder` whose links lead to pages of the site or to copies of sources; and these sources."""
    sources: list[Path] = []

    def one(found: re.Match[str]) -> str:
        start, name, end = found.groups()
        path = (folder / name).resolve()
        if "://" in name or not path.is_relative_to(ROOT):
            return found[0]
        inside = path.relative_to(ROOT)
        if inside.parts[0] == "docs":
            target = inside.relative_to("docs").as_posix()
        elif str(inside) in PAGES or str(inside) in FOLDERS:
            target = PAGES.get(str(inside)) or FOLDERS[str(inside)]
        elif path.is_dir():
            target = "architecture.md"
        else:
            sources.append(path)
            target = f"source/{inside}.txt"
        return start + target + end

    return LINK.sub(one, text), sources


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that are made, and copies of the sources that pages link to."""
    for name, page in PAGES.items():
        files.append(File.generated(config, page, content=(ROOT / name).read_text()))
    for page, make in MADE.items():
        files.append(File.generated(config, page, content=make()))
    files.append(File.generated(config, "site.css", content=CSS))
    sources = {path for page in (ROOT / "docs").glob("*.md") for path in relinked(page.read_text(), page.parent)[1]}
    sources |= {path for name in PAGES for path in relinked((ROOT / name).read_text(), ROOT)[1]}
    for path in sorted(sources):
        files.append(File.generated(config, f"source/{path.relative_to(ROOT)}.txt", abs_src_path=str(path)))
    return files


def tabled(found: re.Match[str]) -> str:
    """A picture of imports as a table: a browser draws it only with a script from elsewhere."""
    arrows: dict[str, list[str]] = {}
    for start, end in re.findall(r"^ *(\w+) --> (\w+)$", found[1], re.MULTILINE):
        arrows.setdefault(start, []).append(end)
    return "\n".join(
        ["| room | imports |", "|---|---|", *(f"| {room} | {', '.join(ends)} |" for room, ends in arrows.items())]
    )


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Links as the site has them; a blank line behind a mark, behind which a table begins."""
    here = ROOT if page.file.src_uri in PAGES.values() else ROOT / "docs"
    markdown = re.sub(
        r"^```mermaid\nflowchart(.*?)^```$", tabled, relinked(markdown, here)[0], flags=re.DOTALL | re.MULTILINE
    )
    return re.sub(r"^(<!-- .* -->)\n(?=\S)", r"\1\n\n", markdown, flags=re.MULTILINE)


def equation(found: re.Match[str]) -> str:
    """A formula in a line of its own, with its number at the right."""
    text = html.unescape(found[1])
    number = re.search(r"\\tag\{(.*?)\}", text)
    formula = convert(text.replace(number[0], "") if number else text, display="block")
    return f'<div class="equation">{formula}<span>{f"({number[1]})" if number else ""}</span></div>'


def on_page_content(content: str, **_: Any) -> str:
    """Formulae as MathML."""
    content = re.sub(
        r'<span class="arithmatex">\\\((.*?)\\\)</span>',
        lambda found: convert(html.unescape(found[1])),
        content,
        flags=re.DOTALL,
    )
    return re.sub(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', equation, content, flags=re.DOTALL)
