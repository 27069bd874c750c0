"""A file's meshes as one: vertices in the pose of rest, bones, face shapes, corners of triangles.

A `Container` comes in, a `Scene` goes out: skins are applied, nodes placed, axes turned so that x
is the figure's left, y up and z ahead, whatever the file's axes and unit are. Vertices that lie and
move together are one. Khronos, glTF 2.0 specification, sections 3.5 and 3.7.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.spatial.transform import Rotation

from codec.errors import CueError
from receiver.foreign.container import Container
from receiver.foreign.names import Binds, bones, face_shapes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_MAX_VERTICES, _MAX_NODES = 1 << 17, 4096
"""Vertices and nodes of a file at most: about three times those of large figures."""

_SKIP = 0.02
"""Shares of joints below this are left out."""


@dataclass(frozen=True, slots=True)
class Scene:
    """A figure at rest.

    Attributes
    ----------
    name : str
        Of the file.
    points : ndarray, shape (V, 3)
        In the file's unit; x to the figure's left, y up, z ahead.
    joints : ndarray, shape (N, 3)
        Places of the nodes.
    bones : dict of str to int
        Node of each bone, named as in VRM 1.
    weights : dict of str to ndarray, shape (V,)
        Share of every bone: nodes that are no bone count to the bone that carries them.
    shapes : dict of str to ndarray, shape (V, 3)
        Displacement by each face shape.
    triangles : ndarray of int, shape (F, 3)
    uv : ndarray, shape (F, 3, 2)
        Place in the picture of each corner.
    tints : ndarray, shape (F, 3, 4)
        Linear red, green, blue and opacity of each corner, without the picture.
    materials : ndarray of int, shape (F,)
        Number of the material, -1 without one.
    """

    name: str
    points: FloatArray
    joints: FloatArray
    bones: dict[str, int]
    weights: dict[str, FloatArray]
    shapes: dict[str, FloatArray]
    triangles: IntArray
    uv: FloatArray
    tints: FloatArray
    materials: IntArray

    def place(self, bone: str) -> FloatArray:
        """Return the place (3,) of a bone's joint."""
        return np.asarray(self.joints[self.bones[bone]])

    def share(self, *names: str) -> FloatArray:
        """Return the share (V,) of some bones together."""
        found = [self.weights[name] for name in names if name in self.weights]
        return np.asarray(np.sum(found, axis=0) if found else np.zeros(len(self.points)))


@dataclass(slots=True)
class _Collected:
    """Arrays of the primitives read so far."""

    points: list[FloatArray] = field(default_factory=list)
    weights: list[csr_matrix] = field(default_factory=list)
    shapes: dict[str, list[tuple[int, FloatArray]]] = field(default_factory=dict)
    triangles: list[IntArray] = field(default_factory=list)
    uv: list[FloatArray] = field(default_factory=list)
    tints: list[FloatArray] = field(default_factory=list)
    materials: list[IntArray] = field(default_factory=list)
    count: int = 0


def read_scene(file: Container) -> Scene:
    """Read the meshes of the scene.

    Raises
    ------
    CueError
        If a bone is missing, there is no mesh, it is too large, or the file contradicts itself.
    """
    named, shapes = bones(file), face_shapes(file)
    world, parents = _world(file)
    made = _Collected()
    for number, node in enumerate(file.items("nodes")):
        if "mesh" in node and parents[number] != -2:
            _read_node(file, number, node, world, shapes, made)
    if made.count == 0:
        raise CueError(f"{file.name}: holds no mesh")
    carriers = _carriers(parents, named)
    points, joints = np.concatenate(made.points), world[:, :3, 3]
    turn = _turn(file.name, joints, named)
    count = len(points)
    moved = {}
    for name, parts in made.shapes.items():
        moved[name] = np.zeros((count, 3))
        for start, deltas in parts:
            moved[name][start : start + len(deltas)] += deltas @ turn.T
    # A bone's share is the sum of all joints that it carries, such as twist bones.
    every = _stacked(made.weights)
    weights = {}
    for bone in named:
        columns = np.flatnonzero(carriers == named[bone])
        share = np.asarray(every[:, columns].sum(axis=1)).ravel()
        if share.any():
            weights[bone] = share
    triangles = np.concatenate(made.triangles)
    keep, renumbered = _weld(points @ turn.T, weights, moved)
    return Scene(
        file.name,
        points[keep] @ turn.T,
        joints @ turn.T,
        named,
        {bone: share[keep] for bone, share in weights.items()},
        {name: deltas[keep] for name, deltas in moved.items()},
        renumbered[triangles],
        np.concatenate(made.uv),
        np.concatenate(made.tints),
        np.concatenate(made.materials),
    )


def _world(file: Container) -> tuple[FloatArray, IntArray]:
    """Return matrices (N, 4, 4) of the nodes, and parents: -1 at the root, -2 outside the scene."""
    nodes = file.items("nodes")
    if len(nodes) > _MAX_NODES:
        raise CueError(f"{file.name}: {len(nodes)} nodes, {_MAX_NODES} at most")
    world = np.tile(np.eye(4), (len(nodes), 1, 1))
    parents = np.full(len(nodes), -2)
    scenes = file.items("scenes")
    scene = file.item("scenes", file.document.get("scene", 0)) if scenes else {}
    roots = scene.get("nodes", list(range(len(nodes))) if not scenes else [])
    waiting = [(root, -1) for root in roots] if isinstance(roots, list) else []
    # Depth first from the scene's roots; a node with two parents would hang twice.
    while waiting:
        number, parent = waiting.pop()
        node = file.item("nodes", number)
        if parents[number] != -2:
            raise CueError(f"{file.name}: node {number} hangs from two others")
        parents[number] = parent
        own = _local(file, node)
        world[number] = own if parent < 0 else world[parent] @ own
        children = node.get("children", [])
        waiting += [(child, number) for child in children] if isinstance(children, list) else []
    if not np.isfinite(world).all():
        raise CueError(f"{file.name}: nodes lie beyond all numbers")
    return world, parents


def _local(file: Container, node: dict[str, Any]) -> FloatArray:
    try:
        if "matrix" in node:
            return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
        own = np.eye(4)
        turn = Rotation.from_quat(node.get("rotation", [0, 0, 0, 1])).as_matrix()
        own[:3, :3] = turn * np.array(node.get("scale", [1, 1, 1]), dtype=np.float64).reshape(3)
        own[:3, 3] = np.array(node.get("translation", [0, 0, 0]), dtype=np.float64).reshape(3)
    except (ValueError, TypeError) as error:
        raise CueError(f"{file.name}: a node's transform is damaged: {error}") from error
    return own


def _carriers(parents: IntArray, named: dict[str, int]) -> IntArray:
    """Return for each node the bone's node that carries it: itself, or the nearest above it."""
    own = set(named.values())
    found = np.full(len(parents), named["hips"])
    for number in range(len(parents)):
        above = number
        while above >= 0 and above not in own:
            above = int(parents[above])
        if above >= 0:
            found[number] = above
    return found


def _turn(name: str, joints: FloatArray, named: dict[str, int]) -> FloatArray:
    """Return the rotation (3, 3) into x left, y up, z ahead."""
    up = joints[named["head"]] - joints[named["hips"]]
    left = joints[named["leftUpperArm"]] - joints[named["rightUpperArm"]]
    height = np.linalg.norm(up)
    left = left - up * (left @ up) / max(height**2, 1e-30)
    width = np.linalg.norm(left)
    if not (height > 0 and width > 0.02 * height):
        raise CueError(f"{name}: its hips, head and arms lie on each other")
    return np.array([left / width, up / height, np.cross(left, up) / (width * height)])


def _read_node(
    file: Container,
    number: int,
    node: dict[str, Any],
    world: FloatArray,
    shapes: dict[str, Binds],
    made: _Collected,
) -> None:
    mesh = file.item("meshes", node["mesh"])
    skin = file.item("skins", node["skin"]) if "skin" in node else None
    primitives = mesh.get("primitives", [])
    for primitive in primitives if isinstance(primitives, list) else []:
        if not isinstance(primitive, dict) or primitive.get("mode", 4) != 4:
            continue
        attributes = primitive.get("attributes")
        if not isinstance(attributes, dict) or "POSITION" not in attributes:
            continue
        points = _table(file, attributes["POSITION"], 3)
        count = len(points)
        if made.count + count > _MAX_VERTICES:
            raise CueError(f"{file.name}: more than {_MAX_VERTICES} vertices")
        # Without a skin the whole mesh follows its node.
        if skin is None:
            maps = np.broadcast_to(world[number, :3, :3], (count, 3, 3))
            placed = points @ world[number, :3, :3].T + world[number, :3, 3]
            weights = csr_matrix(
                (np.ones(count), (np.arange(count), np.full(count, number))), (count, len(world))
            )
        else:
            maps, placed, weights = _skinned(file, skin, attributes, points, world)
        made.points.append(placed)
        made.weights.append(weights)
        _read_shapes(file, int(node["mesh"]), primitive, maps, shapes, made)
        _read_corners(file, primitive, attributes, count, made)
        made.count += count


def _table(file: Container, accessor: Any, width: int) -> FloatArray:
    values = file.array(accessor)
    if values.shape[1] != width:
        raise CueError(f"{file.name}: array {accessor} has {values.shape[1]} columns, not {width}")
    return values


def _skinned(
    file: Container,
    skin: dict[str, Any],
    attributes: dict[str, Any],
    points: FloatArray,
    world: FloatArray,
) -> tuple[FloatArray, FloatArray, csr_matrix]:
    """Return maps (V, 3, 3), points (V, 3) in the pose of rest, and shares of the nodes (V, N)."""
    nodes = skin.get("joints")
    if not isinstance(nodes, list) or not nodes or len(nodes) > _MAX_NODES:
        raise CueError(f"{file.name}: a skin without joints")
    for joint in nodes:
        file.item("nodes", joint)
    bind = np.tile(np.eye(4), (len(nodes), 1, 1))
    if "inverseBindMatrices" in skin:
        found = _table(file, skin["inverseBindMatrices"], 16)
        if len(found) < len(nodes):
            raise CueError(f"{file.name}: {len(found)} bind matrices for {len(nodes)} joints")
        bind = found[: len(nodes)].reshape(-1, 4, 4).transpose(0, 2, 1)
    at = world[nodes] @ bind
    rows, columns, values = [], [], []
    for k in (0, 1):
        if f"JOINTS_{k}" not in attributes or f"WEIGHTS_{k}" not in attributes:
            continue
        joints = _table(file, attributes[f"JOINTS_{k}"], 4).astype(np.int64)
        weights = _table(file, attributes[f"WEIGHTS_{k}"], 4)
        if len(joints) != len(points) or len(weights) != len(points):
            raise CueError(f"{file.name}: joints or weights of other vertices")
        if joints.size and not 0 <= joints.min() <= joints.max() < len(nodes):
            raise CueError(f"{file.name}: a vertex of joint {joints.max()} of {len(nodes)}")
        rows.append(np.repeat(np.arange(len(points)), 4))
        columns.append(joints.ravel())
        values.append(np.where(weights > _SKIP, weights, 0).ravel())
    if not rows:
        raise CueError(f"{file.name}: a skinned mesh without joints and weights")
    share = csr_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
        (len(points), len(nodes)),
    )
    total = np.asarray(share.sum(axis=1))
    if (total <= 0).any():
        raise CueError(f"{file.name}: {int((total <= 0).sum())} vertices follow no joint")
    share = csr_matrix(share.multiply(1 / total))
    # Linear blend skinning: M(v) = sum over joints j of w(v, j) world(j) bind(j).
    maps = (share @ at[:, :3].reshape(len(nodes), 12)).reshape(-1, 3, 4)
    placed = np.einsum("vij,vj->vi", maps[:, :, :3], points) + maps[:, :, 3]
    of_nodes = csr_matrix(
        (np.ones(len(nodes)), (np.arange(len(nodes)), nodes)), (len(nodes), len(world))
    )
    return maps[:, :, :3], placed, csr_matrix(share @ of_nodes)


def _read_shapes(
    file: Container,
    mesh: int,
    primitive: dict[str, Any],
    maps: FloatArray,
    shapes: dict[str, Binds],
    made: _Collected,
) -> None:
    targets = primitive.get("targets", [])
    targets = targets if isinstance(targets, list) else []
    for name, binds in shapes.items():
        for of_mesh, index, weight in binds:
            if of_mesh != mesh or not isinstance(index, int) or not 0 <= index < len(targets):
                continue
            target = targets[index]
            if not isinstance(target, dict) or "POSITION" not in target:
                continue
            deltas = _table(file, target["POSITION"], 3)
            if len(deltas) != len(maps):
                raise CueError(f"{file.name}: morph target {index} has {len(deltas)} vertices")
            if deltas.any():
                moved = weight * np.einsum("vij,vj->vi", maps, deltas)
                made.shapes.setdefault(name, []).append((made.count, moved))


def _read_corners(
    file: Container,
    primitive: dict[str, Any],
    attributes: dict[str, Any],
    count: int,
    made: _Collected,
) -> None:
    if "indices" in primitive:
        indices = _table(file, primitive["indices"], 1)[:, 0].astype(np.int64)
    else:
        indices = np.arange(count)
    indices = indices[: len(indices) // 3 * 3].reshape(-1, 3)
    if indices.size and indices.max() >= count:
        raise CueError(f"{file.name}: a triangle has corner {indices.max()} of {count}")
    material = primitive.get("material", -1)
    described = file.item("materials", material) if material != -1 else {}
    surface = described.get("pbrMetallicRoughness", {})
    factor = surface.get("baseColorFactor", [1, 1, 1, 1]) if isinstance(surface, dict) else [1] * 4
    try:
        tint = np.tile(np.array(factor, dtype=np.float64).reshape(4), (count, 1))
    except (ValueError, TypeError) as error:
        raise CueError(f"{file.name}: colour of material {material} is damaged") from error
    if "COLOR_0" in attributes:
        colours = file.array(attributes["COLOR_0"])
        if len(colours) != count or colours.shape[1] not in (3, 4):
            raise CueError(f"{file.name}: colours of other vertices")
        tint[:, : colours.shape[1]] *= colours
    uv = _texture_places(file, surface, attributes, count)
    made.triangles.append(indices + made.count)
    made.uv.append(uv[indices])
    made.tints.append(np.clip(tint, 0, 1)[indices])
    made.materials.append(np.full(len(indices), material))


def _texture_places(
    file: Container, surface: Any, attributes: dict[str, Any], count: int
) -> FloatArray:
    texture = surface.get("baseColorTexture", {}) if isinstance(surface, dict) else {}
    texture = texture if isinstance(texture, dict) else {}
    name = f"TEXCOORD_{texture.get('texCoord', 0)}"
    if name not in attributes:
        return np.zeros((count, 2))
    uv = _table(file, attributes[name], 2)
    if len(uv) != count:
        raise CueError(f"{file.name}: texture places of other vertices")
    extensions = texture.get("extensions", {})
    change = extensions.get("KHR_texture_transform") if isinstance(extensions, dict) else None
    if not isinstance(change, dict):
        return uv
    try:
        angle = float(change.get("rotation", 0))
        uv = uv * np.array(change.get("scale", [1, 1]), dtype=np.float64)
        c, s = np.cos(angle), np.sin(angle)
        # KHR_texture_transform: scale, then rotation, then offset.
        turned = uv @ np.array([[c, -s], [s, c]])
        return np.asarray(turned + np.array(change.get("offset", [0, 0]), float))
    except (ValueError, TypeError) as error:
        raise CueError(f"{file.name}: a texture's transform is damaged") from error


def _stacked(parts: list[csr_matrix]) -> csr_matrix:
    from scipy.sparse import vstack

    return csr_matrix(vstack(parts, format="csc"))


def _weld(
    points: FloatArray, weights: dict[str, FloatArray], shapes: dict[str, FloatArray]
) -> tuple[IntArray, IntArray]:
    """Return which vertices stay, and the number of each vertex among them.

    Vertices are one if they lie together and move together: lips that touch are two.
    """
    size = float(np.abs(points).max()) or 1.0
    columns = [points / size * 3e5]
    columns += [np.rint(255 * share)[:, None] for share in weights.values()]
    way = np.zeros_like(points)
    for index, name in enumerate(sorted(shapes), start=1):
        way += np.cos(7.0 * index) * shapes[name]
    columns.append(way / size * 1e5)
    key = np.rint(np.concatenate(columns, axis=1)).astype(np.int64)
    _, first, renumbered = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return first, renumbered.ravel()
