"""Build of the ROS package afm_bringup."""

from glob import glob

from setuptools import find_packages, setup

NAME = "afm_bringup"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", sorted(glob("config/*"))),
        (f"share/{NAME}/launch", sorted(glob("launch/*.launch.py"))),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="The AFM developers",
    maintainer_email="afm@example.org",
    description="Launch file and session runner of the virtual atomic force microscope.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "check_controller = afm_bringup.__main__:check_controller",
            "check_scenario = afm_bringup.__main__:check_scenario",
            "compare = afm_bringup.__main__:compare",
            "composed = afm_bringup.__main__:composed",
            "identify = afm_bringup.__main__:identify",
            "replay = afm_bringup.__main__:replay",
            "scan = afm_bringup.__main__:scan",
            "scorecard = afm_bringup.__main__:scorecard",
            "session = afm_bringup.__main__:session",
        ]
    },
)
