"""What everything stands on: compiled kernels, records in an array, declared parameters, parts by name, errors."""
