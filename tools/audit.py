"""Write requirements/audit.tsv: when each locked package was released, and the libraries that its wheel brings along.

python tools/audit.py      # after tools/lock.sh, with all of it installed; makes an environment with the uv of uv.lock

Dates are those of the index. Known faults of a package are told by its advisories (pip-audit, a weekly job); of a
library in a wheel no such list knows.
"""

import re
import subprocess
import sys
import tempfile
import tomllib
import venv
from datetime import datetime
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent / "requirements"
SETS = ("ros-jazzy", "extras", "test")
HEAD = "package\tversion\tset\treleased\tlibraries in its wheel"


def released(folder: Path) -> dict[tuple[str, str], str]:
    """Day of the first file of each locked version; empty where the index tells none."""
    venv.create(folder / "venv", with_pip=True)
    python, locks = folder / "venv" / "bin" / "python", [FOLDER / f"{name}.lock" for name in SETS]
    pip = [python, "-m", "pip", "install", "--quiet", "--require-hashes", "-r", FOLDER / "uv.lock"]
    subprocess.run(pip, check=True)
    compiled = [folder / "venv" / "bin" / "uv", "pip", "compile", "--quiet", "--universal", "--python-version", "3.11"]
    subprocess.run([*compiled, "--format", "pylock.toml", *locks, "-o", folder / "pylock.toml"], check=True)
    made = {}
    for package in tomllib.loads((folder / "pylock.toml").read_text())["packages"]:
        times = [each.get("upload-time") for each in [*package.get("wheels", []), package.get("sdist", {})]]
        days = [each.date().isoformat() for each in times if isinstance(each, datetime)]
        made[package["name"], package["version"]] = min(days, default="")
    return made


def libraries(name: str) -> str:
    """Shared libraries of others in a wheel, each once, without the hash in its name."""
    try:
        own = files(name) or []
    except PackageNotFoundError:  # for another system or Python
        return ""
    names = {each.name for each in own if each.parent.name.endswith(".libs")}
    return " ".join(sorted({re.sub(r"-[0-9a-f]{8}(?=[.-])", "", each) for each in names}))


def main() -> None:
    """Write the table."""
    lines = [HEAD]
    with tempfile.TemporaryDirectory() as folder:
        days = released(Path(folder))
    for where in SETS:
        lock = (FOLDER / f"{where}.lock").read_text()
        for name, version in re.findall(r"^([A-Za-z0-9_.-]+)==([^\s;]+)", lock, re.MULTILINE):
            lines.append(f"{name}\t{version}\t{where}\t{days.get((name, version), '')}\t{libraries(name)}")
    (FOLDER / "audit.tsv").write_text("\n".join(lines) + "\n")
    without = [line.partition("\t")[0] for line in lines[1:] if not line.split("\t")[3]]
    print(f"{len(lines) - 1} packages; no date: {', '.join(without) or 'none'}", file=sys.stderr)


if __name__ == "__main__":
    main()
