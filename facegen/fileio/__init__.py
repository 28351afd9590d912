"""Other people's file formats, the order of their contents kept."""
