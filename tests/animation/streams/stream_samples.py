"""Small recordings of our own, in the form that each program documents."""

from __future__ import annotations

import json

OPENFACE = """\
frame, face_id, timestamp, confidence, success, gaze_0_x, gaze_0_y, gaze_0_z, gaze_1_x, gaze_1_y, gaze_1_z, \
gaze_angle_x, gaze_angle_y, pose_Tx, pose_Ty, pose_Tz, pose_Rx, pose_Ry, pose_Rz, x_0, X_0, \
AU01_r, AU04_r, AU06_r, AU12_r, AU45_r, AU01_c, AU12_c, AU28_c
1, 0, 0.000, 0.98, 1, 0.100, 0.050, -0.994, -0.120, 0.050, -0.992, -0.010, 0.050, 12.5, -30.1, 580.2, \
0.10, -0.05, 0.02, 301.5, -40.25, 0.00, 1.00, 2.50, 4.00, 0.00, 0, 1, 0
2, 0, 0.040, 0.98, 1, 0.105, 0.050, -0.993, -0.118, 0.050, -0.992, -0.007, 0.050, 12.6, -30.0, 580.4, \
0.11, -0.06, 0.02, 301.6, -40.50, 0.31, 0.90, 3.00, 5.00, 0.25, 0, 1, 1
3, 0, 0.080, 0.12, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.10, 0.20, 0.30, 0.40, 0.00, 0, 0, 0
4, 0, 0.200, 0.95, 1, 0.110, 0.051, -0.993, -0.115, 0.051, -0.992, -0.003, 0.051, 12.7, -29.9, 580.1, \
0.12, -0.07, 0.03, 301.7, -40.75, 0.50, 0.80, 2.00, 3.00, 1.50, 1, 1, 0
"""

PYFEAT = """\
frame,FaceRectX,FaceScore,x_0,AU01,AU02,AU04,AU05,AU06,AU07,AU09,AU10,AU11,AU12,AU14,AU15,AU17,AU20,AU23,AU24,AU25,\
AU26,AU28,AU43,Pitch,Roll,Yaw,X,Y,Z,happiness,input
0,196.9,0.99,192.8,0.5,0,0,0,0.25,0,0,0,0,0.75,0,0,0,0,0,0,0.9,0,0,0.1,0.1,-0.2,0.3,1,2,3,0.9,video.mp4
1,196.8,0.99,192.9,0.6,0,0,0,0.25,0,0,0,0,0.80,0,0,0,0,0,0,0.8,0,0,0.0,0.1,-0.2,0.3,1,2,3,0.9,video.mp4
3,196.7,0.99,193.0,0.7,0,0,0,0.25,0,0,0,0,0.85,0,0,0,0,0,0,0.7,0,0,0.0,0.1,-0.2,0.3,1,2,3,0.9,video.mp4
"""

LIBREFACE = """\
,frame_idx,frame_time_in_ms,lm_mp_0_x,pitch,yaw,roll,au_1,au_2,au_4,au_6,au_7,au_12,au_1_intensity,au_2_intensity,\
au_4_intensity,au_5_intensity,au_6_intensity,au_9_intensity,au_12_intensity,au_15_intensity,au_17_intensity,\
au_20_intensity,au_25_intensity,au_26_intensity,facial_expression
0,0,0.0,0.51,3.5,-10.25,1.5,0,0,1,0,1,1,0.1,0.0,1.0,0.0,2.0,0.0,4.0,0.0,0.0,0.0,0.5,0.0,Happiness
1,1,33.333,0.52,3.6,-10.5,1.25,0,0,1,0,0,1,0.2,0.0,1.0,0.0,2.0,0.0,5.0,0.0,0.0,0.0,0.5,0.0,Happiness
2,2,66.667,0.53,3.7,-10.75,1.0,0,0,1,0,0,1,0.3,0.0,1.0,0.0,2.0,0.0,3.0,0.0,0.0,0.0,0.5,0.0,Neutral
"""

SHAPES = (
    "EyeBlinkLeft,EyeLookDownLeft,EyeLookInLeft,EyeLookOutLeft,EyeLookUpLeft,EyeSquintLeft,EyeWideLeft,EyeBlinkRight,"
    "EyeLookDownRight,EyeLookInRight,EyeLookOutRight,EyeLookUpRight,EyeSquintRight,EyeWideRight,JawForward,JawRight,"
    "JawLeft,JawOpen,MouthClose,MouthFunnel,MouthPucker,MouthRight,MouthLeft,MouthSmileLeft,MouthSmileRight,"
    "MouthFrownLeft,MouthFrownRight,MouthDimpleLeft,MouthDimpleRight,MouthStretchLeft,MouthStretchRight,MouthRollLower,"
    "MouthRollUpper,MouthShrugLower,MouthShrugUpper,MouthPressLeft,MouthPressRight,MouthLowerDownLeft,"
    "MouthLowerDownRight,MouthUpperUpLeft,MouthUpperUpRight,BrowDownLeft,BrowDownRight,BrowInnerUp,BrowOuterUpLeft,"
    "BrowOuterUpRight,CheekPuff,CheekSquintLeft,CheekSquintRight,NoseSneerLeft,NoseSneerRight,TongueOut").split(",")
TURNS = ("HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw,LeftEyePitch,LeftEyeRoll,RightEyeYaw,RightEyePitch,RightEyeRoll"
         ).split(",")


def livelink(count: int = 90, *, start: float = 58.723, step: float = 1.001, empty: tuple[int, ...] = ()) -> str:
    """Return a recording at 60 frames a second that begins at 18:43:58, over the turn of a minute."""
    rows = [",".join(["Timecode", "BlendShapeCount", *SHAPES, *TURNS])]
    for k in range(count):
        frame = 58 * 60 + start + k * step
        second, part = divmod(round(frame * 1000), 60_000)
        code = f"18:{43 + second // 60:02d}:{second % 60:02d}:{part // 1000:02d}.{part % 1000:03d}"
        if k in empty:
            rows.append(f"{code},0")
            continue
        values = [((k * 7 + i * 13) % 97) / 100 for i in range(len(SHAPES))]
        turns = [0.001 * ((k + 3 * i) % 50) - 0.02 for i in range(len(TURNS))]
        rows.append(",".join([code, "61", *(f"{value:.10f}" for value in (*values, *turns))]))
    return "\n".join(rows) + "\n"


def mediapipe_frame(k: int, *, jaw: float = 0.25, keys: str = "js") -> dict:
    """Return one result, as the JavaScript ("js") or the Python ("py") task gives it."""
    score = {"_neutral": 1e-6, "browDownLeft": 0.1, "jawOpen": jaw, "mouthSmileLeft": 0.5 + 0.01 * k}
    if keys == "py":
        return {"timestamp_ms": 40 * k, "face_blendshapes": [[
            {"index": i, "score": value, "display_name": "", "category_name": name}
            for i, (name, value) in enumerate(score.items())]]}
    return {"timestampMs": 40 * k, "faceBlendshapes": [{"headIndex": -1, "headName": "", "categories": [
        {"index": i, "score": value, "categoryName": name, "displayName": ""}
        for i, (name, value) in enumerate(score.items())]}]}


MEDIAPIPE = json.dumps({"frames": [mediapipe_frame(k) for k in range(3)]})

MEDIAPIPE_CSV = """\
frame,timestamp_ms,_neutral,browDownLeft,browDownRight,jawOpen,mouthSmileLeft,mouthSmileRight
0,0,0.000002,0.1,0.1,0.25,0.5,0.5
1,40,0.000002,0.1,0.1,0.3,0.6,0.5
2,80,0.000002,,,,,
"""

UNITS_CSV = """\
time,AU01,AU12_L,AU12_R,AU26,head_yaw,head_pitch,head_roll
0,0.1,0.5,0.25,0.0,10,5,-2
0.04,0.2,0.5,0.25,0.3,11,5,-2
"""

ARKIT_CSV = """\
Time, JawOpen ,eyeBlink_L,EyeBlinkRight,gaze_yaw_L,gaze_pitch_L,gaze_yaw_R,gaze_pitch_R,take
0,0.1,0.5,0.25,1,2,3,4,a
0.04,0.2,0.5,0.25,1,2,3,4,b
"""

FILES = {"openface": ("of.csv", OPENFACE), "pyfeat": ("pf.csv", PYFEAT), "libreface": ("lf.csv", LIBREFACE),
         "livelink": ("ll.csv", livelink(empty=(40,))), "mediapipe": ("mp.json", MEDIAPIPE),
         "mediapipe-csv": ("mp.csv", MEDIAPIPE_CSV), "csv": ("own.csv", ARKIT_CSV)}
"""format -> name and content of a file."""
