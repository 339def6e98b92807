"""From trials to a model: responses, fits, statistics, report."""
