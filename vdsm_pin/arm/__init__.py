"""The snake arm: its description, kinematics, cables, bodies, and its URDF."""
