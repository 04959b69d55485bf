"""Build of the ROS package afm_recorder_node."""

from setuptools import find_packages, setup

NAME = "afm_recorder_node"

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
    # rclpy and afm_msgs, which every node needs, come with ROS 2. rerun changes with each minor release.
    install_requires=[
        "afm_node_common==0.1.0",
        "mcap==1.*",
        "numpy>=1.26",
        "pyarrow>=18",
        "pydantic>=2.5",
        "pyyaml>=6.0.1",
        "rerun-sdk==0.41.*",
        "rich>=13",
        "rosbags==0.11.*",
        "scipy>=1.11.2",
    ],
    entry_points={
        "console_scripts": [
            f"{NAME} = {NAME}.__main__:main",
            f"inspect = {NAME}.inspect_command:main",
            f"live = {NAME}.live:main",
            f"repair = {NAME}.repair:main",
            f"view = {NAME}.view_command:main",
        ]
    },
    zip_safe=False,
    maintainer="The AFM developers",
    description="Records the topics of the virtual atomic force microscope with rerun, to a file and to a live viewer.",
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
)
