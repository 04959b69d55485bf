"""Build of the ROS package afm_model, which is an ordinary Python package too: `pip install ./afm_model`."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "afm_model"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "scenarios/*.yaml", "kernels/*/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    # The oldest of each are those with which tests/model/test_bits_elsewhere.py has compared the bits.
    install_requires=["numpy>=1.26", "scipy>=1.11.2", "numba>=0.59", "pydantic>=2.5", "pyyaml>=6.0.1", "rich>=13"],
    extras_require={
        "plot": ["matplotlib>=3.8"],
        "files": ["xarray>=2024.1", "h5py>=3.10", "gwyfile>=0.3"],
        "sweep": ["dask>=2024.1", "distributed>=2024.1", "pandas>=2.2"],
        "margins": ["control>=0.10"],
        "learn": ["gymnasium>=1.1"],
    },
    entry_points={"console_scripts": ["afm = afm_model.__main__:main"]},
    zip_safe=False,
    maintainer="The AFM developers",
    description="Physics and control laws of the virtual atomic force microscope; needs no ROS.",
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
