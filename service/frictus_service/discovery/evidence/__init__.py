"""What the trials of a study measure, as a table of rows that a model can be compared with."""
