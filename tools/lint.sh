#!/usr/bin/env bash
# Style, types, import rules, no wall times in tests, no elementary functions but ours, no circles of imports, class names once, plain words, generated docs. Run by `make lint` in the environment of env.sh.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
ruff check .
ruff format --check .
mypy
lint-imports
python tools/check_times.py
python tools/check_elementary.py
python tools/check_structure.py
python tools/check_words.py
python tools/make_docs.py --check
