"""A figure of a few hundred triangles as VRM 0, VRM 1 or glTF, by code of the tests' own."""

import itertools
import json
import struct
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SHAPES = ("jawOpen", "mouthPucker", "mouthUpperUp", "mouthLowerDown", "mouthStretchLeft",
          "mouthStretchRight", "mouthRollLower", "eyeBlinkLeft", "browInnerUp")  # fmt: skip
VISEMES = {"A": "a", "I": "i", "U": "u", "E": "e", "O": "o"}
FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
LENGTHS = {
    "Thumb": (34, 30, 26),
    "Index": (42, 26, 22),
    "Middle": (46, 29, 23),
    "Ring": (42, 27, 22),
    "Little": (34, 20, 19),
}


@dataclass
class Part:
    """Points, triangles, the bone of each point and its movement by each shape."""

    points: list[FloatArray] = field(default_factory=list)
    triangles: list[tuple[int, int, int]] = field(default_factory=list)
    bones: list[str] = field(default_factory=list)
    moves: dict[str, dict[int, FloatArray]] = field(default_factory=dict)

    def add(self, point: Any, bone: str) -> int:
        self.points.append(np.array(point, dtype=float))
        self.bones.append(bone)
        return len(self.points) - 1

    def tube(self, spots: list[tuple[Any, str]], radius: float, sides: int = 6) -> None:
        rows = []
        for at, bone in spots:
            way = np.array(spots[-1][0], float) - np.array(spots[0][0], float)
            one = np.cross(way, [0.3, 0.2, 1.0])
            one /= np.linalg.norm(one)
            two = np.cross(way, one) / np.linalg.norm(way)
            turns = 2 * np.pi * np.arange(sides) / sides
            rows.append(
                [
                    self.add(np.array(at) + radius * (np.cos(t) * one + np.sin(t) * two), bone)
                    for t in turns
                ]
            )
        for low, high in itertools.pairwise(rows):
            for k in range(sides):
                a, b, c, d = low[k], low[k - 1], high[k - 1], high[k]
                self.triangles += [(a, b, c), (a, c, d)]
        cap = self.add(spots[-1][0], spots[-1][1])
        self.triangles += [(rows[-1][k], rows[-1][k - 1], cap) for k in range(sides)]


def bones(down: float) -> dict[str, tuple[str | None, FloatArray]]:
    """Parent and place (mm) of every bone; the arms hang `down` by so many radians."""
    found: dict[str, tuple[str | None, FloatArray]] = {}

    def bone(name: str, parent: str | None, *at: float) -> None:
        found[name] = (parent, np.array(at, dtype=float))

    bone("hips", None, 0, 950, 0)
    bone("spine", "hips", 0, 1100, 0)
    bone("neck", "spine", 0, 1420, -10)
    bone("head", "neck", 0, 1500, 0)
    bone("leftEye", "head", 31, 1580, 62)
    bone("rightEye", "head", -31, 1580, 62)
    for side, x in (("left", 1.0), ("right", -1.0)):
        way = np.array([x * np.cos(down), -np.sin(down), 0.0])
        across = np.array([0.0, 0.0, 1.0])
        start = np.array([x * 165, 1380, -15])
        bone(f"{side}Shoulder", "spine", x * 25, 1385, 0)
        bone(f"{side}UpperArm", f"{side}Shoulder", *start)
        bone(f"{side}LowerArm", f"{side}UpperArm", *(start + 265 * way))
        hand = start + 500 * way
        bone(f"{side}Hand", f"{side}LowerArm", *hand)
        for k, finger in enumerate(FINGERS):
            parent = f"{side}Hand"
            at = hand + (88 * way + (24 - 18 * (k - 1)) * across if k else 26 * way + 26 * across)
            along = way if k else (0.6 * way + 0.8 * across)
            for n, length in enumerate(LENGTHS[finger]):
                bone(f"{side}{finger}{n}", parent, *at)
                parent, at = f"{side}{finger}{n}", at + length * along
            found[f"{side}{finger}Tip"] = (None, at)
    return found


def _face(part: Part) -> None:
    """An egg of a head whose mouth is a slit in its front."""
    columns = np.linspace(-72, 72, 19)
    rows = np.array([95, 70, 45, 25, 8, -8, -22, -34, -44, -52, -57, -57, -62, -70, -82, -95, -108])
    number: dict[tuple[int, int], int] = {}
    for j, y in enumerate(rows):
        for i, x in enumerate(columns):
            wide = x * np.sqrt(max(1 - (y / 125) ** 2, 0.05))
            depth = 95 * np.sqrt(max(1 - (wide / 76) ** 2 - (y / 122) ** 2, 0.02))
            nose = 14 * np.exp(-((x / 10) ** 2) - ((y + 20) / 14) ** 2)
            inside = abs(x) < 26
            if j == 11 and not inside:
                number[j, i] = number[10, i]
                continue
            n = part.add([wide, 1580 + y - 5, depth + nose], "head")
            number[j, i] = n
            lower = j >= 11 and (y < -57 or inside)
            lip = np.exp(-(((y + 57) / 10) ** 2)) * inside

            def move(name: str, *way: float, n: int = n) -> None:
                part.moves.setdefault(name, {})[n] = np.array(way, dtype=float)

            if lower:
                share = np.clip((62 - abs(x)) / 30, 0, 1)
                move("jawOpen", 0, -26 * share, -9 * share)
                move("mouthLowerDown", 0, -7 * lip, 0)
                move("mouthRollLower", 0, 3 * lip, -4 * lip)
            elif inside and y < -30:
                move("mouthUpperUp", 0, 6 * lip, 0)
            if abs(x) < 34 and abs(y + 57) < 14:
                move("mouthPucker", -0.38 * x * np.exp(-(((y + 57) / 10) ** 2)), 0, 7 * lip)
                for name, side in (("Left", 1), ("Right", -1)):
                    if side * x > 12:
                        move(f"mouthStretch{name}", side * 8.0, 0, -2)
            if y == 8 and x > 8:
                move("eyeBlinkLeft", 0, -6, 0)
            if y == 25 and abs(x) < 40:
                move("browInnerUp", 0, 5, 1)
    for j in range(len(rows) - 1):
        if j == 10:
            continue
        for i in range(len(columns) - 1):
            a, b, c, d = number[j, i], number[j, i + 1], number[j + 1, i + 1], number[j + 1, i]
            part.triangles += [(a, d, b), (b, d, c)]


def figure(
    kind: str = "arkit",
    *,
    unit: float = 0.001,
    turn: FloatArray | None = None,
    down: float = 0.0,
    without: tuple[str, ...] = (),
    material: dict[str, Any] | None = None,
    picture: bytes = b"",
) -> bytes:
    """Return a file.

    Parameters
    ----------
    kind : str
        ``arkit`` (Mixamo's names, ARKit's shapes), ``vrm0``, ``vrm1`` or ``visemes`` (VRM 0).
    unit : float
        Of the file, in millimetres to one.
    turn : ndarray, shape (3, 3), optional
        Axes of the file.
    down : float
        Angle of the arms below the horizontal, radians.
    without : tuple of str
        Bones that are left out.
    material : dict, optional
        Fields of its one material.
    picture : bytes
        Of that material, as a file; it lies on the figure from its left to its right.
    """
    skeleton = bones(down)
    place = {name: at for name, (_, at) in skeleton.items()}
    part = Part()
    _face(part)
    part.tube([((0, 1380, 0), "spine"), ((0, 1440, 5), "neck"), ((0, 1490, 10), "head")], 45, 10)
    part.tube([((0, y, -20), "spine") for y in (1000, 1150, 1300, 1370)], 130, 12)
    for side in ("left", "right"):
        eye = place[f"{side}Eye"]
        part.tube([(eye, f"{side}Eye"), (eye + np.array([0, 0, 9]), f"{side}Eye")], 10)
        arm = [place[f"{side}{b}"] for b in ("UpperArm", "LowerArm", "Hand")]
        names = [f"{side}UpperArm", f"{side}LowerArm", f"{side}Hand"]
        spots = [(arm[0], names[0]), (0.5 * (arm[0] + arm[1]), names[0]), (arm[1], names[1])]
        part.tube([*spots, (0.5 * (arm[1] + arm[2]), names[1]), (arm[2], names[1])], 34, 8)
        palm = 0.25 * sum(place[f"{side}{f}0"] for f in FINGERS[1:])
        part.tube([(arm[2], names[2]), (palm, names[2])], 30, 8)
        for finger in FINGERS:
            chain = [f"{side}{finger}{n}" for n in range(3)]
            spots = [(place[b], b) for b in chain]
            part.tube([*spots, (place[f"{side}{finger}Tip"], chain[2])], 8, 6)
    named = {name: parent_at for name, parent_at in skeleton.items() if not name.endswith("Tip")}
    return _file(
        part,
        {n: x for n, x in named.items() if n not in without},
        kind,
        (unit, turn),
        (material or {}, picture),
    )


def _file(
    part: Part,
    skeleton: dict[str, tuple[str | None, FloatArray]],
    kind: str,
    frame: tuple[float, FloatArray | None],
    look: tuple[dict[str, Any], bytes],
) -> bytes:
    unit, turn = frame
    axes = unit * (np.eye(3) if turn is None else turn)
    data, views, accessors = bytearray(), [], []

    def add(values: Any, code: int, form: str) -> int:
        array = np.ascontiguousarray(values, {5126: "<f4", 5123: "<u2", 5121: "u1"}[code])
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": code, "count": len(array), "type": form}
        )
        data.extend(array.tobytes() + bytes(-array.nbytes % 4))
        return len(accessors) - 1

    names = list(skeleton)
    joints = np.zeros((len(part.points), 4))
    joints[:, 0] = [names.index(b) if b in names else 0 for b in part.bones]
    weights = np.tile([1.0, 0, 0, 0], (len(joints), 1))
    shapes = {"aa": "jawOpen", "ou": "mouthPucker"} if kind == "visemes" else dict.fromkeys(SHAPES)
    targets = []
    for name, source in shapes.items():
        moved = np.zeros((len(joints), 3))
        for n, way in part.moves[source or name].items():
            moved[n] = axes @ way
        targets.append({"POSITION": add(moved, 5126, "VEC3")})
    points = np.array(part.points) @ axes.T
    attributes = {
        "POSITION": add(points, 5126, "VEC3"),
        "JOINTS_0": add(joints, 5121, "VEC4"),
        "WEIGHTS_0": add(weights, 5126, "VEC4"),
    }
    if look[1]:
        flat = np.array(part.points)
        places = np.stack([flat[:, 0] / 160 + 0.5, 0.5 + 0 * flat[:, 0]], axis=1)
        attributes["TEXCOORD_0"] = add(places, 5126, "VEC2")
    mesh: dict[str, Any] = {"primitives": [{
        "attributes": attributes, "targets": targets, "material": 0,
        "indices": add(np.array(part.triangles).reshape(-1, 1), 5123, "SCALAR"),
    }]}  # fmt: skip
    bind = np.tile(np.eye(4), (len(names), 1, 1))
    bind[:, :3, 3] = [-axes @ skeleton[name][1] for name in names]
    nodes: list[dict[str, Any]] = []
    for name in names:
        parent, at = skeleton[name]
        above = skeleton[parent][1] if parent in skeleton else np.zeros(3)
        node: dict[str, Any] = {"translation": (axes @ (at - above)).tolist()}
        node["name"] = _mixamo(name) if kind == "arkit" else f"bone {name}"
        children = [names.index(c) for c in names if skeleton[c][0] == name]
        nodes.append(node | ({"children": children} if children else {}))
    nodes.append({"mesh": 0, "skin": 0, "name": "body"})
    roots = [i for i, name in enumerate(names) if skeleton[name][0] not in skeleton]
    binds = add(bind.transpose(0, 2, 1).reshape(-1, 16), 5126, "MAT4")
    colour: dict[str, Any] = {"baseColorFactor": [0.7, 0.4, 0.3, 1]}
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "nodes": nodes,
        "meshes": [mesh],
        "scenes": [{"nodes": [*roots, len(nodes) - 1]}],
        "accessors": accessors,
        "skins": [{"joints": list(range(len(names))), "inverseBindMatrices": binds}],
        "materials": [{"pbrMetallicRoughness": colour, **look[0]}],
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    if look[1]:
        colour["baseColorTexture"] = {"index": 0}
        document |= {"textures": [{"source": 0}], "images": [{"bufferView": len(views)}]}
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(look[1])})
        data.extend(look[1] + bytes(-len(look[1]) % 4))
        document["buffers"] = [{"byteLength": len(data)}]
    if kind == "arkit":
        mesh["extras"] = {"targetNames": list(shapes)}
    else:
        document["extensions"] = _vrm(kind, names, list(shapes))
    return container(document, bytes(data))


def container(document: dict[str, Any], data: bytes) -> bytes:
    """Return a binary glTF file."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(data), b"BIN\0"),
            data,
        ]
    )


def _mixamo(name: str) -> str:
    for side in ("left", "right"):
        if name.startswith(side) and not name.endswith("Eye"):
            rest = name.removeprefix(side)
            for finger in FINGERS:
                if rest.startswith(finger):
                    other = "Pinky" if finger == "Little" else finger
                    return f"mixamorig:{side.title()}Hand{other}{int(rest[-1]) + 1}"
            other = {"UpperArm": "Arm", "LowerArm": "ForeArm"}.get(rest, rest)
            return f"mixamorig:{side.title()}{other}"
    return f"mixamorig:{name[:1].upper()}{name[1:]}"


def _vrm(kind: str, names: list[str], shapes: list[str]) -> dict[str, Any]:
    numbers = {}
    for i, name in enumerate(names):
        parts = ["Proximal", "Intermediate", "Distal"]
        if kind == "vrm1" and "Thumb" in name:
            parts = ["Metacarpal", "Proximal", "Distal"]
        numbers[name[:-1] + parts[int(name[-1])] if name[-1].isdigit() else name] = i
    if kind == "vrm1":
        custom = {
            name: {"morphTargetBinds": [{"node": len(names), "index": i, "weight": 1.0}]}
            for i, name in enumerate(shapes)
        }
        human = {name: {"node": i} for name, i in numbers.items()}
        meta = {
            "name": "Egg",
            "authors": ["A. Test", "B"],
            "licenseUrl": "https://vrm.dev/licenses/1.0/",
        }
        return {
            "VRMC_vrm": {
                "specVersion": "1.0",
                "meta": meta,
                "humanoid": {"humanBones": human},
                "expressions": {"preset": {}, "custom": custom},
            }
        }
    presets = {"aa": "a", "ou": "u"}
    groups = [
        {
            "name": name.title() if name in presets else name[:1].upper() + name[1:],
            "presetName": presets.get(name, "unknown"),
            "binds": [{"mesh": 0, "index": i, "weight": 100}],
        }
        for i, name in enumerate(shapes)
    ]
    return {
        "VRM": {
            "humanoid": {"humanBones": [{"bone": n, "node": i} for n, i in numbers.items()]},
            "blendShapeMaster": {"blendShapeGroups": groups},
        }
    }
