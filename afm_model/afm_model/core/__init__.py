"""Basis of all rooms: compiled kernels, records in an array, declared parameters, parts by name, errors."""
