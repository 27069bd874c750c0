"""Names of bones and face shapes in files of others: VRM 0 and 1, Mixamo, ARKit.

A `Container` comes in. Out go the node of each bone, named as in VRM 1.0's humanoid, and for each
face shape the morph targets that make it. VRM 0: VRM consortium, VRM.humanoid and
VRM.blendShapeMaster; VRM 1: VRMC_vrm 1.0, humanoid and expressions.
"""

import re
from typing import Any

from codec.errors import CueError
from receiver.drawing.units import ARKIT_NAMES
from receiver.foreign.container import Container

FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")

_SIDES = ("left", "right")

FINGER_BONES = {
    finger: ("Metacarpal", "Proximal", "Distal")
    if finger == "Thumb"
    else ("Proximal", "Intermediate", "Distal")
    for finger in FINGERS
}
"""Bones of each finger, from the palm."""

RIGHT_FINGERS = tuple(f"right{f}{part}" for f in FINGERS for part in FINGER_BONES[f])

NEEDED = (
    "hips", "head", "rightUpperArm", "rightLowerArm", "rightHand", *RIGHT_FINGERS,
    "leftUpperArm", "leftLowerArm",
)  # fmt: skip
"""Bones without which nobody can cue."""

_OTHER_NAMES = {
    "hips": "hips pelvis", "spine": "spine", "chest": "spine1 chest", "neck": "neck neck1",
    "upperChest": "spine2 upperchest", "head": "head", "jaw": "jaw", "leftEye": "lefteye eyeleft",
    "rightEye": "righteye eyeright",
}  # fmt: skip
"""Names of other rigs, small letters and digits only."""

VISEMES = ("aa", "ih", "ou", "ee", "oh")
"""Mouth shapes of VRM: too few to read speech from."""

_VRM0_PRESETS = {
    "a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh", "blink": "blink",
    "blink_l": "eyeBlinkLeft", "blink_r": "eyeBlinkRight",
}  # fmt: skip
_VRM1_PRESETS = {"blinkLeft": "eyeBlinkLeft", "blinkRight": "eyeBlinkRight"}

_MOST_LETTERS = 120
"""Letters of one statement about a licence at most."""

_MOST_BINDS = 64
"""Morph targets of one face shape at most."""

Binds = list[tuple[int, int, float]]
"""Morph targets of a face shape: mesh, target, weight."""


def _plain(name: Any) -> str:
    text = re.sub(r"[^a-z0-9]", "", str(name).lower().rsplit(":", 1)[-1])
    return re.sub(r"^mixamorig\d*", "", text)


def _rig_names() -> dict[str, str]:
    """Return the bone for each plain name of Mixamo's and similar rigs."""
    found = {name: bone for bone, names in _OTHER_NAMES.items() for name in names.split()}
    for side in _SIDES:
        found |= {f"{side}shoulder": f"{side}Shoulder", f"{side}clavicle": f"{side}Shoulder"}
        found |= {f"{side}arm": f"{side}UpperArm", f"{side}upperarm": f"{side}UpperArm"}
        found |= {f"{side}forearm": f"{side}LowerArm", f"{side}lowerarm": f"{side}LowerArm"}
        found[f"{side}hand"] = f"{side}Hand"
        for finger, parts in FINGER_BONES.items():
            for number, part in enumerate(parts, start=1):
                bone = f"{side}{finger}{part}"
                found[bone.lower()] = bone
                for other in {finger.lower(), "pinky" if finger == "Little" else finger.lower()}:
                    found[f"{side}hand{other}{number}"] = bone
    return found


def bones(file: Container) -> dict[str, int]:
    """Return the number of the node of every known bone.

    Raises
    ------
    CueError
        If one of `NEEDED` is missing: the first five are named.
    """
    extensions = file.document.get("extensions", {})
    extensions = extensions if isinstance(extensions, dict) else {}
    found: dict[str, int] = {}
    try:
        if "VRMC_vrm" in extensions:
            human = extensions["VRMC_vrm"]["humanoid"]["humanBones"]
            found = {name: bone["node"] for name, bone in human.items()}
        elif "VRM" in extensions:
            human = extensions["VRM"]["humanoid"]["humanBones"]
            found = {_vrm1_name(bone["bone"]): bone["node"] for bone in human}
    except (KeyError, TypeError, AttributeError) as error:
        raise CueError(f"{file.name}: its list of bones is damaged: {error!r}") from error
    # Neither VRM 1 nor VRM 0: know the bones by their names in common rigs.
    if not found:
        known = _rig_names()
        for number, node in enumerate(file.items("nodes")):
            bone = known.get(_plain(node.get("name", "")))
            if bone is not None:
                found.setdefault(bone, number)
    for number in found.values():
        file.item("nodes", number)
    missing = [name for name in NEEDED if name not in found]
    if missing:
        more = "" if len(missing) <= 5 else f" and {len(missing) - 5} more"
        names = ", ".join(missing[:5])
        raise CueError(f"{file.name}: has no bone {names}{more}: a cuer needs arms and fingers")
    return found


def terms(file: Container) -> str:
    """Return whose figure it is and under what licence, as a VRM says; an empty text without."""
    extensions = file.document.get("extensions")
    extensions = extensions if isinstance(extensions, dict) else {}
    found = []
    for name in ("VRMC_vrm", "VRM"):
        vrm = extensions.get(name)
        meta = vrm.get("meta") if isinstance(vrm, dict) else None
        if isinstance(meta, dict):
            authors = meta.get("authors", meta.get("author", ""))
            by = ", ".join(map(str, authors)) if isinstance(authors, list) else str(authors)
            licence = meta.get("licenseUrl") or meta.get("otherLicenseUrl") or ""
            found += [meta.get("name", meta.get("title", "")), by, meta.get("licenseName"), licence]
    return "; ".join(re.sub(r"\s+", " ", str(x))[:_MOST_LETTERS] for x in found if x)


def _vrm1_name(name: str) -> str:
    """Return a bone's name of VRM 0 as in VRM 1: the thumb's bones moved up by one."""
    if "Thumb" not in name:
        return name
    return name.replace("Proximal", "Metacarpal").replace("Intermediate", "Proximal")


def face_shapes(file: Container) -> dict[str, Binds]:
    """Return the morph targets of every face shape, under ARKit's names or VRM's visemes."""
    found = _target_names(file)
    extensions = file.document.get("extensions", {})
    try:
        # VRM 1 binds by node and weights of 0 to 1, VRM 0 by mesh and percent.
        if "VRMC_vrm" in extensions:
            expressions = extensions["VRMC_vrm"].get("expressions", {})
            for kind in ("preset", "custom"):
                for name, expression in expressions.get(kind, {}).items():
                    binds = [
                        (_mesh_of(file, bind["node"]), bind["index"], float(bind["weight"]))
                        for bind in expression.get("morphTargetBinds", [])
                    ]
                    _add(found, _VRM1_PRESETS.get(name, _arkit_case(name)), binds)
        elif "VRM" in extensions:
            master = extensions["VRM"].get("blendShapeMaster", {})
            for group in master.get("blendShapeGroups", []):
                preset = group.get("presetName", "unknown")
                name = _VRM0_PRESETS.get(preset, _arkit_case(str(group.get("name", ""))))
                binds = [
                    (bind["mesh"], bind["index"], bind["weight"] / 100)
                    for bind in group.get("binds", [])
                ]
                _add(found, name, binds)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise CueError(f"{file.name}: its face shapes are damaged: {error!r}") from error
    kept = {*ARKIT_NAMES, *VISEMES, "blink"}
    return {name: binds[:_MOST_BINDS] for name, binds in found.items() if name in kept}


def _add(found: dict[str, Binds], name: str, binds: Binds) -> None:
    if binds:
        found.setdefault(name, binds)


def _mesh_of(file: Container, node: Any) -> int:
    return int(file.item("nodes", node)["mesh"])


def _target_names(file: Container) -> dict[str, Binds]:
    """Return the morph targets by the names that meshes give them."""
    found: dict[str, Binds] = {}
    for number, mesh in enumerate(file.items("meshes")):
        extras = mesh.get("extras")
        names = extras.get("targetNames") if isinstance(extras, dict) else None
        if names is None:
            primitives = mesh.get("primitives")
            first = primitives[0] if isinstance(primitives, list) and primitives else {}
            extras = first.get("extras") if isinstance(first, dict) else None
            names = extras.get("targetNames") if isinstance(extras, dict) else None
        for index, name in enumerate(names if isinstance(names, list) else []):
            found.setdefault(_arkit_case(str(name)), []).append((number, index, 1.0))
    return found


def _arkit_case(name: str) -> str:
    """Return ARKit's spelling of a shape: ``JawOpen``, ``Face.M_F00_jawOpen``, ``browDown_L``.

    Examples
    --------
    >>> _arkit_case("JawOpen"), _arkit_case("browDown_L"), _arkit_case("blendShape1.mouthSmileLeft")
    ('jawOpen', 'browDownLeft', 'mouthSmileLeft')
    """
    name = re.split(r"[.:]", name)[-1]
    name = re.sub(r"_L$", "Left", re.sub(r"_R$", "Right", name))
    return name[:1].lower() + name[1:]
