"""Pictures of a file's materials as colours of vertices, on a surface fine enough to show them.

A `Scene` comes in. Triangles whose picture changes along an edge are divided there, round after
round, so that neighbours fit; every corner takes its colour out of the picture. Pictures are
decoded by FFmpeg (through PyAV).
"""

import io
from dataclasses import dataclass
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from receiver.drawing.avatar import SHARE_UNIT
from receiver.foreign.container import Container
from receiver.foreign.scene import Scene

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_MAX_SIDE, _KEPT_SIDE = 8192, 2048
"""Side of a picture in pixels at most, and what larger ones are reduced to."""

_MOST_PIXELS = 1 << 26
"""Pixels of all pictures that are kept, at most."""

_CHANGE = 10.0
"""Greatest difference, in levels of 255, between a picture and the mean of an edge's ends."""

_SHORTEST_MM = 1.2
"""Edges shorter than this are not divided."""

_ROUNDS = 3
"""How often triangles of different colours at their corners are divided at most."""

_SEAM = 40.0
"""Greatest difference, in levels, between colours of a vertex that count as one."""

_GLOSS = 150.0
"""Gloss of a surface without any roughness, of 255."""


@dataclass(frozen=True, slots=True)
class Painted:
    """A surface over control vertices.

    Attributes
    ----------
    sources : ndarray of int, shape (N, 3)
        Control vertices between which each vertex lies.
    shares : ndarray, shape (N, 3)
        Whole parts of `SHARE_UNIT`.
    triangles : ndarray of int, shape (F, 3)
    colours : ndarray of uint8, shape (N, 5)
    """

    sources: IntArray
    shares: FloatArray
    triangles: IntArray
    colours: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class SkinMaterial:
    """What colours a triangle.

    Attributes
    ----------
    picture : ndarray of uint8, shape (h, w, 4)
        One white pixel where there is none.
    gloss : float
        0..255.
    cutoff : float
        Opacity below which nothing is drawn; -1 where opacity does not matter.
    clear : bool
        Whether the ground shows through.
    double : bool
        Whether its back is drawn, too.
    """

    picture: NDArray[np.uint8]
    gloss: float
    cutoff: float
    clear: bool
    double: bool

    def at(self, uv: FloatArray) -> FloatArray:
        """Return the picture (N, 4), linear, 0..1, at places (N, 2); it repeats."""
        height, width = self.picture.shape[:2]
        x = np.floor(uv[:, 0] % 1 * width).astype(np.int64) % width
        y = np.floor(uv[:, 1] % 1 * height).astype(np.int64) % height
        found = self.picture[y, x] / 255.0
        found[:, :3] **= 2.2
        return np.asarray(found)


def read_materials(file: Container) -> list[SkinMaterial]:
    """Read all materials, and one white one at the end for triangles without.

    Raises
    ------
    CueError
        If a picture cannot be decoded.
    """
    decoded: dict[int, NDArray[np.uint8]] = {}
    found = []
    for number, material in enumerate(file.items("materials")):
        surface = material.get("pbrMetallicRoughness", {})
        surface = surface if isinstance(surface, dict) else {}
        texture = surface.get("baseColorTexture")
        picture = np.full((1, 1, 4), 255, np.uint8)
        if isinstance(texture, dict):
            source = _source(file, file.item("textures", texture.get("index")))
            if source not in decoded:
                decoded[source] = _decode(file, source)
                kept = sum(one.size for one in decoded.values()) // 4
                if kept > _MOST_PIXELS:
                    raise CueError(
                        f"{file.name}: pictures of {kept} pixels, {_MOST_PIXELS} at most"
                    )
            picture = decoded[source]
        mode, double = str(material.get("alphaMode")), material.get("doubleSided") is True
        rough = surface.get("roughnessFactor", 1.0)
        cutoff = material.get("alphaCutoff", 0.5)
        if not all(isinstance(x, int | float) for x in (rough, cutoff)):
            raise CueError(f"{file.name}: material {number} is damaged")
        gloss = _GLOSS * float(np.clip(1 - rough, 0, 1))
        least = {"MASK": float(cutoff), "BLEND": 0.02}.get(mode, -1.0)
        found.append(SkinMaterial(picture, gloss, least, mode == "BLEND", double))
    return [*found, SkinMaterial(np.full((1, 1, 4), 255, np.uint8), 0.0, -1.0, False, False)]


def _source(file: Container, texture: dict[str, Any]) -> int:
    extensions = texture.get("extensions", {})
    webp = extensions.get("EXT_texture_webp", {}) if isinstance(extensions, dict) else {}
    source = texture.get("source", webp.get("source") if isinstance(webp, dict) else None)
    file.item("images", source)
    return int(source)  # type: ignore[arg-type]


def _decode(file: Container, number: int) -> NDArray[np.uint8]:
    image = file.item("images", number)
    if "bufferView" not in image:
        raise CueError(f"{file.name}: picture {number} lies in another file; write it as one .glb")
    data = file.view(image["bufferView"])
    try:
        with av.open(io.BytesIO(data), "r") as container:
            stream = container.streams.video[0]
            width, height = stream.codec_context.width, stream.codec_context.height
            if not (1 <= width <= _MAX_SIDE and 1 <= height <= _MAX_SIDE):
                raise CueError(
                    f"{file.name}: picture {number} of {width}x{height}, {_MAX_SIDE} a side at most"
                )
            for frame in container.decode(video=0):
                ratio = min(1.0, _KEPT_SIDE / max(width, height))
                small = frame.reformat(
                    max(1, round(width * ratio)), max(1, round(height * ratio)), "rgba"
                )
                return np.asarray(small.to_ndarray(), dtype=np.uint8)
    except (av.error.FFmpegError, OSError, IndexError, ValueError) as error:
        raise CueError(f"{file.name}: picture {number} cannot be decoded: {error}") from error
    raise CueError(f"{file.name}: picture {number} is empty")


def paint(
    scene: Scene,
    points: FloatArray,
    chosen: NDArray[np.bool_],
    materials: list[SkinMaterial],
    most: int,
) -> Painted:
    """Return the surface of some triangles in their colours.

    Parameters
    ----------
    scene : Scene
    points : ndarray, shape (V, 3)
        Its vertices, mm.
    chosen : ndarray of bool, shape (F,)
    materials : list of SkinMaterial
    most : int
        Vertices at most.

    Raises
    ------
    CueError
        If the triangles have more than `most` vertices before any is divided.
    """
    corners, root = scene.triangles[chosen], scene.triangles[chosen]
    uv, tints, number = scene.uv[chosen], scene.tints[chosen], scene.materials[chosen]
    sources = np.repeat(np.arange(len(points))[:, None], 3, axis=1)
    shares = np.tile([1.0, 0.0, 0.0], (len(points), 1))
    # Divide the edges along which the texture differs most from what corners interpolate, until no
    # difference is seen or the vertices are used up.
    for _ in range(_ROUNDS):
        at = np.einsum("nki,nk->ni", points[sources], shares)
        wanted = _differing(corners, uv, tints, number, at, materials)
        edges = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2), axis=2)
        flat = edges.reshape(-1, 2)
        unique, place = np.unique(flat, axis=0, return_inverse=True)
        place = place.reshape(-1, 3)
        worst = np.zeros(len(unique))
        np.maximum.at(worst, place.ravel(), wanted.ravel())
        room = max(most - _count(corners, uv, tints), 0) // 2
        marked = worst > _CHANGE
        if marked.sum() > room:
            marked &= worst >= np.sort(worst)[-max(room, 1)]
        if not marked.any() or room == 0:
            break
        new = np.full(len(unique), -1)
        new[marked] = len(sources) + np.arange(marked.sum())
        # New vertices lie on triangles of the input: their shares are given in one that holds the
        # edge.
        owner = np.zeros(len(unique), dtype=np.int64)
        owner[place.ravel()] = np.repeat(np.arange(len(corners)), 3)
        base = root[owner[marked]]
        ends = [
            _in_root(sources[unique[marked, k]], shares[unique[marked, k]], base) for k in (0, 1)
        ]
        sources = np.concatenate([sources, base])
        shares = np.concatenate([shares, 0.5 * (ends[0] + ends[1])])
        corners, uv, tints, kept = _divide(corners, uv, tints, new[place])
        root, number = root[kept], number[kept]
    return _coloured(corners, uv, tints, number, sources, shares, materials, most, scene.name)


def _count(corners: IntArray, uv: FloatArray, tints: FloatArray) -> int:
    """Return how many vertices there are, apart where the picture is torn."""
    key = np.concatenate(
        [corners.reshape(-1, 1), np.rint(4096 * uv).reshape(-1, 2)], axis=1
    ).astype(np.int64)
    return len(np.unique(key, axis=0))


def _in_root(sources: IntArray, shares: FloatArray, base: IntArray) -> FloatArray:
    """Return shares (E, 3) of the corners `base` in vertices that lie in that triangle."""
    same = sources[:, :, None] == base[:, None, :]
    # A vertex that repeats a source carries its share once.
    return np.asarray((shares[:, :, None] * same).sum(axis=1))


def _levels(linear: FloatArray) -> FloatArray:
    return np.asarray(255 * np.clip(linear, 0, 1) ** (1 / 2.2))


def _differing(
    corners: IntArray,
    uv: FloatArray,
    tints: FloatArray,
    number: IntArray,
    at: FloatArray,
    materials: list[SkinMaterial],
) -> FloatArray:
    """Return by how many levels (F, 3) the picture on each edge differs from its ends' mean."""
    found = np.zeros((len(corners), 3))
    for k in range(3):
        a, b = k, (k + 1) % 3
        length = np.linalg.norm(at[corners[:, a]] - at[corners[:, b]], axis=1)
        for index in np.unique(number):
            own = np.flatnonzero((number == index) & (length > _SHORTEST_MM))
            if materials[index].picture.size == 4:
                continue
            p, q = uv[own, a], uv[own, b]
            ends = 0.5 * (_levels(materials[index].at(p)) + _levels(materials[index].at(q)))
            for share in (0.25, 0.5, 0.75):
                there = _levels(materials[index].at(p + share * (q - p)))
                change = np.abs(there - ends).max(axis=1)
                found[own, k] = np.maximum(found[own, k], change)
    return found


def _divide(
    corners: IntArray, uv: FloatArray, tints: FloatArray, middle: IntArray
) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """Divide triangles at the new vertices (F, 3) of their edges, -1 for none.

    Returns corners, places in the picture, tints, and the triangle that each came from.
    """
    # Six corners of a triangle: its own, then the middles of edges 01, 12, 20.
    six = np.concatenate([corners, middle], axis=1)
    uv6 = np.concatenate([uv, 0.5 * (uv + np.roll(uv, -1, axis=1))], axis=1)
    tint6 = np.concatenate([tints, 0.5 * (tints + np.roll(tints, -1, axis=1))], axis=1)
    pieces = {
        0: [(0, 1, 2)],
        1: [(0, 3, 2), (3, 1, 2)],
        2: [(1, 4, 0), (4, 2, 0)],
        4: [(2, 5, 1), (5, 0, 1)],
        3: [(3, 1, 4), (0, 3, 4), (0, 4, 2)],
        6: [(4, 2, 5), (1, 4, 5), (1, 5, 0)],
        5: [(5, 0, 3), (2, 5, 3), (2, 3, 1)],
        7: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
    }
    kind = ((middle >= 0) * [1, 2, 4]).sum(axis=1)
    rows, picks = [], []
    for pattern, triples in pieces.items():
        own = np.flatnonzero(kind == pattern)
        for triple in triples:
            rows.append(own)
            picks.append(np.tile(triple, (len(own), 1)))
    row, pick = np.concatenate(rows), np.concatenate(picks)
    take = (row[:, None], pick)
    return six[take], uv6[take], tint6[take], row


def _coloured(
    corners: IntArray, uv: FloatArray, tints: FloatArray, number: IntArray, sources: IntArray,
    shares: FloatArray, materials: list[SkinMaterial], most: int, name: str,
) -> Painted:  # fmt: skip
    colours = np.zeros((len(corners), 3, 5))
    drawn = np.ones(len(corners), dtype=bool)
    for index in np.unique(number):
        own, material = np.flatnonzero(number == index), materials[index]
        found = material.at(uv[own].reshape(-1, 2)).reshape(-1, 3, 4) * tints[own]
        colours[own, :, :3] = _levels(found[..., :3])
        colours[own, :, 3] = material.gloss
        colours[own, :, 4] = 255
        if material.clear:
            colours[own, :, 4] = 255 * found[..., 3]
        elif material.cutoff >= 0:
            colours[own, :, 4] = 255 * (found[..., 3] >= material.cutoff)
        drawn[own] = (found[..., 3] >= material.cutoff).any(axis=1)
    corners, colours, number = corners[drawn], colours[drawn], number[drawn]
    # One vertex for each place and rounded colour; then colours that lie near are one.
    coarse = np.rint(colours.reshape(-1, 5) / _SEAM)
    key = np.concatenate([corners.reshape(-1, 1), coarse], axis=1).astype(np.int64)
    unique, place = np.unique(key, axis=0, return_inverse=True)
    place = place.ravel()
    if len(unique) > most:
        raise CueError(f"{name}: {len(unique)} vertices above the waist, {most} at most")
    total = np.bincount(place)[:, None]
    mean = np.stack([np.bincount(place, colours[..., c].ravel()) for c in range(5)], axis=1) / total
    vertex = unique[:, 0]
    parts = np.rint(shares[vertex] * SHARE_UNIT)
    largest = parts.argmax(axis=1)
    parts[np.arange(len(parts)), largest] += SHARE_UNIT - parts.sum(axis=1)
    painted = Painted(
        sources[vertex],
        parts / SHARE_UNIT,
        place.reshape(-1, 3),
        np.clip(np.rint(mean), 0, 255).astype(np.uint8),
    )
    double = np.array([material.double for material in materials])
    return _with_backs(painted, double[number], most)


def _with_backs(painted: Painted, double: NDArray[np.bool_], most: int) -> Painted:
    """Add the backs of some triangles (F,), as surfaces of their own, where there is room.

    Page and portrait draw fronts only.
    """
    used, place = np.unique(painted.triangles[double], return_inverse=True)
    count = len(painted.sources)
    if len(used) == 0 or count + len(used) > most:
        return painted
    backs = place.reshape(-1, 3)[:, ::-1] + count
    return Painted(
        np.concatenate([painted.sources, painted.sources[used]]),
        np.concatenate([painted.shares, painted.shares[used]]),
        np.concatenate([painted.triangles, backs]),
        np.concatenate([painted.colours, painted.colours[used]]),
    )
