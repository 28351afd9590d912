"""A clip: keyframes, events and an idle layer; its weights over time, its frames, and a film."""

import sys
from pathlib import Path

import facegen

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")

# A smile that comes in half a second, with a blink and a glance on the way. docs/clips.md explains the keys;
# facegen.load_clip reads the same from a YAML file, such as greeting.yaml beside this program.
clip = facegen.load_clip({
    "keyframes": [{"t": 0.0, "pose": "neutral"}, {"t": 0.5, "pose": "happiness"}, {"t": 1.5, "pose": "happiness"}],
    "events": [{"at": 0.7, "kind": "blink"},
               {"at": 0.9, "eyes": {"yaw": 12}, "onset": 0.05, "apex": 0.3, "offset": 0.05}],
}, idle=7)
print("seconds, frames:", clip.duration, clip.frames(20))
print("weights at 0.25 s:", {code: round(weight, 2) for code, weight in clip.units_at(0.25).items()})

renderer = facegen.Renderer(facegen.load_face(), size=128, detail=1)
frames = [renderer.draw(pose) for pose in clip.sample(20)]
print(facegen.save_video(frames, folder / "clip.gif", fps=20))

chosen = range(0, len(frames), 3)
sheet = facegen.contact_sheet([frames[k] for k in chosen], [f"{k / 20:.2f} s" for k in chosen], columns=5)
print(facegen.save_image(sheet, folder / "frames.png"))
