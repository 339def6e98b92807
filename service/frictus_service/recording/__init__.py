"""Recordings: what a rig published, kept so that a crash costs a second at most."""
