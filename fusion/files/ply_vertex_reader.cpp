#include "fusion/files/ply_vertex_reader.hpp"

#include <algorithm>
#include <utility>

#include "fusion/files/ply_values.hpp"

namespace spectra::files {

namespace {

constexpr std::uint64_t kMaxBlockVertices = 1024;

}  // namespace

PlyVertexReader::PlyVertexReader(PlyCursor& cursor, const PlyElement& element, const PlySchema& schema)
    : cursor_(cursor),
      element_(element),
      has_fixed_size_(!cursor.is_text() && has_no_list(element)),
      block_vertices_(static_cast<std::size_t>(std::clamp<std::uint64_t>(element.count, 1, kMaxBlockVertices))),
      positions_(block_vertices_) {
  std::vector<std::size_t> offsets;
  for (const PlyProperty& property : element.properties) {
    offsets.push_back(entry_bytes_);
    entry_bytes_ += size_bytes(property.type);
  }
  const auto add = [&](PlySlot slot, double* out, std::size_t out_stride) {
    const std::size_t property = *schema.vertex[slot];
    columns_.push_back({property, element.properties[property].type, offsets[property], out, out_stride});
  };
  add(kX, &positions_[0].x, 3);
  add(kY, &positions_[0].y, 3);
  add(kZ, &positions_[0].z, 3);
  if (schema.has_vertex_colours()) {
    const bool is_packed = schema.colour_coding == ColourCoding::Packed;
    for (std::size_t channel = 0; channel < (is_packed ? 1U : 3U); ++channel) {
      colours_[channel].resize(block_vertices_);
      add(static_cast<PlySlot>(kRed + channel), colours_[channel].data(), 1);
    }
    // A packed colour in a float is its bits; as a number a signalling NaN among them would change.
    PlyScalar& type = columns_.back().type;
    if (is_packed && !cursor.is_text() && type == PlyScalar::Float32) type = PlyScalar::UInt32;
  }
  if (schema.has_vertex_temperature()) {
    temperatures_.resize(block_vertices_);
    add(kTemperature, temperatures_.data(), 1);
  }
  for (const auto& [slot, values] : {std::pair(kSigma, &sigmas_), std::pair(kSeen, &seen_)}) {
    if (!schema.vertex[slot]) continue;
    values->resize(block_vertices_);
    add(slot, values->data(), 1);
  }
}

base::Result<PlyRawVertices> PlyVertexReader::next() {
  auto count = static_cast<std::size_t>(std::min<std::uint64_t>(block_vertices_, element_.count - cursor_.entry));
  PlyRawVertices block;
  block.first_vertex = cursor_.entry;
  if (count > 0) {
    if (!has_fixed_size_) {
      BOOST_OUTCOME_TRY(read_one_by_one(count));
    } else if (cursor_.is_swapped()) {
      BOOST_OUTCOME_TRY(read_columns<true>(count));
    } else {
      BOOST_OUTCOME_TRY(read_columns<false>(count));
    }
  }
  block.positions = std::span(positions_).first(count);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    if (!colours_[channel].empty()) block.colours[channel] = std::span(colours_[channel]).first(count);
  }
  if (!temperatures_.empty()) block.temperatures = std::span(temperatures_).first(count);
  if (!sigmas_.empty()) block.sigmas = std::span(sigmas_).first(count);
  if (!seen_.empty()) block.seen = std::span(seen_).first(count);
  return block;
}

/// As many entries as are in the buffer, at most `count`, which becomes their number.
template <bool kSwapped>
base::Result<void> PlyVertexReader::read_columns(std::size_t& count) {
  const auto bytes = cursor_.file().ready(entry_bytes_);
  if (bytes.size() < entry_bytes_) return cursor_.shortage();
  count = std::min(count, bytes.size() / entry_bytes_);
  for (const Column& column : columns_) {
    load_column<kSwapped>(column.type, bytes.data() + column.offset, entry_bytes_, count, column.out,
                          column.out_stride);
  }
  cursor_.file().consume(count * entry_bytes_);
  cursor_.entry += count;
  return base::success();
}

base::Result<void> PlyVertexReader::read_one_by_one(std::size_t count) {
  std::vector<std::vector<const Column*>> targets(element_.properties.size());
  for (const Column& column : columns_) targets[column.property].push_back(&column);
  for (std::size_t i = 0; i < count; ++i, ++cursor_.entry) {
    BOOST_OUTCOME_TRY(cursor_.begin_entry(element_));
    for (std::size_t p = 0; p < element_.properties.size(); ++p) {
      const PlyProperty& property = element_.properties[p];
      if (property.is_list) {
        BOOST_OUTCOME_TRY(cursor_.skip_list(property));
      } else if (targets[p].empty()) {
        BOOST_OUTCOME_TRY(cursor_.skip_values(1, property.type));
      } else {
        BOOST_OUTCOME_TRY(const double value, cursor_.read_value(targets[p].front()->type));
        for (const Column* column : targets[p]) column->out[i * column->out_stride] = value;
      }
    }
    BOOST_OUTCOME_TRY(cursor_.end_entry());
  }
  return base::success();
}

}  // namespace spectra::files
