"""Calibrations and discoveries as jobs: each in a process of its own, followed by the API."""
