"""What a simulation gets wrong: criticism, named causes, the extended model, and its gain."""
