"""A parametric face made out of a head's mesh."""
