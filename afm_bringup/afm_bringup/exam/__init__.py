"""Test of a controller against the drive contract, rule by rule."""
