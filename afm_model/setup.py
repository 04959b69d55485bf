"""Build of the ROS package afm_model, which is an ordinary Python package too: `pip install ./afm_model`."""

from setuptools import find_packages, setup

NAME = "afm_model"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "scenarios/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    # The oldest of each are those with which tests/model/test_bits_elsewhere.py has compared the bits.
    install_requires=[
        "setuptools",
        "numpy>=1.26",
        "scipy>=1.11.2",
        "numba>=0.59",
        "pydantic>=2.5",
        "pyyaml>=6.0.1",
        "rich>=13",
    ],
    extras_require={
        "plot": ["matplotlib"],
        "files": ["xarray", "h5py", "gwyfile"],
        "sweep": ["dask", "distributed", "pandas"],
        "margins": ["control"],
        "learn": ["gymnasium>=1.1"],
    },
    zip_safe=False,
    maintainer="The AFM developers",
    maintainer_email="afm@example.org",
    description="Physics and control laws of the virtual atomic force microscope; needs no ROS.",
    license="Apache-2.0",
)
