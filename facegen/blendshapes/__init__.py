"""Named shapes: the vocabularies of faces (action units, ARKit, visemes, VRM), what each shape is made of, and names."""
