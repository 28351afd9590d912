"""Where landmarks probably lie on a mesh: proposals for a person to look at, with a confidence each."""
