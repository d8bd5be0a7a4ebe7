"""Mesh files, one format a module; `io/mesh_file.py` is the way in."""
