"""Weights and pose out of what was measured: meshes, markers, landmarks in pictures (Onizuka 2018, eq. 1)."""
