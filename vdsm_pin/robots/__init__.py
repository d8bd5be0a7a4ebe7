"""Any robot: URDF, scene and trajectory in, a proved verdict out (docs/robots.md)."""
