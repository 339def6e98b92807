"""The report of an identification: one HTML file that needs nothing else."""
