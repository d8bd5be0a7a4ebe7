"""Closed-form geometry: solids with their names, no robot, no robotics library."""
