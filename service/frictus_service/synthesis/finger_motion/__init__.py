"""A finger's motion from what the sensors of a rig measure of it."""
