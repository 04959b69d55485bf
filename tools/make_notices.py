"""Write THIRD-PARTY.md: what the locks install, by the licence that each package states; with all of it installed."""

import re
import sys
import xml.etree.ElementTree as ElementTree
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SETS = {
    "ros-jazzy": "What the nodes need (`make demo`, the container)",
    "extras": "Extras of `afm_model`, added by `make build`",
    "test": "For tests alone, added by `make test`",
}
# Packages for other systems, which are not installed here, and those that state their licence elsewhere only.
STATED = {
    "colorama": "BSD-3-Clause",
    "coloredlogs": "MIT",
    "empy": "LGPL-2.1-or-later",
    "gwyddionpy-converter": "GPL-2.0-or-later",
    "humanfriendly": "MIT",
    "ros-fastcdr": "Apache-2.0",
    "ros-fastrtps": "Apache-2.0",
    "pyreadline3": "BSD-3-Clause",
    "pywin32": "PSF-2.0",
    "setuptools": "MIT",
}


def licence(name: str) -> str:
    """What a package states of itself: in its metadata, or in the manifest of a package of ROS."""
    manifest = Path(sys.prefix) / "share" / name.removeprefix("ros-").replace("-", "_") / "package.xml"
    if name in STATED:
        return STATED[name]
    if name.startswith("ros-") and manifest.exists():
        return " AND ".join(each.text or "" for each in ElementTree.parse(manifest).getroot().iter("license"))
    try:
        stated = metadata(name)
    except PackageNotFoundError:
        raise SystemExit(f"error: {name} is not installed, and not in STATED") from None
    classes = [each.rpartition(" :: ")[2] for each in stated.get_all("Classifier") or () if each.startswith("License")]
    return stated["License-Expression"] or " or ".join(classes) or (stated["License"] or "not stated").split("\n")[0]


def main() -> None:
    """Write the page."""
    lines = [
        "# Third-party packages",
        "",
        "None is part of this repository; they are installed from the package index, or come with a ROS 2 of your own,",
        "each with the text of its licence. Made from the locks by `python tools/make_notices.py`.",
    ]
    for name, title in SETS.items():
        lock = (ROOT / "requirements" / f"{name}.lock").read_text()
        groups: dict[str, list[str]] = {}
        for package, version in dict(re.findall(r"^([A-Za-z0-9_.-]+)==([^\s;]+)", lock, re.MULTILINE)).items():
            groups.setdefault(licence(package), []).append(f"{package} {version}")
        lines += ["", f"## {title}", "", "| licence | packages |", "|---|---|"]
        lines += [f"| {each} | {', '.join(groups[each])} |" for each in sorted(groups, key=str.lower)]
    (ROOT / "THIRD-PARTY.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
