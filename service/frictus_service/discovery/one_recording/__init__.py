"""Too few people and trials for a test: folds in time of one recording rank what explains it.

`windows` cuts a recording, `repeats` refuses what was there already, `folds` keeps them apart,
`ranking` fits and compares models; `result` holds what came of it, in words.
"""
