"""Closed-form geometry: no robot, no obstacle names, no robotics library."""
