#!/usr/bin/env bash
# What a release consists of, in out/release: wheels of all Python packages and the site, made from what is committed.
# The wheels of what needs no ROS are then tried in an environment that has nothing else.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=$PWD/out/release
if [ -n "$(git status --porcelain)" ]; then
  echo "error: there are changes that are not committed: a release is made from a commit" >&2
  exit 1
fi
rm -rf "$out"
mkdir -p "$out/wheels"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
git archive HEAD | tar -x -C "$work"

echo "Compiling the kernels that the wheel takes along ..."
PYTHONPATH="$work/afm_model" .venv/bin/python "$work/tools/make_kernels.py"
for package in "$work"/afm_*/setup.py; do
  .venv/bin/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$out/wheels" "$(dirname "$package")"
done
make --no-print-directory site
cp -r out/site "$out/site"

echo "Trying the wheels in an empty environment ..."
# Of a terminal in which a workspace is sourced.
unset PYTHONPATH
python3 -m venv "$work/environment"
bin=$work/environment/bin
# The kernels belong to these versions.
.venv/bin/python -m pip freeze | grep -E '^(numba|llvmlite|numpy)==' > "$work/constraints.txt"
"$bin/python" -m pip install --quiet --disable-pip-version-check --constraint "$work/constraints.txt" \
  --find-links "$out/wheels" "afm_model[plot,files]" afm_predictive afm_nanonis
cd "$work/environment"
export NUMBA_CACHE_DIR=$work/cache
"$bin/afm" --version
"$bin/afm" closed_loop_tanh > first.txt
"$bin/python" - <<'END'
from afm_model.microscope import Microscope

with Microscope("two_materials") as microscope:
    microscope.approach()
    print(microscope.scan(size_x=1e-6, line_rate=5.0, pixels=32, lines=4).sizes)
END
compiled=$(find "$work/cache" -type f ! -name sources.json ! -name cleaned)
if [ -n "$compiled" ]; then
  echo "error: the first run or the first image has compiled what the wheel should hold:" >&2
  echo "$compiled" >&2
  exit 1
fi
"$bin/afm" closed_loop_predictive > predictive.txt
ls "$out"/wheels
