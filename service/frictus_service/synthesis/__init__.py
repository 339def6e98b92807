"""From a texture to screen volts: scenes, tables, kernel, finger estimator, chain."""
