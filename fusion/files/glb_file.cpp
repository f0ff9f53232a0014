#include "fusion/files/glb_file.hpp"

#include <tiny_gltf.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <sstream>
#include <utility>
#include <vector>

namespace spectra::files {
namespace {

/// Appends to the model's one buffer; what is added begins at a multiple of four bytes.
class BufferWriter {
 public:
  explicit BufferWriter(tinygltf::Model& model) : model_(model) { model_.buffers.emplace_back(); }

  /// A view of `bytes` new bytes; returns where to write them.
  unsigned char* add_view(std::size_t bytes, int target) {
    auto& data = model_.buffers.front().data;
    const std::size_t offset = data.size();
    data.resize(offset + (bytes + 3) / 4 * 4);
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = offset;
    view.byteLength = bytes;
    view.target = target;
    model_.bufferViews.push_back(std::move(view));
    return data.data() + offset;
  }

  /// An accessor of the newest view; returns its index.
  int add_accessor(int component_type, int type, std::size_t count, bool is_normalised = false) {
    tinygltf::Accessor accessor;
    accessor.bufferView = static_cast<int>(model_.bufferViews.size()) - 1;
    accessor.componentType = component_type;
    accessor.type = type;
    accessor.count = count;
    accessor.normalized = is_normalised;
    model_.accessors.push_back(std::move(accessor));
    return static_cast<int>(model_.accessors.size()) - 1;
  }

 private:
  tinygltf::Model& model_;
};

/// Turned so that what was `up` is +Y. Only exchanges and negates coordinates.
template <class Vector>
Vector turned_upright(const Vector& v, const base::Vec3f& up) {
  using Scalar = decltype(v.x);
  if (up.x != 0) return {-static_cast<Scalar>(up.x) * v.y, static_cast<Scalar>(up.x) * v.x, v.z};
  const auto sign = static_cast<Scalar>(up.y != 0 ? up.y : up.z);
  return up.y != 0 ? Vector{v.x, sign * v.y, sign * v.z} : Vector{v.x, sign * v.z, -sign * v.y};
}

/// The linear value of every sRGB channel as a normalised unsigned short (IEC 61966-2-1).
std::array<std::uint16_t, 256> linear_channels() {
  std::array<std::uint16_t, 256> linear{};
  for (std::size_t i = 0; i < linear.size(); ++i) {
    const double encoded = static_cast<double>(i) / 255;
    const double value = encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
    linear[i] = static_cast<std::uint16_t>(std::lround(65535 * value));
  }
  return linear;
}

/// glTF allows neither NaN nor infinity.
float stored_celsius(float celsius) {
  if (std::isnan(celsius)) return kGlbMissingCelsius;
  constexpr float kLargest = std::numeric_limits<float>::max();
  return std::clamp(celsius, -kLargest, kLargest);
}

void set_position_bounds(tinygltf::Accessor& accessor, std::span<const base::Vec3f> positions) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  std::array<float, 3> low{kInfinity, kInfinity, kInfinity};
  std::array<float, 3> high{-kInfinity, -kInfinity, -kInfinity};
  for (const auto& p : positions) {
    const std::array<float, 3> position{p.x, p.y, p.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], position[axis]);
      high[axis] = std::max(high[axis], position[axis]);
    }
  }
  accessor.minValues.assign(low.begin(), low.end());
  accessor.maxValues.assign(high.begin(), high.end());
}

}  // namespace

base::Result<std::string> glb_file(const mesh::MultispectralMesh& mesh, std::span<const base::Rgb8> colours,
                                   base::Vec3f up) {
  const std::size_t vertex_count = mesh.vertex_count();
  const std::size_t size_bytes =
      vertex_count * (12 + 8 + (mesh.has_temperature ? 4U : 0U)) + mesh.triangle_count() * 12;
  if (size_bytes > std::numeric_limits<std::uint32_t>::max() - 65'536U) {
    return base::failure(base::ErrorCode::TooLarge,
                         "the scene needs " + std::to_string(size_bytes) + " bytes and a GLB holds at most 4 GiB");
  }
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "Spectra";
  tinygltf::Node node;
  node.name = mesh.name;
  const base::Vec3d origin = turned_upright(mesh.origin, up);
  node.translation = {origin.x, origin.y, origin.z};

  if (vertex_count > 0) {
    BufferWriter writer(model);
    model.buffers.front().data.reserve(size_bytes);
    tinygltf::Primitive primitive;
    primitive.mode = mesh.is_point_cloud() ? TINYGLTF_MODE_POINTS : TINYGLTF_MODE_TRIANGLES;

    std::vector<base::Vec3f> positions(vertex_count);
    std::transform(mesh.positions().begin(), mesh.positions().end(), positions.begin(),
                   [up](const base::Vec3f& p) { return turned_upright(p, up); });
    const std::size_t position_bytes = positions.size() * sizeof(base::Vec3f);
    std::memcpy(writer.add_view(position_bytes, TINYGLTF_TARGET_ARRAY_BUFFER), positions.data(), position_bytes);
    const int position = writer.add_accessor(TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3, vertex_count);
    set_position_bounds(model.accessors[static_cast<std::size_t>(position)], positions);
    primitive.attributes["POSITION"] = position;

    static const std::array<std::uint16_t, 256> kLinear = linear_channels();
    unsigned char* rgba = writer.add_view(vertex_count * 8, TINYGLTF_TARGET_ARRAY_BUFFER);
    for (const auto& colour : colours) {
      const std::array<std::uint16_t, 4> linear{kLinear[colour.r], kLinear[colour.g], kLinear[colour.b], 65535};
      std::memcpy(rgba, linear.data(), sizeof linear);
      rgba += sizeof linear;
    }
    primitive.attributes["COLOR_0"] =
        writer.add_accessor(TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC4, vertex_count, true);

    if (mesh.has_temperature) {
      unsigned char* out = writer.add_view(vertex_count * 4, TINYGLTF_TARGET_ARRAY_BUFFER);
      for (const float celsius : mesh.temperature_celsius()) {
        const float stored = stored_celsius(celsius);
        std::memcpy(out, &stored, sizeof stored);
        out += sizeof stored;
      }
      primitive.attributes["_TEMPERATURE"] =
          writer.add_accessor(TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_SCALAR, vertex_count);
      tinygltf::Value::Object extras;
      extras["temperature_unit"] = tinygltf::Value(std::string("degC"));
      extras["temperature_missing"] = tinygltf::Value(double{kGlbMissingCelsius});
      extras["temperature_over_range"] = tinygltf::Value(double{std::numeric_limits<float>::max()});
      extras["temperature_under_range"] = tinygltf::Value(double{-std::numeric_limits<float>::max()});
      primitive.extras = tinygltf::Value(std::move(extras));
    }

    if (!mesh.is_point_cloud()) {
      const auto& triangles = mesh.triangles();
      const std::size_t bytes = triangles.size() * sizeof(base::Triangle);
      std::memcpy(writer.add_view(bytes, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER), triangles.data(), bytes);
      primitive.indices =
          writer.add_accessor(TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR, triangles.size() * 3);
    }
    // Colours that mean temperature must not be shaded.
    tinygltf::Material material;
    material.name = "unlit";
    material.doubleSided = true;
    material.extensions["KHR_materials_unlit"] = tinygltf::Value(tinygltf::Value::Object{});
    model.materials.push_back(std::move(material));
    model.extensionsUsed = {"KHR_materials_unlit"};
    primitive.material = 0;
    tinygltf::Mesh gltf_mesh;
    gltf_mesh.name = mesh.name;
    gltf_mesh.primitives.push_back(std::move(primitive));
    model.meshes.push_back(std::move(gltf_mesh));
    node.mesh = 0;
  }
  model.nodes.push_back(std::move(node));
  tinygltf::Scene scene;
  scene.nodes = {0};
  model.scenes.push_back(std::move(scene));
  model.defaultScene = 0;

  std::ostringstream out;
  if (!tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, out, false, true)) {
    return base::failure(base::ErrorCode::FileUnwritable, "the glTF writer refused the scene");
  }
  return std::move(out).str();
}

}  // namespace spectra::files
