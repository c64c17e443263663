"""glTF files, made number by number."""

import base64
import json
import struct

import numpy as np

KINDS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
WIDTHS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Gltf:
    """A file under construction: its JSON `content`, and the bytes of its one buffer."""

    def __init__(self, **content):
        empty = {kind: [] for kind in ("accessors", "bufferViews", "meshes", "nodes")}
        self.content = {"asset": {"version": "2.0"}, **empty, **content}
        self.data = b""

    def view(self, data, **more):
        """Add bytes; the number of their buffer view."""
        self.data += b"\0" * (-len(self.data) % 4)
        place = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.content["bufferViews"].append({**place, **more})
        self.data += data
        return len(self.content["bufferViews"]) - 1

    def numbers(self, values, kind="f4", stride=0, **more):
        """Add an accessor of values (N,) or (N, W); its number."""
        values = np.asarray(values, "<" + kind)
        values = values.reshape(len(values), -1)
        data, layout = values.tobytes(), {}
        if stride:
            rows = np.zeros((len(values), stride), np.uint8)
            rows[:, : values.shape[1] * values.itemsize] = values.view(np.uint8)
            data, layout = rows.tobytes(), {"byteStride": stride}
        given = more.pop("bufferView", 0) is not None
        view = {"bufferView": self.view(data, **layout)} if given else {}
        self.content["accessors"].append(
            {**view, "componentType": KINDS[kind], "count": len(values),
             "type": WIDTHS[values.shape[1]], **more}
        )  # fmt: skip
        return len(self.content["accessors"]) - 1

    def sparse(self, base, rows, values, kind="u2", plain=True):
        """Add an accessor of which some rows are replaced; `plain` False: all others are 0."""
        base = np.asarray(base, float)
        number = self.numbers(base) if plain else self.numbers(base, bufferView=None)
        self.content["accessors"][number]["sparse"] = {
            "count": len(rows),
            "indices": {"bufferView": self.view(np.asarray(rows, kind).tobytes()),
                        "componentType": KINDS[kind]},
            "values": {"bufferView": self.view(np.asarray(values, "<f4").tobytes())},
        }  # fmt: skip
        return number

    def add(self, kind, item):
        """Add a node, mesh, ...; its number."""
        self.content.setdefault(kind, []).append(item)
        return len(self.content[kind]) - 1

    def shape(self, vertices, faces, kind="u2", **more):
        """Add a primitive's numbers: what stands in its mesh."""
        primitive = {"attributes": {"POSITION": self.numbers(vertices)}, **more}
        if faces is not None:
            primitive["indices"] = self.numbers(np.ravel(faces), kind)
        return primitive

    def mesh(self, *primitives, **more):
        """Add a mesh; its number."""
        return self.add("meshes", {"primitives": list(primitives), **more})

    def node(self, mesh=None, **more):
        """Add a node; its number."""
        return self.add("nodes", {**({} if mesh is None else {"mesh": mesh}), **more})

    def glb(self):
        """The bytes of a binary file."""
        body = self.data + b"\0" * (-len(self.data) % 4)
        content = {"buffers": [{"byteLength": len(self.data)}], **self.content}
        text = json.dumps(content).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(body), 0x004E4942) + body
        return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks

    def text(self, uri=None):
        """The text of a .gltf whose buffer is in it, or where `uri` says."""
        inside = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        buffers = [{"uri": uri or inside, "byteLength": len(self.data)}]
        return json.dumps({"buffers": buffers, **self.content})
