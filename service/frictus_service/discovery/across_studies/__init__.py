"""What holds in all studies and what differs between them: a two-stage meta-analysis.

Each study is reduced to whitened signatures and readings of its people (`study_statistics`),
one study in memory at a time (`study_work`); causes are chosen for all studies together
(`common_causes`), every study is fitted again about the same causes, and each size is pooled
with a random effect of the study (`meta_analysis`, `verdicts`).
"""
