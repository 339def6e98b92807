"""Discoveries as jobs of a service: specification, worker and store."""
