"""Poses over time: clips of keyframes and events, idle motion, sampled at any rate."""
