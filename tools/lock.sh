#!/usr/bin/env bash
# Renew the lock files of requirements/, with the uv of uv.lock: one choice of versions, one file for each set that is installed by itself.
# All versions stay that are not asked for anew; `tools/lock.sh --upgrade` takes the newest ones.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../requirements"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/python" -m pip install --quiet --disable-pip-version-check --require-hashes -r uv.lock
cat base.txt ros-jazzy.txt > "$folder/run.in"
lock() {
  "$folder/bin/uv" pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-annotate \
    --no-emit-index-url --no-emit-find-links "$@"
}
# A package of a smaller set is in the environment already.
without() {
  sed -nE 's/^([A-Za-z0-9_.-]+)==.*/--no-emit-package=\1/p' "$@" | sort -u
}
lock "$@" "$folder/run.in" -o ros-jazzy.lock
# shellcheck disable=SC2046
lock "$@" extras.txt -c ros-jazzy.lock $(without ros-jazzy.lock) -o extras.lock
# shellcheck disable=SC2046
lock "$@" test.txt -c ros-jazzy.lock -c extras.lock $(without ros-jazzy.lock extras.lock) -o test.lock
