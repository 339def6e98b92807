"""The equations of finger, screen and mount: pure functions and frozen models."""
