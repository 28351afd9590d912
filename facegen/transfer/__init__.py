"""A template's expressions on anybody's avatar: registration, deformation transfer, landmarks, pieces."""
