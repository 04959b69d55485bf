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
    # The programming interface of rerun changes from one minor release to the next.
    install_requires=["setuptools", "numpy", "pyarrow", "pyyaml", "rerun-sdk==0.41.*", "rich", "scipy"],
    entry_points={
        "console_scripts": [
            f"{NAME} = {NAME}.__main__:main",
            f"inspect = {NAME}.inspect_command:main",
            f"repair = {NAME}.repair:main",
        ]
    },
    zip_safe=False,
    maintainer="The AFM developers",
    maintainer_email="afm@example.org",
    description="Records the topics of the virtual atomic force microscope with rerun, to a file and to a live viewer.",
    license="Apache-2.0",
)
