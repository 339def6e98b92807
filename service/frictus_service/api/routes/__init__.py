"""The REST API by resource: one module for the routes of each."""
