"""Ways to integrate the lateral model, measured against an event-driven reference for docs/numerics.md."""
