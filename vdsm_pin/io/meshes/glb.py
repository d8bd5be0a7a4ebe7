"""GLB, the binary form of glTF 2.0: the scene's triangles in metres.

Everything that has triangles is read or refused: nothing is left out silently.
"""

import json
import math
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from vdsm_pin.geometry.arrays import FloatArray, IntArray, rotation_from_quaternion
from vdsm_pin.io.meshes.raw import MeshStream, RawMesh, doubles
from vdsm_pin.io.meshes.scene import Placed, composed, strip_triangles
from vdsm_pin.io.schema_types import Number

_LOOKS: Final = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_")
_KNOWN: Final = frozenset({"KHR_mesh_quantization", "KHR_xmp_json_ld", "KHR_xmp"})
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_JSON, _BIN = 0x4E4F534A, 0x004E4942
_MOST_JSON: Final = 64 << 20
_NUMBERS: Final[dict[int, np.dtype[Any]]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
_INDICES: Final = (5121, 5123, 5125)

Count = Annotated[int, Field(ge=0, lt=1 << 32)]


class _View(BaseModel):
    buffer: Count
    byteOffset: Count = 0  # noqa: N815 (glTF's name)
    byteLength: Count  # noqa: N815
    byteStride: Count | None = None  # noqa: N815
    extensions: dict[str, Any] = {}


class _Accessor(BaseModel):
    bufferView: Count | None = None  # noqa: N815
    byteOffset: Count = 0  # noqa: N815
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]  # noqa: N815
    normalized: bool = False
    count: Count
    type: str
    sparse: Any = None


class _Primitive(BaseModel):
    attributes: dict[str, Count]
    indices: Count | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = _TRIANGLES
    extensions: dict[str, Any] = {}


class _Mesh(BaseModel):
    primitives: list[_Primitive]
    weights: list[Number] = []


class _Node(BaseModel):
    children: list[Count] = []
    mesh: Count | None = None
    skin: Count | None = None
    weights: list[Number] = []
    matrix: Annotated[list[Number], Field(min_length=16, max_length=16)] | None = None
    translation: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    rotation: tuple[Number, Number, Number, Number] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[Number, Number, Number] = (1.0, 1.0, 1.0)
    extensions: dict[str, Any] = {}

    def pose(self) -> FloatArray:
        """T_parent_node, shape (4, 4)."""
        if self.matrix is not None:
            return np.array(self.matrix).reshape(4, 4).T
        length = math.hypot(*self.rotation) or 1.0
        pose, turn = np.eye(4), np.array(self.rotation) / length
        pose[:3, :3] = rotation_from_quaternion(turn) * self.scale
        pose[:3, 3] = self.translation
        return pose


class _Buffer(BaseModel):
    uri: str | None = None


class _Scene(BaseModel):
    nodes: list[Count] = []


class _Document(BaseModel):
    scene: Count | None = None
    scenes: list[_Scene] = []
    nodes: list[_Node] = []
    meshes: list[_Mesh] = []
    accessors: list[_Accessor] = []
    bufferViews: list[_View] = []  # noqa: N815
    buffers: list[_Buffer] = []
    animations: list[Any] = []
    extensionsRequired: list[str] = []  # noqa: N815


def read_glb(stream: MeshStream) -> RawMesh:
    """The triangles of the scene of a GLB file, in metres.

    Raises:
        InvalidFile: If it is damaged, or has triangles in a form that is not read.
    """
    text, data = _chunks(stream)
    if len(text) > _MOST_JSON:
        raise stream.invalid(fault=f"has more than {_MOST_JSON >> 20} MiB of JSON")
    try:
        document = _Document.model_validate(json.loads(text))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        fault = f"its glTF is damaged: {first['msg']}"
        raise stream.invalid(fault, where=where) from None
    except (ValueError, RecursionError) as error:
        fault = f"its glTF is no JSON: {' '.join(str(error).split())[:80]}"
        raise stream.invalid(fault) from None
    for name in document.extensionsRequired:
        if not name.startswith(_LOOKS) and name not in _KNOWN:
            fault = f"requires the extension {name[:60]!r}, which is not read"
            raise stream.invalid(fault)
    return _Reader(stream, document, data).read()


def _chunks(stream: MeshStream) -> tuple[bytes, bytes]:
    """The JSON and the binary chunk."""
    content = stream.content.read()
    magic, version, length = content[:4], *_words(content, 4)
    if magic != b"glTF" or version != 2 or length > len(content):
        raise stream.invalid(fault="is no GLB file of version 2, or cut short")
    stream.check_end(content[length:], f"{length} bytes")
    offset, found = 12, dict[int, bytes]()
    while offset < length:
        size, kind = _words(content, offset)
        if offset + 8 + size > length:
            raise stream.invalid(fault=f"a chunk promises {size} bytes, fewer follow")
        if kind in (_JSON, _BIN) and kind in found:
            raise stream.invalid(fault="has two chunks of a kind, expected one")
        found[kind] = content[offset + 8 : offset + 8 + size]
        offset += 8 + size
    if _JSON not in found:
        raise stream.invalid(fault="has no JSON chunk")
    return found[_JSON], found.get(_BIN, b"")


def _words(content: bytes, offset: int) -> tuple[int, int]:
    """Two whole numbers of four bytes."""
    first, second = content[offset : offset + 4], content[offset + 4 : offset + 8]
    return int.from_bytes(first, "little"), int.from_bytes(second, "little")


class _Reader:
    """The scene of one document, node by node."""

    def __init__(self, stream: MeshStream, document: _Document, data: bytes) -> None:
        self._stream, self._document, self._data = stream, document, data
        self._parts: dict[int, list[RawMesh]] = {}
        self._placed, self._left_out = Placed(stream), 0

    def read(self) -> RawMesh:
        """All triangles of the scene."""
        seen: set[int] = set()
        left = [(node, np.eye(4)) for node in self._roots()]
        while left:
            number, pose = left.pop()
            if number in seen:
                fault = f"node {number} stands in the scene twice"
                raise self._stream.invalid(fault)
            seen.add(number)
            node = self._at("nodes", number)
            pose = composed(self._stream, pose, node.pose())
            self._put(node, number, pose)
            left += [(child, pose) for child in node.children]
        notes = []
        if self._left_out:
            notes.append(f"lines and points left out: {self._left_out}")
        if self._document.animations:
            notes.append("its motion is not read: parts stand where their nodes do")
        if len(self._document.scenes) > 1:
            notes.append(f"one of {len(self._document.scenes)} scenes is read")
        return self._placed.mesh(1.0, bend=0.0, notes=notes)

    def _roots(self) -> list[int]:
        document = self._document
        if document.scenes:
            scene: _Scene = self._at("scenes", document.scene or 0)
            return scene.nodes
        inner = {child for node in document.nodes for child in node.children}
        return [i for i in range(len(document.nodes)) if i not in inner]

    def _at(self, kind: str, number: int) -> Any:
        things = getattr(self._document, kind)
        if number >= len(things):
            fault = f"names {kind}[{number}], there are {len(things)}"
            raise self._stream.invalid(fault)
        return things[number]

    def _put(self, node: _Node, number: int, pose: FloatArray) -> None:
        if "EXT_mesh_gpu_instancing" in node.extensions:
            fault = f"node {number} has many instances, which are not read"
            raise self._stream.invalid(fault)
        if node.mesh is None:
            return
        mesh = self._at("meshes", node.mesh)
        if node.skin is not None or any(node.weights or mesh.weights):
            bent = f"node {number} is bent by a skin or by morph targets"
            raise self._stream.invalid(fault=f"{bent}; export it as it stands")
        if node.mesh not in self._parts:
            made = (self._part(one) for one in mesh.primitives)
            self._parts[node.mesh] = [part for part in made if part is not None]
        self._placed.put(self._parts[node.mesh], pose)

    def _part(self, primitive: _Primitive) -> RawMesh | None:
        if primitive.mode < _TRIANGLES:
            self._left_out += 1
            return None
        if "KHR_draco_mesh_compression" in primitive.extensions:
            fault = "is compressed (KHR_draco_mesh_compression), which is not read"
            raise self._stream.invalid(fault)
        if "POSITION" not in primitive.attributes:
            return None
        vertices = self._numbers(primitive.attributes["POSITION"], "VEC3")
        order = np.arange(len(vertices))
        if primitive.indices is not None:
            accessor = self._at("accessors", primitive.indices)
            if accessor.componentType not in _INDICES:
                fault = "has indices that are no whole numbers"
                raise self._stream.invalid(fault)
            order = self._numbers(primitive.indices, "SCALAR")[:, 0].astype(np.int64)
        if not (order < len(vertices)).all():
            fault = f"names vertex {order.max()} of {len(vertices)}"
            raise self._stream.invalid(fault)
        return RawMesh(vertices, _triangles(order, primitive.mode))

    def _numbers(self, number: int, shape: str) -> FloatArray:
        """What an accessor gives, shape (count, 3) or (count, 1)."""
        accessor: _Accessor = self._at("accessors", number)
        width = {"SCALAR": 1, "VEC3": 3}[shape]
        if accessor.type != shape or accessor.sparse is not None:
            fault = f"accessors[{number}] is sparse or no {shape}, which is not read"
            raise self._stream.invalid(fault)
        if accessor.bufferView is None:
            raise self._stream.invalid(fault=f"accessors[{number}] has no data")
        view: _View = self._at("bufferViews", accessor.bufferView)
        if view.buffer != 0 or self._at("buffers", 0).uri or view.extensions:
            fault = "has data in another file or compressed, which is not read"
            raise self._stream.invalid(fault)
        if not accessor.count:
            return np.zeros((0, width))
        kind = _NUMBERS[accessor.componentType]
        size = width * kind.itemsize
        stride, start = view.byteStride or size, view.byteOffset + accessor.byteOffset
        end = accessor.byteOffset + stride * (accessor.count - 1) + size
        whole = view.byteOffset + view.byteLength <= len(self._data)
        if not (whole and end <= view.byteLength and stride >= size):
            fault = f"accessors[{number}] promises {accessor.count} values, too many"
            raise self._stream.invalid(fault)
        shaped = np.ndarray(
            (accessor.count, width), kind, self._data, start, (stride, kind.itemsize)
        )
        values = doubles(shaped)
        if accessor.normalized and kind.kind != "f":
            bits = 8 * kind.itemsize - (kind.kind == "i")
            values = np.maximum(values / (2.0**bits - 1.0), -1.0)
        return values


def _triangles(order: IntArray, mode: int) -> IntArray:
    """Vertex indices of triangles from a list, a strip or a fan."""
    if mode == _TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    return strip_triangles(order, fan=mode == _FAN)
