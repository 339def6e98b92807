"""Evidence that the model in force is wrong: by cause, and by anything that no cause is."""
