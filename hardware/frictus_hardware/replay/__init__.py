"""A recording played as a rig: for development without one, and for regression."""
