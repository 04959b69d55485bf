#!/usr/bin/env bash
# Build the colcon workspace with the Python of .venv.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../ros2_ws"
root=$(dirname "$PWD")

# Of the output of colcon a line for each package, and for each quarter of the messages, which take most of the time.
show_progress() {
  local line part number=0 told=0
  while IFS= read -r line; do
    case $line in
      "Starting >>> "*)
        number=$((number + 1))
        echo "  package $number of $count: ${line#Starting >>> }"
        ;;
      "["[\ 0-9][\ 0-9][0-9]%"]"*)
        part=$((${line:1:3} / 25 * 25))
        [ "$part" -le "$told" ] || echo "    messages: $part %"
        told=$((part > told ? part : told))
        ;;
    esac
  done
}

if [ -z "${ROS_DISTRO:-}" ] || [ "${AFM_ROS:-}" = wheels ]; then
  export AMENT_PREFIX_PATH="$root/.venv" CMAKE_PREFIX_PATH="$root/.venv" ROS_DISTRO=jazzy ROS_VERSION=2
fi
if [ ! -w . ]; then
  echo "error: $root belongs to $(stat -c %U .), and what is built there is older than its sources: you cannot build there" >&2
  echo "       make a clone of your own, or ask for: make build" >&2
  exit 1
fi
# Building against the old install would only bring in what is to be replaced.
rm -rf build install log
. "$root/.venv/bin/activate"
# colcon's own choice has a limit of load in it, with which a busy machine compiles one file at a time.
export MAKEFLAGS=${MAKEFLAGS:--j$(nproc)}
echo "Building the ROS workspace (once: about 2 min of processor time) ..."
# What the first runs need compiled, meanwhile. It can be done without.
if [ -w ../afm_model/afm_model ]; then
  rm -rf ../afm_model/afm_model/kernels
  PYTHONPATH="$root/afm_model" nice -n 19 python ../tools/make_kernels.py > kernels.log 2>&1 &
  trap "kill $! 2> /dev/null || true" EXIT
fi
count=$(python -m colcon list --names-only 2> /dev/null | wc -l)
if ! python -m colcon build --event-handlers console_direct+ console_cohesion- status- desktop_notification- terminal_title- 2>&1 |
  tee "$root/ros2_ws/build.log" | show_progress; then
  tail -n 40 "$root/ros2_ws/build.log" >&2
  echo "error: the workspace did not build; the whole log is in ros2_ws/build.log" >&2
  exit 1
fi
wait || true
mv ./*.log log/
touch install/.built
