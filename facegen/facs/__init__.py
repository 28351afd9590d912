"""FACS: expression names, action units, raw deformation data, and the tables between them."""
