"""Many instruments computed together, up to 32 side by side in one compiled loop: docs/numerics.md."""
