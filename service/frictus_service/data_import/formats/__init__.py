"""Files of other programs as columns of numbers; one module for each format."""
