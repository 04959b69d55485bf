"""A virtual atomic force microscope that speaks the Nanonis TCP protocol: programs for real controllers drive it.

This project has no connection with the vendor of these controllers. docs/nanonis.md.
"""
