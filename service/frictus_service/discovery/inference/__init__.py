"""The statistics: linearisation, covariance, random effects, significance, selection."""
