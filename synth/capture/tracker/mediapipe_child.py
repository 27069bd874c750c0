"""The other side of `video`: frames in, landmarks out, under another interpreter.

MediaPipe needs older libraries than Cuecast and lives in an environment of its own; this file runs
there, as a script, and imports nothing of ours. Standard input: a line with width and height, then
for each frame a line with its time in seconds and the pixels, RGB. Standard output: rows of time,
part, index, x, y and z.
"""

import sys
from typing import Any, BinaryIO, TextIO


def main(frames: BinaryIO, rows: TextIO) -> None:
    """Track face and hands in all frames."""
    import mediapipe
    import numpy as np

    width, height = map(int, frames.readline().split())
    face = mediapipe.solutions.face_mesh.FaceMesh(max_num_faces=1)
    hands = mediapipe.solutions.hands.Hands(
        max_num_hands=2, min_detection_confidence=0.4, min_tracking_confidence=0.4
    )
    rows.write("time,part,index,x,y,z\n")
    while line := frames.readline():
        pixels = np.frombuffer(frames.read(3 * width * height), dtype=np.uint8)
        picture = pixels.reshape(height, width, 3)
        time_s = line.decode().strip()
        rows.write(f"{time_s},frame,0,,,\n")
        for found in face.process(picture).multi_face_landmarks or ():
            _write(rows, time_s, "face", found.landmark)
        found = hands.process(picture)
        named = zip(found.multi_hand_landmarks or (), found.multi_handedness or (), strict=True)
        best: dict[str, Any] = {}
        for hand, names in named:
            # The tracker thinks of mirror images: what it calls left is the person's right.
            label = names.classification[0]
            part = "right_hand" if label.label == "Left" else "left_hand"
            if part not in best or label.score > best[part][0]:
                best[part] = label.score, hand
        for part, (_, hand) in best.items():
            _write(rows, time_s, part, hand.landmark)
        rows.flush()


def _write(rows: TextIO, time_s: str, part: str, landmarks: Any) -> None:
    for index, point in enumerate(landmarks):
        rows.write(f"{time_s},{part},{index},{point.x:.6f},{point.y:.6f},{point.z:.6f}\n")


if __name__ == "__main__":
    main(sys.stdin.buffer, sys.stdout)
