#include "protocol/codec/draco_file.hpp"

#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>
#include <draco/metadata/geometry_metadata.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "protocol/codec/draco_attributes.hpp"

namespace spectra::protocol::codec {
namespace {

auto internal(std::string message) {
  return refusal(RpcErrorCode::InternalError, "Draco file: " + std::move(message));
}

/// Values on the lattice origin + k * step, k up to `largest`.
template <class Value>
struct Quantised {
  std::vector<Value> values;
  Value origin{};
  std::uint32_t largest = 0;
  float step = 0;
};

double nearest_multiple(float value, float step) {
  return std::floor(static_cast<double>(value) / static_cast<double>(step) + 0.5);
}

/// Nothing when the lattice would have 2^24 steps or more along an axis: floats do not hold them.
std::optional<Quantised<std::array<float, 3>>> quantised_positions(std::span<const std::array<float, 3>> positions_m,
                                                                   float step_m) {
  constexpr double kMostSteps = (1 << 24) - 1;
  Quantised<std::array<float, 3>> lattice;
  lattice.step = step_m;
  lattice.values.reserve(positions_m.size());
  lattice.origin.fill(std::numeric_limits<float>::max());
  for (const auto& position : positions_m) {
    auto& value = lattice.values.emplace_back();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      value[axis] = static_cast<float>(nearest_multiple(position[axis], step_m) * static_cast<double>(step_m));
      lattice.origin[axis] = std::min(lattice.origin[axis], value[axis]);
    }
  }
  for (const auto& value : lattice.values) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double steps =
          (static_cast<double>(value[axis]) - static_cast<double>(lattice.origin[axis])) / static_cast<double>(step_m);
      if (!(steps >= 0 && steps <= kMostSteps)) return std::nullopt;
      lattice.largest = std::max(lattice.largest, static_cast<std::uint32_t>(steps));
    }
  }
  return lattice;
}

/// Neither missing nor out of range; beyond this even the steps would not be.
bool is_in_range(float celsius) {
  return std::abs(celsius) <= 1e30F;
}

/// Also tells in `file` what became of the temperatures.
Quantised<float> quantised_temperatures(std::span<const float> temperature_celsius, DracoFile& file) {
  float lowest = std::numeric_limits<float>::max();
  float highest = std::numeric_limits<float>::lowest();
  bool is_any_missing = false;
  for (const float celsius : temperature_celsius) {
    if (is_in_range(celsius)) {
      lowest = std::min(lowest, celsius);
      highest = std::max(highest, celsius);
    } else if (std::isnan(celsius)) {
      is_any_missing = true;
    } else {
      ++(celsius > 0 ? file.over_range_count : file.under_range_count);
    }
  }
  if (lowest > highest) lowest = highest = 0;

  // Values of at most 22 bits and a sign: a decoder's float arithmetic gives them back exactly.
  constexpr double kMostSteps = 1 << 22;
  Quantised<float> lattice;
  lattice.step = kDracoTemperatureStepCelsius;
  const double reach =
      std::max({std::abs(static_cast<double>(lowest)), std::abs(static_cast<double>(highest)), 1000.0});
  while (reach / static_cast<double>(lattice.step) > kMostSteps - 1) lattice.step *= 2;
  const auto on_lattice = [step = lattice.step](float celsius) {
    return static_cast<float>(nearest_multiple(celsius, step) * static_cast<double>(step));
  };
  file.temperature_step_celsius = lattice.step;
  file.over_range_celsius = on_lattice(highest) + lattice.step;
  file.under_range_celsius = on_lattice(lowest) - lattice.step;
  const float missing = on_lattice(kDracoMissingCelsius);
  lattice.values.reserve(temperature_celsius.size());
  lattice.origin = is_any_missing ? missing : file.over_range_celsius;
  float largest = std::numeric_limits<float>::lowest();
  for (const float celsius : temperature_celsius) {
    float value = missing;
    if (is_in_range(celsius)) {
      value = on_lattice(celsius);
    } else if (!std::isnan(celsius)) {
      value = celsius > 0 ? file.over_range_celsius : file.under_range_celsius;
    }
    lattice.values.push_back(value);
    lattice.origin = std::min(lattice.origin, value);
    largest = std::max(largest, value);
  }
  lattice.largest = static_cast<std::uint32_t>((static_cast<double>(largest) - static_cast<double>(lattice.origin)) /
                                               static_cast<double>(lattice.step));
  return lattice;
}

bool is_degenerate(const TileTriangle& t) {
  return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

void add_metadata(draco::Mesh& mesh, const DracoFileInput& input, const DracoFile& file, int temperature_attribute) {
  auto whole = std::make_unique<draco::GeometryMetadata>();
  whole->AddEntryDoubleArray("origin_m", {input.origin_m.begin(), input.origin_m.end()});
  if (file.position_step_m > 0) whole->AddEntryDouble("position_step_m", static_cast<double>(file.position_step_m));
  mesh.AddMetadata(std::move(whole));
  if (temperature_attribute < 0) return;
  auto temperature = std::make_unique<draco::AttributeMetadata>();
  temperature->AddEntryString("name", "temperature");
  temperature->AddEntryString("unit", "degC");
  if (file.temperature_step_celsius > 0) {
    temperature->AddEntryDouble("step", static_cast<double>(file.temperature_step_celsius));
    temperature->AddEntryDouble("missing", static_cast<double>(kDracoMissingCelsius));
    if (file.over_range_count > 0) temperature->AddEntryDouble("over_range", double{file.over_range_celsius});
    if (file.under_range_count > 0) temperature->AddEntryDouble("under_range", double{file.under_range_celsius});
  }
  mesh.AddAttributeMetadata(temperature_attribute, std::move(temperature));
}

/// The corners of a shape, each the first of those vertices that have the same place and values: triangles that share no vertices take
/// several times the bytes. A triangle that would name a vertex twice then keeps its own. Counts what is left out and what is merged.
std::vector<TileTriangle> triangles_of_shape(const DracoFileInput& input,
                                             std::span<const std::array<float, 3>> positions_m,
                                             std::span<const float> temperatures, DracoFile& file) {
  using Content = std::tuple<std::array<float, 3>, ColourBytes, float>;
  const auto count = static_cast<std::uint32_t>(positions_m.size());
  std::vector<std::pair<Content, std::uint32_t>> sorted;
  sorted.reserve(count);
  for (std::uint32_t v = 0; v < count; ++v) {
    const float temperature = temperatures.empty() ? 0.0F : temperatures[v];
    sorted.emplace_back(Content(positions_m[v], input.colours[v], temperature), v);
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<std::uint32_t> first_of(count);
  std::uint32_t first = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (sorted[i].first != sorted[first].first) first = i;
    first_of[sorted[i].second] = sorted[first].second;
  }
  std::vector<bool> was_used(count), is_used(count);
  std::vector<TileTriangle> triangles;
  triangles.reserve(input.triangles.size());
  for (const TileTriangle& t : input.triangles) {
    if (is_degenerate(t)) {
      ++file.left_out_triangle_count;
      triangles.push_back(t);
      continue;
    }
    const TileTriangle merged{first_of[t[0]], first_of[t[1]], first_of[t[2]]};
    triangles.push_back(is_degenerate(merged) ? t : merged);
    for (const std::uint32_t v : t) was_used[v] = true;
    for (const std::uint32_t v : triangles.back()) is_used[v] = true;
  }
  const auto number_of = [](const std::vector<bool>& flags) {
    return static_cast<std::uint64_t>(std::count(flags.begin(), flags.end(), true));
  };
  // A first one that was of no triangle stands for others now.
  file.left_out_vertex_count = count - number_of(was_used);
  file.merged_vertex_count = number_of(was_used) - number_of(is_used);
  return triangles;
}

/// Where the vertices of a shape are; those that are of no triangle, which are left out, lie where another one is: they make the lattice no
/// larger.
std::vector<std::array<float, 3>> positions_of_shape(const DracoFileInput& input) {
  std::vector<bool> is_used(input.positions_m.size());
  for (const TileTriangle& t : input.triangles) {
    if (!is_degenerate(t)) is_used[t[0]] = is_used[t[1]] = is_used[t[2]] = true;
  }
  std::vector<std::array<float, 3>> positions(input.positions_m.begin(), input.positions_m.end());
  const auto used = std::find(is_used.begin(), is_used.end(), true);
  if (used == is_used.end()) return positions;
  const std::array<float, 3> place = positions[static_cast<std::size_t>(used - is_used.begin())];
  for (std::size_t v = 0; v < positions.size(); ++v) {
    if (!is_used[v]) positions[v] = place;
  }
  return positions;
}

Result<void> check(const DracoFileInput& input, DracoKeeping keeping, int speed) {
  const std::size_t vertex_count = input.positions_m.size();
  if (vertex_count == 0) return internal("a file without vertices");
  if (vertex_count > std::numeric_limits<std::int32_t>::max()) return internal("too many vertices for one stream");
  if (input.colours.size() != vertex_count) return internal("not one colour per vertex");
  if (!input.temperature_celsius.empty() && input.temperature_celsius.size() != vertex_count)
    return internal("not one temperature per vertex");
  if (keeping != DracoKeeping::Everything && !(input.position_step_m >= 0))
    return internal("the position step is no length");
  if (speed < 0 || speed > 10) return internal("speed " + std::to_string(speed) + " is not within 0..10");
  for (const TileTriangle& triangle : input.triangles)
    for (const std::uint32_t vertex : triangle)
      if (vertex >= vertex_count) return internal("a triangle names a vertex that the mesh does not have");
  return success();
}

/// Vertices or an edge with very many triangles, as no surface has them: Draco's edgebreaker takes time by the square of their number.
bool is_crowded(std::size_t vertex_count, std::span<const TileTriangle> triangles) {
  constexpr std::uint32_t kMost = 256;
  constexpr double kMostSquares = 4e8;
  std::vector<std::uint32_t> valence(vertex_count);
  for (const TileTriangle& triangle : triangles) {
    for (const std::uint32_t vertex : triangle) ++valence[vertex];
  }
  double squares = 0;
  for (const std::uint32_t count : valence) {
    if (count > kMost) squares += static_cast<double>(count) * static_cast<double>(count);
  }
  if (squares > kMostSquares) return true;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const TileTriangle& triangle : triangles) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto [a, b] = std::minmax(triangle[corner], triangle[(corner + 1) % 3]);
      if (a != b && valence[a] > kMost && valence[b] > kMost) edges.emplace_back(a, b);
    }
  }
  std::sort(edges.begin(), edges.end());
  for (std::size_t i = kMost; i < edges.size(); ++i) {
    if (edges[i] == edges[i - kMost]) return true;
  }
  return false;
}

int encoding_method(bool is_point_cloud, DracoKeeping keeping) {
  if (is_point_cloud)
    return keeping == DracoKeeping::Shape ? draco::POINT_CLOUD_KD_TREE_ENCODING
                                          : draco::POINT_CLOUD_SEQUENTIAL_ENCODING;
  return keeping == DracoKeeping::Shape ? draco::MESH_EDGEBREAKER_ENCODING : draco::MESH_SEQUENTIAL_ENCODING;
}

/// `keeping` is what was wanted, or more.
Result<DracoFile> file_keeping(DracoKeeping keeping, const DracoFileInput& input, DracoKeeping wanted, int speed) {
  const bool is_point_cloud = input.triangles.empty();
  const bool is_exact = keeping == DracoKeeping::Everything;
  const bool is_shape = !is_point_cloud && keeping == DracoKeeping::Shape;
  DracoFile file;
  std::vector<std::array<float, 3>> of_shape;
  if (is_shape) of_shape = positions_of_shape(input);
  const std::span<const std::array<float, 3>> positions_m = is_shape ? of_shape : input.positions_m;
  std::optional<Quantised<std::array<float, 3>>> lattice;
  if (!is_exact && input.position_step_m > 0) {
    lattice = quantised_positions(positions_m, input.position_step_m);
    // The step may have been found for a shape, which has fewer vertices.
    if (!lattice && keeping == wanted) return internal("the scene is too large for its position step");
  }
  file.position_step_m = lattice ? input.position_step_m : 0;
  // Draco's tree of points takes lattices only.
  if (is_point_cloud && !lattice && keeping == DracoKeeping::Shape) keeping = DracoKeeping::Order;
  file.kept = keeping;
  draco::Mesh mesh;
  mesh.set_num_points(static_cast<std::uint32_t>(input.positions_m.size()));
  draco::EncoderOptions options = draco::EncoderOptions::CreateDefaultOptions();
  options.SetSpeed(speed, speed);
  const auto add_positions = [&](std::span<const std::array<float, 3>> values) {
    return add_attribute<std::array<float, 3>>(mesh, draco::GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, false,
                                               values);
  };
  const auto add_temperatures = [&](std::span<const float> values) {
    return add_attribute<float>(mesh, draco::GeometryAttribute::GENERIC, draco::DT_FLOAT32, 1, false, values);
  };
  if (!lattice) {
    add_positions(positions_m);
  } else {
    options.SetAttributeOptions(add_positions(lattice->values),
                                quantisation_options(lattice->origin, lattice->largest, lattice->step));
  }
  add_attribute<ColourBytes>(mesh, draco::GeometryAttribute::COLOR, draco::DT_UINT8, 3, true, input.colours);
  int temperature_attribute = -1;
  Quantised<float> steps;
  if (!input.temperature_celsius.empty() && is_exact) {
    temperature_attribute = add_temperatures(input.temperature_celsius);
  } else if (!input.temperature_celsius.empty()) {
    steps = quantised_temperatures(input.temperature_celsius, file);
    temperature_attribute = add_temperatures(steps.values);
    options.SetAttributeOptions(temperature_attribute,
                                quantisation_options({&steps.origin, 1}, steps.largest, steps.step));
  }
  if (!is_point_cloud && keeping != DracoKeeping::Shape) {
    const std::uint64_t fewest = (input.positions_m.size() + 2) / 3;
    file.added_triangle_count = std::max<std::uint64_t>(fewest, input.triangles.size()) - input.triangles.size();
  }
  std::vector<TileTriangle> of_merged;
  if (is_shape) {
    of_merged = triangles_of_shape(input, lattice ? lattice->values : positions_m, steps.values, file);
    if (file.merged_vertex_count > 0 && is_crowded(input.positions_m.size(), of_merged)) {
      file.merged_vertex_count = 0;
      of_merged.assign(input.triangles.begin(), input.triangles.end());
    }
  }
  const std::span<const TileTriangle> triangles = is_shape ? of_merged : input.triangles;
  mesh.SetNumFaces(triangles.size() + file.added_triangle_count);  // Those beyond the scene's are all of vertex 0.
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    const TileTriangle& t = triangles[i];
    mesh.SetFace(draco::FaceIndex(i), {draco::PointIndex(t[0]), draco::PointIndex(t[1]), draco::PointIndex(t[2])});
  }
  add_metadata(mesh, input, file, temperature_attribute);

  draco::ExpertEncoder encoder =
      is_point_cloud ? draco::ExpertEncoder(static_cast<const draco::PointCloud&>(mesh)) : draco::ExpertEncoder(mesh);
  encoder.Reset(options);
  encoder.SetEncodingMethod(encoding_method(is_point_cloud, keeping));
  encoder.SetTrackEncodedProperties(true);
  draco::EncoderBuffer buffer;
  if (const draco::Status status = encoder.EncodeToBuffer(&buffer); !status.ok())
    return internal("not encoded: " + status.error_msg_string());
  if (is_shape) {
    if (encoder.num_encoded_faces() + file.left_out_triangle_count != input.triangles.size())
      return internal("triangles were lost");
    file.split_vertex_count =
        encoder.num_encoded_points() + file.left_out_vertex_count + file.merged_vertex_count - input.positions_m.size();
  }
  file.bytes = bytes_of(buffer);
  return file;
}

}  // namespace

Result<DracoFile> draco_file(const DracoFileInput& input, DracoKeeping wanted, int speed) {
  BOOST_OUTCOME_TRYV(check(input, wanted, speed));
  const bool is_shape = wanted == DracoKeeping::Shape;
  if (is_shape && is_crowded(input.positions_m.size(), input.triangles))
    return file_keeping(DracoKeeping::Order, input, wanted, speed);
  BOOST_OUTCOME_TRY(DracoFile file, file_keeping(wanted, input, wanted, speed));
  if (!is_shape || file.kept != DracoKeeping::Shape || !input.triangles.empty()) return file;
  // Points in the order of a scanner differ little from one to the next.
  BOOST_OUTCOME_TRY(DracoFile ordered, file_keeping(DracoKeeping::Order, input, wanted, speed));
  return ordered.bytes.size() <= file.bytes.size() ? std::move(ordered) : std::move(file);
}

}  // namespace spectra::protocol::codec
