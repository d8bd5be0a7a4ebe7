"""Judges a trajectory; never sees planner code."""
