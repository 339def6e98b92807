"""Psychometric functions: their fits and thresholds, and observers who answer by them."""
