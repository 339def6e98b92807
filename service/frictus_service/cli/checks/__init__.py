"""Commands that check an installation, a running service and a rig."""
