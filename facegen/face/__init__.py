"""Parametric faces: a cage moved by feature points, its smooth surface, and the parts that ride on it."""
