"""The tip as a sample knows it: a sample that is shown as the tip follows it is made for one radius."""

from ..parts.part import Tree


def tip_radius(parameters: Tree) -> float:
    """Radius of the tip [m]: of the plant's own cantilever, or contact.R."""
    own = getattr(parameters.plant, "cantilever_numbers", None)
    return float(own.tip_radius if own is not None else parameters.contact.R)
