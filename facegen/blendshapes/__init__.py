"""Named shapes: the vocabularies of faces (units, ARKit, visemes, VRM), what each shape is made of, their names."""
