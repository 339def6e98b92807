"""The report of a discovery, to be read in a minute."""
