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
    install_requires=["setuptools", "numpy", "scipy", "numba", "pydantic>=2", "pyyaml", "rich"],
    extras_require={
        "plot": ["matplotlib"],
        "files": ["xarray", "h5py", "gwyfile"],
        "sweep": ["dask", "distributed", "pandas"],
        "margins": ["control"],
    },
    zip_safe=False,
    maintainer="The AFM developers",
    maintainer_email="afm@example.org",
    description="Physics and control laws of the virtual atomic force microscope; needs no ROS.",
    license="Apache-2.0",
)
