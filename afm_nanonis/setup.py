"""Build of the ROS package afm_nanonis, which is an ordinary Python package too: `pip install ./afm_nanonis`."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "afm_nanonis"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    # The server in front of a microscope on topics needs afm_bringup and ROS 2 as well.
    install_requires=["afm_model[files]==0.1.0", "numpy>=1.26"],
    entry_points={
        "console_scripts": [f"server = {NAME}.ros_server:main"],
        "afm_model.command": [f"nanonis = {NAME}.command:main"],
        # Known by name to a simulator, too.
        "afm_model.verb": [f"free_scan = {NAME}.scan_state:FreeScan"],
    },
    zip_safe=False,
    maintainer="The AFM developers",
    description="The virtual atomic force microscope behind the Nanonis TCP protocol, for programs of controllers.",
    long_description=Path(__file__).resolve().with_name("README.md").read_text(),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    classifiers=[
        "Development Status :: 4 - Beta",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: Python :: 3",
        "Topic :: Scientific/Engineering :: Physics",
    ],
)
