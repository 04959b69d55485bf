"""Finding what is installed: scenarios and executables. Imports nothing that `ros2 launch` may not have."""

from pathlib import Path

from ament_index_python.packages import get_package_prefix, get_package_share_directory


def executable(package: str, name: str) -> str:
    """An installed executable, as `ros2 run` finds it."""
    return str(Path(get_package_prefix(package)) / "lib" / package / name)


def scenario_folder() -> Path:
    """Where the scenarios of this package stand."""
    return Path(get_package_share_directory("afm_bringup")) / "scenarios"


def find_scenario(name: str) -> Path:
    """File of a scenario given by name or by path.

    Raises
    ------
    FileNotFoundError
        If there is none; the message lists those that exist.
    """
    if Path(name).is_file():
        return Path(name).resolve()
    path = scenario_folder() / f"{name}.yaml"
    if path.is_file():
        return path
    known = ", ".join(sorted(file.stem for file in scenario_folder().glob("*.yaml")))
    raise FileNotFoundError(f"unknown scenario {name}: it must be one of {known}, or a file")
