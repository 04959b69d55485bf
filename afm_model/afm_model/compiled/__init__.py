"""Compiled code: the only room that imports numba and llvmlite, of which it uses inner modules too.

`lint-imports` holds that. A new numba changes these files and no others, and is tried with tests/model/compiled,
tests/model/lanes and `make bits`.
"""

TRIED = {"numba": ("0.59.0", "0.68.1"), "llvmlite": ("0.42.0", "0.50.0")}
"""Oldest and newest versions with which the bits of all runs were compared; docs/numerics.md."""
