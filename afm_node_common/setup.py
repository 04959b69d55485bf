"""Build of the ROS package afm_node_common."""

from setuptools import find_packages, setup

NAME = "afm_node_common"

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
    description="What the nodes of the virtual atomic force microscope share: topics, parameters, codec, run loop.",
    license="Apache-2.0",
)
