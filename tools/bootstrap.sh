#!/usr/bin/env bash
# Make .venv: with pinned ROS 2 wheels if no ROS 2 is sourced, on top of the sourced one otherwise.
# Does nothing if .venv is already what the requirements ask for.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root=$PWD

fail() {
  printf 'error: %s\n' "$1" >&2
  printf '       %s\n' "${@:2}" >&2
  exit 1
}

# Tools of ROS 2 write paths into scripts and CMake files without quotes; found out by them, that takes a quarter of an hour.
if printf '%s' "$root$(pwd -P)" | LC_ALL=C grep -q '[^A-Za-z0-9_./@+,=~-]'; then
  fail "ROS 2 cannot be built in the folder $(pwd -P)" \
    "its path must consist of the letters a to z, digits and . _ - + @ , = ~ (no space, no accents): move the clone"
fi

# A ROS 2 counts as sourced if it is not our own environment.
ros=wheels
if [ -n "${ROS_DISTRO:-}" ] && [ "${AFM_ROS:-}" != wheels ]; then
  ros=$ROS_DISTRO
fi

python=${PYTHON:-}
if [ -z "$python" ]; then
  for python in python3 python3.13 python3.12 python3.11 ''; do
    [ -n "$python" ] && "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && break
  done
fi
if [ -z "$python" ] || ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
  found=$("${PYTHON:-python3}" --version 2>&1) || true
  fail "Python 3.11 or newer is needed, found: ${found:-none}" \
    "install it with: sudo apt install python3 python3-venv python3-dev" \
    "or name another one with: PYTHON=/path/to/python3 make demo"
fi

# With .venv active it is the one in there, which is about to be removed.
python=$("$python" -c 'import sys; print(sys._base_executable)')

wanted="$ros $("$python" --version) $(cat requirements/base.txt requirements/ros-jazzy.txt requirements/ros-jazzy.lock requirements/uv.lock tools/bootstrap.sh tools/patch_wheels.py | cksum)"
if [ "$(cat .venv/.complete 2>/dev/null)" = "$wanted" ]; then
  exit 0
fi

[ -w . ] || fail "$root belongs to $(stat -c %U .), and is not built for this Python and ROS 2: you cannot build there" \
  "make a clone of your own, or ask for: make build"
"$python" -c 'import venv, ensurepip' 2>/dev/null ||
  fail "Python's venv module is missing" "install it with: sudo apt install python3-venv"
headers=$("$python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
[ -e "$headers/Python.h" ] ||
  fail "the Python headers are missing ($headers/Python.h)" "install them with: sudo apt install python3-dev"
for tool in gcc g++ cmake; do
  command -v "$tool" >/dev/null ||
    fail "$tool is missing: the ROS messages are compiled" "install it with: sudo apt install build-essential cmake"
done

echo "Setting up .venv with $("$python" --version), ROS 2: $ros (once: about 20 s of processor time, and what the network needs) ..."
rm -rf .venv
site=()
[ "$ros" = wheels ] || site=(--system-site-packages)
"$python" -m venv "${site[@]}" .venv
# Every file is checked against its hash. Beside a ROS 2 of your own the versions of the distribution must be able to stay, so
# that only what base.txt names is pinned there.
packages=(-r requirements/base.txt)
[ "$ros" = wheels ] && packages=(--require-hashes -r requirements/ros-jazzy.lock)
pip=(.venv/bin/python -m pip install --disable-pip-version-check)
# uv does in half the time what pip does, with the certificates of the system; where it cannot (pip has its own settings), pip does it.
# Copies: the wheels are patched below, and links would reach into the cache of uv. Byte code is made of what is used, below.
if ! { "${pip[@]}" --require-hashes -r requirements/uv.lock && .venv/bin/uv pip install --system-certs --link-mode copy --python .venv/bin/python "${packages[@]}"; } \
  > .venv/uv.log 2>&1 && ! "${pip[@]}" --no-compile "${packages[@]}" > .venv/pip.log 2>&1; then
  tail -n 15 .venv/pip.log >&2
  fail "pip could not install the requirements; the whole log is in .venv/pip.log" "is there a network connection?"
fi
.venv/bin/python -m pip uninstall --quiet --yes uv 2> .venv/uv.log # 40 MB
if [ "$ros" = wheels ]; then
  .venv/bin/python tools/patch_wheels.py
else
  .venv/bin/python -c 'import rclpy' ||
    fail "ROS 2 $ros is sourced, but $python cannot import its rclpy" \
      "use the Python that this ROS 2 was built for: PYTHON=/usr/bin/python3 make demo"
fi
# Byte code where Python may not write it itself (PYTHONDONTWRITEBYTECODE, as in many containers; a folder of somebody else):
# a node starts seconds sooner.
PYTHONDONTWRITEBYTECODE='' .venv/bin/python -c 'import matplotlib.pyplot, numba, pydantic, rclpy.action, rerun.blueprint, rich.progress, scipy.linalg'
printf '%s' "$wanted" > "$root/.venv/.complete"
