"""Build of the ROS package afm_controller_node."""

from setuptools import find_packages, setup

NAME = "afm_controller_node"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="The AFM developers",
    maintainer_email="afm@example.org",
    description="Control laws of the paper as a node: measurements in, piezo drives out.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "afm_controller_node = afm_controller_node.__main__:main",
        ]
    },
)
