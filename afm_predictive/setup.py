"""Build of the ROS package afm_predictive, which is an ordinary Python package too: `pip install ./afm_predictive`."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "afm_predictive"

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
    install_requires=["afm_model==0.1.0", "numpy>=1.26"],
    # Found by afm_model's registry: the law is chosen by this name wherever the package is installed.
    entry_points={"afm_model.law": ["predictive = afm_predictive:PREDICTIVE"]},
    zip_safe=False,
    maintainer="The AFM developers",
    description="Friction-predicting control law of the virtual atomic force microscope; needs no ROS.",
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
