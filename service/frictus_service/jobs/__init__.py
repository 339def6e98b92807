"""Calibrations, discoveries, experiments: each in a process of its own, run by one engine."""
