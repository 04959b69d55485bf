"""Build of the ROS package afm_tests: it installs nothing, `colcon test` finds the tests of all packages through it."""

from setuptools import setup

NAME = "afm_tests"

setup(
    name=NAME,
    version="0.1.0",
    packages=[],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    maintainer="The AFM developers",
    description="Tests of all packages of the virtual atomic force microscope; `colcon test` runs them.",
    license="Apache-2.0",
)
