"""Experiments as jobs: what is asked, how one is carried out for a page, what its log says."""
