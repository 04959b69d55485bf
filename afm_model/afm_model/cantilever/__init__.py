"""Theory of the cantilever as a beam, for the plants and for the analysis of measured records alike."""
