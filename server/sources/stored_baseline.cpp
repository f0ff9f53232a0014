#include "server/sources/stored_baseline.hpp"

#include <algorithm>
#include <bit>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <span>
#include <vector>

#include "protocol/little_endian.hpp"
#include "server/map/vertex_times.hpp"

namespace spectra::sources {

// The number of different times, 32 bits; those, double; then of each vertex the temperature, float, and which time, 32 bits.

std::string text_of(const map::BlockBaseline& baseline) {
  if (baseline.is_empty()) return {};
  const map::VertexTimes times = map::VertexTimes::of(baseline.at);
  std::string text(4 + 8 * times.distinct.size() + 8 * baseline.celsius.size(), '\0');
  protocol::LittleEndianWriter writer(std::as_writable_bytes(std::span(text)));
  writer.put(static_cast<std::uint32_t>(times.distinct.size()));
  for (const double time : times.distinct) writer.put(std::bit_cast<std::uint64_t>(time));
  for (std::size_t v = 0; v < baseline.celsius.size(); ++v) {
    writer.put(baseline.celsius[v]);
    writer.put(times.of_vertex.empty() ? std::uint32_t{0} : times.of_vertex[v]);
  }
  return text;
}

std::optional<map::BlockBaseline> baseline_from(std::string_view bytes, std::size_t vertex_count) {
  map::BlockBaseline baseline;
  if (bytes.empty()) return baseline;
  if (bytes.size() < 4 || bytes.size() % 8 != 4) return std::nullopt;
  protocol::LittleEndianReader reader(std::as_bytes(std::span(bytes)));
  const std::uint64_t time_count = reader.get<std::uint32_t>();
  if (bytes.size() / 8 != time_count + vertex_count) return std::nullopt;
  std::vector<double> times;
  for (std::uint64_t t = 0; t < time_count; ++t) times.push_back(std::bit_cast<double>(reader.get<std::uint64_t>()));
  for (std::size_t v = 0; v < vertex_count; ++v) {
    baseline.celsius.push_back(reader.get_float());
    const std::uint32_t time = reader.get<std::uint32_t>();
    if (time >= std::max<std::uint64_t>(time_count, 1)) return std::nullopt;
    baseline.at.push_back(time_count == 0 ? map::kUnknownTime : times[time]);
  }
  return baseline;
}

std::string text_of(const StoredMark& stored) {
  char text[96];
  std::snprintf(text, sizeof text, "%" PRIu32 " %a %" PRIu64, stored.mark.number, stored.mark.marked_at.value_or(0),
                stored.revision);
  return text;
}

std::optional<StoredMark> mark_from(const std::string& text) {
  StoredMark stored;
  double marked_at = 0;
  if (std::sscanf(text.c_str(), "%" SCNu32 " %la %" SCNu64, &stored.mark.number, &marked_at, &stored.revision) != 3 ||
      stored.mark.number == 0 || !std::isfinite(marked_at)) {
    return std::nullopt;
  }
  stored.mark.marked_at = marked_at;
  return stored;
}

}  // namespace spectra::sources
