"""Calibrations, discoveries, experiments: each in a process of its own, followed by the API."""
