"""Blender's view of a GLB as JSON: shape keys by object, with their motion in the world. Run by a Python with bpy.

Usage: python blender_look.py file.glb
"""

from __future__ import annotations

import json
import sys

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
bpy.context.view_layer.update()
found = {}
for one in bpy.data.objects:
    if one.type != "MESH" or one.data.shape_keys is None:
        continue
    blocks = one.data.shape_keys.key_blocks
    turn = one.matrix_world.to_3x3()
    rest = [turn @ point.co for point in blocks[0].data]
    found[one.name] = {
        "rest": [list(one.matrix_world @ point.co) for point in blocks[0].data],
        "keys": {key.name: [list(turn @ point.co - old) for point, old in zip(key.data, rest, strict=True)]
                 for key in blocks[1:]}}
print("FOUND " + json.dumps(found))
