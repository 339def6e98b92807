"""How the finger's model is followed while it plays, and put in force: measured on the twin."""
