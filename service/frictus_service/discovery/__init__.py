"""Model criticism: what a simulation gets wrong, named causes, the extended model, its gain.

The way of a discovery, one package each: `evidence` (what trials measured), `problem` (base
model, nuisance parameters, candidate effects), `inference` (covariance, significance,
selection), `decision` (causes named, patterns left), `report`; `one_recording`
where there are too few units for a test. `catalogue` says what each cause
is; `plan` asks beforehand what a study will show.
"""
