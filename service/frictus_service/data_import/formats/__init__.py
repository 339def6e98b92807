"""Files of other programs as columns of numbers; a function for each format."""
