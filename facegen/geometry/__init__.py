"""Meshes and what can be computed from them alone."""
