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
    python_requires=">=3.11",
    # rclpy and afm_msgs, which every node needs, come with ROS 2.
    install_requires=["afm_model==0.1.0", "numpy>=1.26", "pydantic>=2.5"],
    zip_safe=False,
    maintainer="The AFM developers",
    description="What the nodes of the virtual atomic force microscope share: topics, parameters, codec, run loop.",
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
