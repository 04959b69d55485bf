"""Everything that README, CONTRIBUTING and docs print to be run: found, sorted by what runs it, and run."""
