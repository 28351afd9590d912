"""Blender's view of a GLB as JSON. Run by a Python with bpy.

Usage: python blender_look.py file.glb: shape keys by object, with their motion in the world.
       python blender_look.py file.glb seconds ...: at each of these times, the values of the shape keys and the places
       of the vertices in the world, as the file's animation has them.
"""

from __future__ import annotations

import json
import sys

import bpy


def shape_keys(one):
    """Return an object's rest and the motion of each shape key."""
    blocks = one.data.shape_keys.key_blocks
    turn = one.matrix_world.to_3x3()
    rest = [turn @ point.co for point in blocks[0].data]
    return {"rest": [list(one.matrix_world @ point.co) for point in blocks[0].data],
            "keys": {key.name: [list(turn @ point.co - old) for point, old in zip(key.data, rest, strict=True)]
                     for key in blocks[1:]}}


def moment(one, graph):
    """Return an object's shape key values and the places of its vertices now."""
    shown = one.evaluated_get(graph)
    return {"values": {key.name: key.value for key in one.data.shape_keys.key_blocks[1:]},
            "places": [list(shown.matrix_world @ vertex.co) for vertex in shown.data.vertices]}


bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
bpy.context.view_layer.update()
morphing = [one for one in bpy.data.objects if one.type == "MESH" and one.data.shape_keys is not None]
if len(sys.argv) == 2:
    found = {one.name: shape_keys(one) for one in morphing}
else:
    found, scene = [], bpy.context.scene
    for seconds in map(float, sys.argv[2:]):
        frame = seconds * scene.render.fps / scene.render.fps_base
        scene.frame_set(int(frame), subframe=frame - int(frame))
        graph = bpy.context.evaluated_depsgraph_get()
        found.append({one.name: moment(one, graph) for one in morphing})
print("FOUND " + json.dumps(found))
