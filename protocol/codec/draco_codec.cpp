#include "protocol/codec/draco_codec.hpp"

#include <draco/compression/config/encoder_options.h>
#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/compression/mesh/mesh_edgebreaker_encoder.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "protocol/codec/draco_attributes.hpp"
#include "protocol/little_endian.hpp"

namespace spectra::protocol::codec {
namespace {

constexpr std::int32_t kLatticeLimit = 1 << 23;
constexpr std::size_t kMostVertices = 1 << 21;
constexpr std::size_t kTemperatureTableSize = 8;
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

auto internal(std::string message) {
  return refusal(RpcErrorCode::InternalError, "Draco codec: " + std::move(message));
}

std::array<float, 3> position_m(const LatticePoint& point, float step_m) {
  return {static_cast<float>(point[0]) * step_m, static_cast<float>(point[1]) * step_m,
          static_cast<float>(point[2]) * step_m};
}

/// A tile as Draco gets it: every vertex is used, no triangle names a vertex twice.
struct CompactTile {
  std::vector<std::uint32_t> input_of_compact;
  std::vector<TileTriangle> triangles;  ///< Compact indices, in the order of the input.
};

/// Draco's time for a vertex grows with the square of its triangles: beyond so many it gets a copy.
constexpr std::uint32_t kMostTrianglesOfVertex = 1000;

/// Edgebreaker drops vertices of no triangle and triangles that name a vertex twice. The former are left out here; the
/// latter are kept by giving the repeated corner a copy of its vertex.
CompactTile compact_tile(std::size_t position_count, std::span<const TileTriangle> triangles) {
  CompactTile tile;
  tile.triangles.reserve(triangles.size());
  std::vector<std::uint32_t> compact_of_input(position_count, kNone), triangle_count(position_count, 0);
  const auto add = [&tile](std::uint32_t input) {
    tile.input_of_compact.push_back(input);
    return static_cast<std::uint32_t>(tile.input_of_compact.size() - 1);
  };
  for (const TileTriangle& triangle : triangles) {
    TileTriangle compact{};
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t input = triangle[corner];
      const bool repeated = (corner > 0 && input == triangle[0]) || (corner > 1 && input == triangle[1]);
      std::uint32_t& known = compact_of_input[input];
      if (repeated) {
        compact[corner] = add(input);
        continue;
      }
      if (known == kNone || triangle_count[input]++ == kMostTrianglesOfVertex) {
        known = add(input);
        triangle_count[input] = 1;
      }
      compact[corner] = known;
    }
    tile.triangles.push_back(compact);
  }
  return tile;
}

/// Draco codes the values of one attribute with one table of frequencies. Green and the differences from it are spread
/// differently, so each has an attribute of its own.
void add_green_and_differences(draco::PointCloud& cloud, std::span<const ColourBytes> colours) {
  std::vector<std::uint8_t> green;
  std::vector<std::array<std::uint8_t, 2>> differences;
  green.reserve(colours.size());
  differences.reserve(colours.size());
  for (const auto& [r, g, b] : colours) {
    green.push_back(g);
    differences.push_back({static_cast<std::uint8_t>(r - g), static_cast<std::uint8_t>(b - g)});
  }
  add_attribute<std::uint8_t>(cloud, draco::GeometryAttribute::COLOR, draco::DT_UINT8, 1, true, green);
  add_attribute<std::array<std::uint8_t, 2>>(cloud, draco::GeometryAttribute::GENERIC, draco::DT_UINT8, 2, false,
                                             differences);
}

/// Options for an attribute that is quantised onto the tile's own lattice.
draco::EncoderOptions lattice_options(int attribute, std::int32_t largest_coordinate, float step_m, int speed) {
  draco::EncoderOptions options = draco::EncoderOptions::CreateDefaultOptions();
  options.SetSpeed(speed, speed);
  options.SetAttributeOptions(
      attribute, quantisation_options(std::array<float, 3>{}, static_cast<std::uint32_t>(largest_coordinate), step_m));
  return options;
}

draco::DecoderBuffer decoder_buffer(std::span<const std::byte> payload) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(payload.data()), payload.size());
  return buffer;
}

std::array<float, 3> float_value(const draco::PointAttribute& attribute, std::uint32_t point) {
  std::array<float, 3> value{};
  attribute.GetMappedValue(draco::PointIndex(point), value.data());
  return value;
}

bool is_position_attribute(const draco::PointAttribute* attribute) {
  return attribute != nullptr && attribute->data_type() == draco::DT_FLOAT32 && attribute->num_components() == 3;
}

bool is_of_bytes(const draco::PointAttribute* attribute, int component_count) {
  return attribute != nullptr && attribute->data_type() == draco::DT_UINT8 &&
         attribute->num_components() == component_count;
}

/// The triangle turned so that its smallest index comes first; keeps the orientation.
TileTriangle rotated(const TileTriangle& triangle) {
  if (triangle[0] <= triangle[1] && triangle[0] <= triangle[2]) return triangle;
  if (triangle[1] <= triangle[2]) return {triangle[1], triangle[2], triangle[0]};
  return {triangle[2], triangle[0], triangle[1]};
}

/// Triangles in one defined order, whatever order and rotation they came in: buckets by smallest index, sorted within.
std::vector<TileTriangle> canonical(std::span<const TileTriangle> triangles, std::size_t vertex_count) {
  std::vector<std::uint32_t> next_in_bucket(vertex_count + 1, 0);
  for (const TileTriangle& triangle : triangles) ++next_in_bucket[rotated(triangle)[0] + 1];
  for (std::size_t i = 1; i < next_in_bucket.size(); ++i) next_in_bucket[i] += next_in_bucket[i - 1];
  std::vector<TileTriangle> ordered(triangles.size());
  for (const TileTriangle& triangle : triangles) {
    const TileTriangle turned = rotated(triangle);
    ordered[next_in_bucket[turned[0]]++] = turned;
  }
  auto first = ordered.begin();
  while (first != ordered.end()) {
    auto last = std::find_if(first, ordered.end(), [&](const TileTriangle& t) { return t[0] != (*first)[0]; });
    std::sort(first, last);
    first = last;
  }
  return ordered;
}

/// The edgebreaker encoder itself rather than ExpertEncoder, because it tells which corner each encoded value belongs to.
Result<EncodedGeometry> encoded_mesh(std::span<const LatticePoint> positions, std::span<const TileTriangle> triangles,
                                     std::int32_t largest_coordinate, float step_m, int speed) {
  const CompactTile tile = compact_tile(positions.size(), triangles);
  std::vector<std::array<float, 3>> positions_m;
  positions_m.reserve(tile.input_of_compact.size());
  for (const std::uint32_t input : tile.input_of_compact) positions_m.push_back(position_m(positions[input], step_m));

  draco::Mesh mesh;
  mesh.set_num_points(static_cast<std::uint32_t>(positions_m.size()));
  const int position_attribute = add_attribute<std::array<float, 3>>(mesh, draco::GeometryAttribute::POSITION,
                                                                     draco::DT_FLOAT32, 3, false, positions_m);
  mesh.SetNumFaces(tile.triangles.size());
  for (std::uint32_t i = 0; i < tile.triangles.size(); ++i) {
    const TileTriangle& t = tile.triangles[i];
    mesh.SetFace(draco::FaceIndex(i), {draco::PointIndex(t[0]), draco::PointIndex(t[1]), draco::PointIndex(t[2])});
  }

  const draco::EncoderOptions options = lattice_options(position_attribute, largest_coordinate, step_m, speed);
  draco::MeshEdgebreakerEncoder encoder;
  draco::EncoderBuffer buffer;
  encoder.SetMesh(mesh);
  if (const draco::Status status = encoder.Encode(options, &buffer); !status.ok())
    return internal("geometry not encoded: " + status.error_msg_string());
  const draco::MeshAttributeIndicesEncodingData* order = encoder.GetAttributeEncodingData(position_attribute);
  if (order == nullptr) return internal("the encoder tells no order of values");
  const auto& corner_of_value = order->encoded_attribute_value_index_to_corner_map;

  EncodedGeometry encoded;
  encoded.payload = bytes_of(buffer);
  draco::DecoderBuffer stream = decoder_buffer(encoded.payload);
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&stream);
  if (!decoded.ok()) return internal("encoded geometry does not decode: " + decoded.status().error_msg_string());
  const draco::Mesh& seen = *decoded.value();
  const draco::PointAttribute* attribute = seen.GetNamedAttribute(draco::GeometryAttribute::POSITION);
  if (!is_position_attribute(attribute)) return internal("decoded geometry has no positions");

  std::vector<std::uint32_t> compact_of_decoded;
  compact_of_decoded.reserve(seen.num_points());
  encoded.input_of_decoded.reserve(seen.num_points());
  for (std::uint32_t point = 0; point < seen.num_points(); ++point) {
    const std::uint32_t value = attribute->mapped_index(draco::PointIndex(point)).value();
    if (value >= corner_of_value.size()) return internal("a decoded value that was not encoded");
    const std::uint32_t compact = mesh.CornerToPointId(corner_of_value[value]).value();
    if (compact >= positions_m.size()) return internal("a decoded vertex of no input vertex");
    if (float_value(*attribute, point) != positions_m[compact])
      return internal("a decoded vertex is not on the lattice point of its input vertex");
    compact_of_decoded.push_back(compact);
    encoded.input_of_decoded.push_back(tile.input_of_compact[compact]);
  }

  std::vector<TileTriangle> seen_triangles;
  seen_triangles.reserve(seen.num_faces());
  for (std::uint32_t i = 0; i < seen.num_faces(); ++i) {
    const draco::Mesh::Face& face = seen.face(draco::FaceIndex(i));
    TileTriangle triangle{};
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t point = face[corner].value();
      if (point >= compact_of_decoded.size()) return internal("a decoded triangle of no vertex");
      triangle[corner] = compact_of_decoded[point];
    }
    seen_triangles.push_back(triangle);
  }
  if (canonical(seen_triangles, positions_m.size()) != canonical(tile.triangles, positions_m.size()))
    return internal("decoded triangles differ from those that went in");
  return encoded;
}

/// In ascending order of points; equal ones by index.
using IndexedPoint = std::pair<LatticePoint, std::uint32_t>;

/// The kd-tree encoder reorders the points. Points are told apart by nothing but their place, so both sides sorted by it
/// pair up; of points at one place any pairing is right.
Result<EncodedGeometry> encoded_cloud(std::span<const LatticePoint> positions, std::int32_t largest_coordinate,
                                      float step_m, int speed) {
  std::vector<std::array<float, 3>> positions_m;
  std::vector<IndexedPoint> wanted;
  positions_m.reserve(positions.size());
  wanted.reserve(positions.size());
  for (const LatticePoint& point : positions) {
    wanted.emplace_back(point, static_cast<std::uint32_t>(positions_m.size()));
    positions_m.push_back(position_m(point, step_m));
  }
  std::sort(wanted.begin(), wanted.end());

  draco::PointCloud cloud;
  cloud.set_num_points(static_cast<std::uint32_t>(positions_m.size()));
  const int position_attribute = add_attribute<std::array<float, 3>>(cloud, draco::GeometryAttribute::POSITION,
                                                                     draco::DT_FLOAT32, 3, false, positions_m);
  draco::ExpertEncoder encoder(cloud);
  encoder.Reset(lattice_options(position_attribute, largest_coordinate, step_m, speed));
  encoder.SetEncodingMethod(draco::POINT_CLOUD_KD_TREE_ENCODING);
  draco::EncoderBuffer buffer;
  if (const draco::Status status = encoder.EncodeToBuffer(&buffer); !status.ok())
    return internal("points not encoded: " + status.error_msg_string());

  EncodedGeometry encoded;
  encoded.payload = bytes_of(buffer);
  draco::DecoderBuffer stream = decoder_buffer(encoded.payload);
  draco::Decoder decoder;
  auto decoded = decoder.DecodePointCloudFromBuffer(&stream);
  if (!decoded.ok()) return internal("encoded points do not decode: " + decoded.status().error_msg_string());
  const draco::PointCloud& seen = *decoded.value();
  const draco::PointAttribute* attribute = seen.GetNamedAttribute(draco::GeometryAttribute::POSITION);
  if (!is_position_attribute(attribute)) return internal("decoded points have no positions");
  if (seen.num_points() != positions.size()) return internal("points were lost");

  std::vector<IndexedPoint> found;
  found.reserve(positions.size());
  for (std::uint32_t i = 0; i < seen.num_points(); ++i) {
    const std::array<float, 3> value = float_value(*attribute, i);
    LatticePoint point{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float coordinate = value[axis] / step_m;
      if (!(coordinate >= 0 && coordinate < static_cast<float>(kLatticeLimit)))
        return internal("a decoded point is off the lattice");
      point[axis] = static_cast<std::int32_t>(coordinate);
    }
    if (position_m(point, step_m) != value) return internal("a decoded point is off the lattice");
    found.emplace_back(point, i);
  }
  std::sort(found.begin(), found.end());
  encoded.input_of_decoded.resize(positions.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i].first != wanted[i].first) return internal("decoded points differ from those that went in");
    encoded.input_of_decoded[found[i].second] = wanted[i].second;
  }
  return encoded;
}

}  // namespace

Result<EncodedGeometry> encoded_geometry(std::span<const LatticePoint> positions,
                                         std::span<const TileTriangle> triangles, float step_m, int speed) {
  if (positions.empty()) return internal("a tile without vertices");
  if (positions.size() >= kMostVertices) return internal("a tile of too many vertices");
  if (!(step_m > 0 && step_m <= std::numeric_limits<float>::max() / static_cast<float>(kLatticeLimit)))
    return internal("the position step is not a positive length");
  if (speed < 0 || speed > 10) return internal("speed " + std::to_string(speed) + " is not within 0..10");
  std::int32_t largest_coordinate = 0;
  for (const LatticePoint& point : positions)
    for (const std::int32_t coordinate : point) {
      if (coordinate < 0 || coordinate >= kLatticeLimit)
        return internal("lattice coordinate " + std::to_string(coordinate) + " is not within 0.." +
                        std::to_string(kLatticeLimit - 1));
      largest_coordinate = std::max(largest_coordinate, coordinate);
    }
  for (const TileTriangle& triangle : triangles)
    for (const std::uint32_t vertex : triangle)
      if (vertex >= positions.size()) return internal("a triangle names a vertex that the tile does not have");

  return triangles.empty() ? encoded_cloud(positions, largest_coordinate, step_m, speed)
                           : encoded_mesh(positions, triangles, largest_coordinate, step_m, speed);
}

std::uint8_t rounded_channel(std::uint8_t value, int colour_bits) {
  if (colour_bits >= 8) return value;
  const int shift = 8 - std::max(1, colour_bits);
  const int half = 1 << (shift - 1);
  return static_cast<std::uint8_t>(std::min(255, ((value + half) >> shift) << shift));
}

Result<std::vector<std::byte>> encoded_colours(std::span<const ColourBytes> colours, int colour_bits, int speed,
                                               ColourTransform transform, std::span<const std::uint8_t> marks) {
  if (colours.empty()) return internal("no colours to encode");
  if (!marks.empty() && marks.size() != colours.size()) return internal("not one mark for each colour");
  if (colours.size() > std::numeric_limits<std::int32_t>::max()) return internal("too many colours");
  if (colour_bits < 1 || colour_bits > 8)
    return internal("colour bits " + std::to_string(colour_bits) + " are not within 1..8");
  if (speed < 0 || speed > 10) return internal("speed " + std::to_string(speed) + " is not within 0..10");
  std::vector<ColourBytes> rounded(colours.begin(), colours.end());
  if (colour_bits < 8)
    for (ColourBytes& colour : rounded)
      for (std::uint8_t& channel : colour) channel = rounded_channel(channel, colour_bits);

  draco::PointCloud cloud;
  cloud.set_num_points(static_cast<std::uint32_t>(rounded.size()));
  if (transform == ColourTransform::None) {
    add_attribute<ColourBytes>(cloud, draco::GeometryAttribute::COLOR, draco::DT_UINT8, 3, true, rounded);
  } else {
    add_green_and_differences(cloud, rounded);
  }
  if (!marks.empty()) add_attribute(cloud, draco::GeometryAttribute::GENERIC, draco::DT_UINT8, 1, false, marks);
  draco::ExpertEncoder encoder(cloud);
  encoder.SetSpeedOptions(speed, speed);
  encoder.SetEncodingMethod(draco::POINT_CLOUD_SEQUENTIAL_ENCODING);
  draco::EncoderBuffer buffer;
  if (const draco::Status status = encoder.EncodeToBuffer(&buffer); !status.ok())
    return internal("colours not encoded: " + status.error_msg_string());
  return bytes_of(buffer);
}

Result<std::vector<std::byte>> encoded_temperature_codes(std::span<const std::uint16_t> codes,
                                                         const TemperatureTable& table, int speed) {
  if (codes.empty()) return internal("no temperatures to encode");
  if (codes.size() > std::numeric_limits<std::int32_t>::max()) return internal("too many temperatures");
  if (speed < 0 || speed > 10) return internal("speed " + std::to_string(speed) + " is not within 0..10");
  draco::PointCloud cloud;
  cloud.set_num_points(static_cast<std::uint32_t>(codes.size()));
  add_attribute(cloud, draco::GeometryAttribute::GENERIC, draco::DT_UINT16, 1, false, codes);
  draco::ExpertEncoder encoder(cloud);
  encoder.SetSpeedOptions(speed, speed);
  encoder.SetEncodingMethod(draco::POINT_CLOUD_SEQUENTIAL_ENCODING);
  draco::EncoderBuffer buffer;
  if (const draco::Status status = encoder.EncodeToBuffer(&buffer); !status.ok())
    return internal("temperatures not encoded: " + status.error_msg_string());
  std::vector<std::byte> payload(kTemperatureTableSize);
  LittleEndianWriter table_out(payload);
  table_out.put(table.scale);
  table_out.put(table.offset);
  const std::vector<std::byte> stream = bytes_of(buffer);
  payload.insert(payload.end(), stream.begin(), stream.end());
  return payload;
}

Result<DecodedGeometry> decoded_geometry(std::span<const std::byte> payload) {
  draco::DecoderBuffer probe = decoder_buffer(payload);
  const auto type = draco::Decoder::GetEncodedGeometryType(&probe);
  if (!type.ok()) return internal("not a Draco stream: " + type.status().error_msg_string());

  draco::DecoderBuffer stream = decoder_buffer(payload);
  draco::Decoder decoder;
  std::unique_ptr<draco::PointCloud> cloud;
  const draco::Mesh* mesh = nullptr;
  if (type.value() == draco::TRIANGULAR_MESH) {
    auto decoded = decoder.DecodeMeshFromBuffer(&stream);
    if (!decoded.ok()) return internal("does not decode: " + decoded.status().error_msg_string());
    std::unique_ptr<draco::Mesh> owned = std::move(decoded).value();
    mesh = owned.get();
    cloud = std::move(owned);
  } else {
    auto decoded = decoder.DecodePointCloudFromBuffer(&stream);
    if (!decoded.ok()) return internal("does not decode: " + decoded.status().error_msg_string());
    cloud = std::move(decoded).value();
  }
  const draco::PointAttribute* attribute = cloud->GetNamedAttribute(draco::GeometryAttribute::POSITION);
  if (!is_position_attribute(attribute)) return internal("no POSITION attribute of three floats");

  DecodedGeometry geometry;
  geometry.positions_m.reserve(cloud->num_points());
  for (std::uint32_t i = 0; i < cloud->num_points(); ++i) geometry.positions_m.push_back(float_value(*attribute, i));
  if (mesh != nullptr) {
    geometry.triangles.reserve(mesh->num_faces());
    for (std::uint32_t i = 0; i < mesh->num_faces(); ++i) {
      const draco::Mesh::Face& face = mesh->face(draco::FaceIndex(i));
      geometry.triangles.push_back({face[0].value(), face[1].value(), face[2].value()});
    }
  }
  return geometry;
}

Result<std::vector<ColourBytes>> decoded_colours(std::span<const std::byte> payload, ColourTransform transform) {
  draco::DecoderBuffer stream = decoder_buffer(payload);
  draco::Decoder decoder;
  auto decoded = decoder.DecodePointCloudFromBuffer(&stream);
  if (!decoded.ok()) return internal("does not decode: " + decoded.status().error_msg_string());
  const draco::PointCloud& cloud = *decoded.value();
  std::vector<ColourBytes> colours(cloud.num_points());
  const draco::PointAttribute* colour = cloud.GetNamedAttribute(draco::GeometryAttribute::COLOR);
  if (transform == ColourTransform::None) {
    if (!is_of_bytes(colour, 3)) return internal("no COLOR attribute of three bytes");
    for (std::uint32_t i = 0; i < cloud.num_points(); ++i)
      colour->GetMappedValue(draco::PointIndex(i), colours[i].data());
    return colours;
  }
  const draco::PointAttribute* difference = cloud.GetNamedAttribute(draco::GeometryAttribute::GENERIC);
  if (!is_of_bytes(colour, 1)) return internal("no COLOR attribute of one byte");
  if (!is_of_bytes(difference, 2)) return internal("no GENERIC attribute of two bytes");
  for (std::uint32_t i = 0; i < cloud.num_points(); ++i) {
    std::uint8_t green = 0;
    std::array<std::uint8_t, 2> red_and_blue{};
    colour->GetMappedValue(draco::PointIndex(i), &green);
    difference->GetMappedValue(draco::PointIndex(i), red_and_blue.data());
    colours[i] = {static_cast<std::uint8_t>(red_and_blue[0] + green), green,
                  static_cast<std::uint8_t>(red_and_blue[1] + green)};
  }
  return colours;
}

Result<DecodedTemperatureCodes> decoded_temperature_codes(std::span<const std::byte> payload) {
  if (payload.size() < kTemperatureTableSize) return internal("no scale and offset before the temperatures");
  DecodedTemperatureCodes decoded;
  LittleEndianReader table_in(payload);
  decoded.table.scale = table_in.get_float();
  decoded.table.offset = table_in.get_float();
  draco::DecoderBuffer stream = decoder_buffer(payload.subspan(kTemperatureTableSize));
  draco::Decoder decoder;
  auto cloud = decoder.DecodePointCloudFromBuffer(&stream);
  if (!cloud.ok()) return internal("does not decode: " + cloud.status().error_msg_string());
  const draco::PointAttribute* attribute = cloud.value()->GetNamedAttribute(draco::GeometryAttribute::GENERIC);
  if (attribute == nullptr || attribute->data_type() != draco::DT_UINT16 || attribute->num_components() != 1)
    return internal("no GENERIC attribute of one u16");
  decoded.codes.resize(cloud.value()->num_points());
  for (std::uint32_t i = 0; i < decoded.codes.size(); ++i)
    attribute->GetMappedValue(draco::PointIndex(i), &decoded.codes[i]);
  return decoded;
}

Result<std::vector<std::uint8_t>> decoded_marks(std::span<const std::byte> payload) {
  draco::DecoderBuffer stream = decoder_buffer(payload);
  draco::Decoder decoder;
  auto decoded = decoder.DecodePointCloudFromBuffer(&stream);
  if (!decoded.ok()) return internal("does not decode: " + decoded.status().error_msg_string());
  const draco::PointCloud& cloud = *decoded.value();
  std::vector<std::uint8_t> marks;
  if (cloud.num_attributes() == 0) return marks;
  const draco::PointAttribute* last = cloud.attribute(cloud.num_attributes() - 1);
  if (last->attribute_type() != draco::GeometryAttribute::GENERIC || !is_of_bytes(last, 1)) return marks;
  marks.resize(cloud.num_points());
  for (std::uint32_t i = 0; i < cloud.num_points(); ++i) last->GetMappedValue(draco::PointIndex(i), &marks[i]);
  return marks;
}

}  // namespace spectra::protocol::codec
