"""Bad days to order: what is killed, stopped, filled or confused, and what then becomes of a run and its recording."""
