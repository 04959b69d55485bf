"""Paths of installed files. Imports nothing that `ros2 launch` may not have."""

from pathlib import Path

from ament_index_python.packages import get_package_prefix


def executable(package: str, name: str) -> str:
    """An installed executable, as `ros2 run` finds it."""
    return str(Path(get_package_prefix(package)) / "lib" / package / name)


def config(name: str) -> Path:
    """Path of an installed configuration file."""
    return Path(get_package_prefix("afm_bringup")) / "share" / "afm_bringup" / "config" / name
