"""Run the notebooks with a real kernel and keep what they show: text, tables, figures as small PNG.

python tools/make_notebooks.py                      # all of them, in place
python tools/make_notebooks.py notebooks/paper.ipynb
"""

import argparse
import base64
import sys
import time
from io import BytesIO
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "notebooks"
KERNEL = {"display_name": "Python 3 (ipykernel)", "language": "python", "name": "python3"}
TIMEOUT = 600
"""For one cell [s of wall time]: a busy machine compiles slowly."""


def main() -> int:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="notebooks; default: all")
    parser.add_argument("--out", type=Path, help="folder to write to; default: in place")
    arguments = parser.parse_args()
    for path in arguments.files or sorted(FOLDER.glob("*.ipynb")):
        start = time.perf_counter()
        written = run(path, arguments.out or path.parent)
        print(f"{path.name}: {written.stat().st_size / 1000:.0f} kB, {time.perf_counter() - start:.0f} s", flush=True)
    return 0


def run(path: Path, out: Path) -> Path:
    """Execute a notebook in its folder, and return the file in `out`, which is written when all its cells have run."""
    notebook = nbformat.read(path, as_version=4)
    folder = {"metadata": {"path": str(path.parent)}}
    client = NotebookClient(notebook, timeout=TIMEOUT, startup_timeout=TIMEOUT, resources=folder)
    client.execute()
    # The same run gives the same file: no times, no versions.
    notebook.metadata = nbformat.from_dict({"kernelspec": KERNEL, "language_info": {"name": "python"}})
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", []):
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = smaller(output.data["image/png"])
                del output.data["text/plain"]  # <Figure size ...>
    nbformat.validate(notebook)
    out.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, out / path.name)
    return out / path.name


def smaller(picture: str) -> str:
    """The same PNG, in base64, with a palette: a drawing has few colours."""
    packed = BytesIO()
    opened = Image.open(BytesIO(base64.b64decode(picture))).convert("RGB")
    opened.quantize(128, dither=Image.Dither.NONE).save(packed, "PNG", optimize=True)
    return base64.b64encode(packed.getvalue()).decode()


if __name__ == "__main__":
    sys.exit(main())
