#include "server/bake/glb.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <string_view>

#include <meshoptimizer.h>

#include "idl/types/bytes.h"

namespace tenon::bake {
namespace {

/// A section of the compressed buffer, and its size when it is not compressed.
struct GlbView {
  std::vector<std::uint8_t> compressed;
  std::size_t count = 0;
  std::size_t stride = 0;  ///< [bytes]
  const char* mode = "";
  const char* target = "";
};

template <class Member>
GlbView encodeAttribute(const std::vector<GlbVertex>& vertices, Member GlbVertex::*member) {
  std::vector<Member> values;
  values.reserve(vertices.size());
  for (const GlbVertex& vertex : vertices) values.push_back(vertex.*member);
  GlbView view{{}, values.size(), sizeof(Member), "ATTRIBUTES", "34962"};
  view.compressed.resize(meshopt_encodeVertexBufferBound(values.size(), sizeof(Member)));
  view.compressed.resize(meshopt_encodeVertexBuffer(view.compressed.data(), view.compressed.size(),
                                                    values.data(), values.size(), sizeof(Member)));
  return view;
}

GlbView encodeIndices(const GlbMesh& mesh) {
  GlbView view{{}, mesh.indices.size(), sizeof(std::uint32_t), "TRIANGLES", "34963"};
  view.compressed.resize(meshopt_encodeIndexBufferBound(mesh.indices.size(), mesh.vertices.size()));
  view.compressed.resize(meshopt_encodeIndexBuffer(view.compressed.data(), view.compressed.size(),
                                                   mesh.indices.data(), mesh.indices.size()));
  return view;
}

std::string numberText(double number) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", number);
  return text;
}

template <class Values>
std::string listText(const Values& values) {
  std::string text;
  for (int i = 0; i < 3; ++i)
    text += (i == 0 ? "[" : ",") + numberText(static_cast<double>(values[static_cast<std::size_t>(i)]));
  return text + "]";
}

void pad(std::vector<std::uint8_t>& bytes, std::uint8_t with) {
  while (bytes.size() % 4 != 0) bytes.push_back(with);
}

}  // namespace

std::vector<std::uint8_t> writeGlb(const GlbMesh& mesh) {
  std::vector<GlbView> views{encodeAttribute(mesh.vertices, &GlbVertex::position),
                             encodeAttribute(mesh.vertices, &GlbVertex::normal)};
  if (mesh.has_colors) views.push_back(encodeAttribute(mesh.vertices, &GlbVertex::color));
  views.push_back(encodeIndices(mesh));
  std::vector<std::uint8_t> binary;
  std::string view_list;
  std::size_t plain_size = 0;
  for (const GlbView& view : views) {
    const std::string stride = std::to_string(view.stride);
    const std::string size = std::to_string(view.count * view.stride);
    view_list += std::string(view_list.empty() ? "" : ",") + R"({"buffer":1,"byteOffset":)" +
                 std::to_string(plain_size) + R"(,"byteLength":)" + size +
                 (std::string_view(view.mode) == "ATTRIBUTES" ? R"(,"byteStride":)" + stride : "") +
                 R"(,"target":)" + view.target +
                 R"(,"extensions":{"EXT_meshopt_compression":{"buffer":0,"byteOffset":)" +
                 std::to_string(binary.size()) + R"(,"byteLength":)" +
                 std::to_string(view.compressed.size()) + R"(,"byteStride":)" + stride + R"(,"count":)" +
                 std::to_string(view.count) + R"(,"mode":")" + view.mode + R"("}}})";
    plain_size += (view.count * view.stride + 3) / 4 * 4;
    binary.insert(binary.end(), view.compressed.begin(), view.compressed.end());
    pad(binary, 0);
  }
  std::array<std::uint16_t, 4> low = mesh.vertices.front().position;
  std::array<std::uint16_t, 4> high = low;
  for (const GlbVertex& vertex : mesh.vertices) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], vertex.position[axis]);
      high[axis] = std::max(high[axis], vertex.position[axis]);
    }
  }
  const std::string vertices = std::to_string(mesh.vertices.size());
  const std::string step = numberText(mesh.step);
  const std::string json =
      R"({"asset":{"version":"2.0","generator":"tenon"},)"
      R"("extensionsUsed":["KHR_mesh_quantization","EXT_meshopt_compression"],)"
      R"("extensionsRequired":["KHR_mesh_quantization","EXT_meshopt_compression"],)"
      R"("scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"translation":)" +
      listText(mesh.origin) + R"(,"scale":[)" + step + "," + step + "," + step +
      R"(]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1)" +
      (mesh.has_colors ? R"(,"COLOR_0":2},"indices":3)" : R"(},"indices":2)") +
      R"(,"material":0}]}],"materials":[{"pbrMetallicRoughness":{"baseColorFactor":)" +
      (mesh.has_colors ? "[1,1,1,1]" : "[0.6,0.6,0.6,1]") +
      R"(,"metallicFactor":0,)"
      R"("roughnessFactor":0.7},"doubleSided":true}],"accessors":[{"bufferView":0,"componentType":5123,)"
      R"("count":)" +
      vertices + R"(,"type":"VEC3","min":)" + listText(low) + R"(,"max":)" + listText(high) +
      R"(},{"bufferView":1,"componentType":5120,"normalized":true,"count":)" + vertices +
      R"(,"type":"VEC3"})" +
      (mesh.has_colors ? R"(,{"bufferView":2,"componentType":5123,"normalized":true,"count":)" + vertices +
                             R"(,"type":"VEC4"},{"bufferView":3)"
                       : std::string(R"(,{"bufferView":2)")) +
      R"(,"componentType":5125,"count":)" + std::to_string(mesh.indices.size()) +
      R"(,"type":"SCALAR"}],"bufferViews":[)" + view_list + R"(],"buffers":[{"byteLength":)" +
      std::to_string(binary.size()) + R"(},{"byteLength":)" + std::to_string(plain_size) +
      R"(,"extensions":{"EXT_meshopt_compression":{"fallback":true}}}]})";
  std::vector<std::uint8_t> text(json.begin(), json.end());
  pad(text, ' ');

  std::vector<std::uint8_t> file;
  ByteWriter writer(file);
  constexpr std::uint32_t kMagic = 0x46546C67;   // "glTF"
  constexpr std::uint32_t kJson = 0x4E4F534A;    // "JSON"
  constexpr std::uint32_t kBinary = 0x004E4942;  // "BIN"
  writer.put(kMagic);
  writer.put(std::uint32_t{2});
  writer.put(static_cast<std::uint32_t>(12 + 8 + text.size() + 8 + binary.size()));
  writer.put(static_cast<std::uint32_t>(text.size()));
  writer.put(kJson);
  file.insert(file.end(), text.begin(), text.end());
  writer.put(static_cast<std::uint32_t>(binary.size()));
  writer.put(kBinary);
  file.insert(file.end(), binary.begin(), binary.end());
  return file;
}

}  // namespace tenon::bake
