"""Long runs: what a session uses of memory, descriptors, threads and shared memory stays what it was."""
