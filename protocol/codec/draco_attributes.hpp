#pragma once

#include <draco/core/encoder_buffer.h>
#include <draco/core/options.h>
#include <draco/point_cloud/point_cloud.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace spectra::protocol::codec {

/// Adds an attribute of one value per point.
template <class Value>
int add_attribute(draco::PointCloud& cloud, draco::GeometryAttribute::Type type, draco::DataType component_type,
                  std::uint8_t component_count, bool normalized, std::span<const Value> values) {
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, component_count, component_type, normalized, sizeof(Value), 0);
  const int id = cloud.AddAttribute(attribute, true, static_cast<std::uint32_t>(values.size()));
  if (!values.empty()) cloud.attribute(id)->buffer()->Write(0, values.data(), values.size_bytes());
  return id;
}

/// Options for an attribute of floats that is quantised onto the lattice `origin` + k * `step`, k up to `largest`: Draco
/// computes range / (2^bits - 1), which gives back the step exactly.
draco::Options quantisation_options(std::span<const float> origin, std::uint32_t largest, float step);

/// A copy of what was encoded.
std::vector<std::byte> bytes_of(const draco::EncoderBuffer& buffer);

}  // namespace spectra::protocol::codec
