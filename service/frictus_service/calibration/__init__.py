"""Measuring one person's finger on one rig, by the paper's protocol or by a quick one."""
