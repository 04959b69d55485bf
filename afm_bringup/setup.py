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
    python_requires=">=3.11",
    # rclpy and afm_msgs, which every node needs, come with ROS 2.
    install_requires=[
        "afm_sim_node==0.1.0",
        "afm_controller_node==0.1.0",
        "afm_recorder_node==0.1.0",
        "matplotlib>=3.8",
        "pyyaml>=6.0.1",
        "rich>=13",
        "scipy>=1.11.2",
    ],
    zip_safe=False,
    maintainer="The AFM developers",
    description="Launch file and session runner of the virtual atomic force microscope.",
    long_description="Part of the virtual atomic force microscope; needs ROS 2 (rclpy, afm_msgs).",
    long_description_content_type="text/plain",
    license="Apache-2.0",
    classifiers=[
        "Development Status :: 4 - Beta",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: Python :: 3",
        "Topic :: Scientific/Engineering :: Physics",
    ],
    entry_points={
        "console_scripts": [
            "check_controller = afm_bringup.__main__:check_controller",
            "check_scenario = afm_bringup.__main__:check_scenario",
            "compare = afm_bringup.__main__:compare",
            "composed = afm_bringup.__main__:composed",
            "contained = afm_bringup.__main__:contained",
            "identify = afm_bringup.__main__:identify",
            "joint_bridge = afm_bringup.__main__:joint_bridge",
            "replay = afm_bringup.__main__:replay",
            "scan = afm_bringup.__main__:scan",
            "scorecard = afm_bringup.__main__:scorecard",
            "session = afm_bringup.__main__:session",
        ]
    },
)
