"""Claims about the Nanonis TCP protocol."""
