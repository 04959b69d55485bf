# Source this in bash or zsh:  . ./env.sh
# Afterwards `ros2 run PACKAGE EXECUTABLE` finds the nodes of this workspace.

if [ -n "${BASH_SOURCE:-}" ]; then
  AFM_ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
else
  AFM_ROOT=$(cd "$(dirname "$0")" && pwd)
fi
export AFM_ROOT

if [ ! -e "$AFM_ROOT/.venv/.complete" ] || [ ! -e "$AFM_ROOT/ros2_ws/install/setup.sh" ]; then
  echo "error: nothing is built yet; run: make -C $AFM_ROOT build" >&2
  return 1
fi
# What is built holds the path of its folder: elsewhere it would find nothing, or run the code of the clone it was copied from.
AFM_BUILT_IN=$(sed -n 's/^command = .* //p' "$AFM_ROOT/.venv/pyvenv.cfg")
if [ -n "$AFM_BUILT_IN" ] && [ "$AFM_BUILT_IN" != "$(cd "$AFM_ROOT/.venv" && pwd -P)" ]; then
  echo "error: $AFM_ROOT was built in ${AFM_BUILT_IN%/.venv} and then moved or copied; run: make -C $AFM_ROOT build" >&2
  unset AFM_BUILT_IN
  return 1
fi
unset AFM_BUILT_IN

# ROS 2 of our own (wheels in .venv), unless another one is sourced.
if [ -z "${ROS_DISTRO:-}" ] || [ "${AFM_ROS:-}" = wheels ]; then
  export AFM_ROS=wheels ROS_DISTRO=jazzy ROS_VERSION=2
  export AMENT_PREFIX_PATH="$AFM_ROOT/.venv" CMAKE_PREFIX_PATH="$AFM_ROOT/.venv"
  if [ -n "${RMW_IMPLEMENTATION:-}" ] && [ ! -e "$AFM_ROOT/.venv/lib/lib$RMW_IMPLEMENTATION.so" ]; then
    echo "note: RMW_IMPLEMENTATION = $RMW_IMPLEMENTATION is unset here: the wheels contain rmw_fastrtps_cpp only" >&2
    unset RMW_IMPLEMENTATION
  fi
fi
. "$AFM_ROOT/.venv/bin/activate"
COLCON_CURRENT_PREFIX="$AFM_ROOT/ros2_ws/install" . "$AFM_ROOT/ros2_ws/install/local_setup.sh"

# The instrument stays on this machine unless you say otherwise (docs/security.md): nodes look for one another here only,
# and Fast DDS listens on the loopback interface only. A profile of your own is left as it is.
export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
AFM_LOOPBACK="$AFM_ROOT/afm_bringup/config/loopback.xml"
if [ "$ROS_AUTOMATIC_DISCOVERY_RANGE" = LOCALHOST ] && [ -z "${ROS_STATIC_PEERS:-}" ]; then
  export FASTRTPS_DEFAULT_PROFILES_FILE="${FASTRTPS_DEFAULT_PROFILES_FILE:-$AFM_LOOPBACK}" # Fast DDS 2
  export FASTDDS_DEFAULT_PROFILES_FILE="${FASTDDS_DEFAULT_PROFILES_FILE:-$AFM_LOOPBACK}"   # Fast DDS 3
else
  [ "${FASTRTPS_DEFAULT_PROFILES_FILE:-}" != "$AFM_LOOPBACK" ] || unset FASTRTPS_DEFAULT_PROFILES_FILE
  [ "${FASTDDS_DEFAULT_PROFILES_FILE:-}" != "$AFM_LOOPBACK" ] || unset FASTDDS_DEFAULT_PROFILES_FILE
fi
unset AFM_LOOPBACK

# The wheels hold no ros2 command: a small stand-in runs executables, used only where there is no real one.
if ! command -v ros2 >/dev/null 2>&1; then
  export PATH="$PATH:$AFM_ROOT/tools/bin"
fi
