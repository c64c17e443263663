#!/usr/bin/env bash
# gltfpack 1.3.0 (npm) shows the nodes of a glTF file that are hidden.
#
# A node with the extension KHR_node_visibility and "visible": false is not drawn, nor is what hangs
# from it. A file of two triangles, one of them hidden so, was packed with -kn, which keeps named
# nodes. Guessed: the extension is kept, or the hidden node is left out. Found: both nodes are there,
# the extension is gone from the node and from extensionsUsed, nothing is said, and the exit code
# is 0. Every viewer then draws both triangles.
#
# Output seen:
#   nodes: shown, hidden; extensionsUsed: undefined; hidden node's extensions: undefined
#
# Needs node and npm. Found on 2026-11-28 with Node.js 20.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init -y > /dev/null
npm install --silent gltfpack@1.3.0 > /dev/null

cat > make.js <<'JS'
const corners = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]);
const order = new Uint16Array([0, 1, 2]);
const bytes = Buffer.concat([Buffer.from(corners.buffer), Buffer.from(order.buffer)]);
const hidden = { KHR_node_visibility: { visible: false } };
const file = {
  asset: { version: "2.0" },
  extensionsUsed: ["KHR_node_visibility"],
  scene: 0,
  scenes: [{ nodes: [0, 1] }],
  nodes: [
    { name: "shown", mesh: 0 },
    { name: "hidden", mesh: 0, translation: [5, 0, 0], extensions: hidden },
  ],
  meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
  accessors: [
    { bufferView: 0, componentType: 5126, count: 3, type: "VEC3", min: [0, 0, 0], max: [1, 1, 0] },
    { bufferView: 1, componentType: 5123, count: 3, type: "SCALAR" },
  ],
  bufferViews: [
    { buffer: 0, byteOffset: 0, byteLength: 36 },
    { buffer: 0, byteOffset: 36, byteLength: 6 },
  ],
  buffers: [{
    byteLength: bytes.length,
    uri: "data:application/octet-stream;base64," + bytes.toString("base64"),
  }],
};
require("fs").writeFileSync("in.gltf", JSON.stringify(file));
JS
node make.js
said=$(npx gltfpack -i in.gltf -o out.gltf -kn -noq 2>&1)
test -z "$said"

cat > look.js <<'JS'
const file = JSON.parse(require("fs").readFileSync("out.gltf", "utf8"));
const names = file.nodes.map((node) => node.name).join(", ");
const other = file.nodes.find((node) => node.name === "hidden");
console.log(`nodes: ${names}; extensionsUsed: ${file.extensionsUsed}; ` +
  `hidden node's extensions: ${other && other.extensions}`);
JS
seen=$(node look.js)
echo "$seen"
test "$seen" = "nodes: shown, hidden; extensionsUsed: undefined; hidden node's extensions: undefined"
