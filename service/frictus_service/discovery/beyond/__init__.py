"""What no cause of the catalogue explains: a form from a grammar, or a smooth discrepancy."""
