"""The registry: published models, who moved which alias, and the calibrations behind them."""
