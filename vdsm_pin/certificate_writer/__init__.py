"""Writes the proof of a motion down, of an arm or any other robot, for the checker."""
