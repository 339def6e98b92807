"""Inference across participants: effects, correlations, mixed models, post-hoc tests."""
