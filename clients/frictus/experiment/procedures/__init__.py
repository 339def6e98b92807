"""Which level comes next: procedures, and the order in which a design's trials are run."""
