"""Bridges: what a rig publishes, on the networks of other programs."""
