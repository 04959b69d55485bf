"""Short runs of a comparison, and where the classes of the examples are."""

from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "controllers"
SHORT = {"references": ["sine 2500"], "progress": False}
"""A reference fast enough for a run to be over soon."""
