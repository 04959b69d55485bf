#!/usr/bin/env bash
# add.sh SET...: what requirements/SET names, into .venv, unless it is there (bootstrap.sh makes .venv).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
for set in "$@"; do
  wanted=$(cksum < "requirements/$set.lock")
  [ "$(cat ".venv/.$set" 2> /dev/null)" != "$wanted" ] || continue
  [ -w .venv ] || { echo "error: .venv belongs to $(stat -c %U .venv), and lacks requirements/$set.txt: you cannot install there" >&2; exit 1; }
  echo "Installing requirements/$set.txt (once) ..."
  # Each lock holds what the smaller sets lack. Beside a ROS 2 of your own the versions of the distribution may stay.
  packages=(--no-deps --require-hashes -r "requirements/$set.lock")
  case $(cat .venv/.complete) in wheels\ *) ;; *) packages=(-r "requirements/$set.txt") ;; esac
  if ! .venv/bin/python -m pip install --disable-pip-version-check --no-compile "${packages[@]}" > .venv/pip.log 2>&1; then
    tail -n 15 .venv/pip.log >&2
    echo "error: pip could not install requirements/$set.txt; the whole log is in .venv/pip.log" >&2
    exit 1
  fi
  echo "$wanted" > ".venv/.$set"
done
