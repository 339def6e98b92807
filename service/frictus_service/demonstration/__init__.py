"""What `frictus demo` shows: a rig, a client that streams a texture to it, and the error."""
