"""How close what is felt comes to what was asked for, on a rig that knows the truth."""
