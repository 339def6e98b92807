"""The document of an identification, its report, and what is written to a folder."""
