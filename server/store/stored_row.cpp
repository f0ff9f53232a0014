#include "server/store/stored_row.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace spectra::store {
namespace {

/// Little-endian numbers and texts with their length in front.
class Writer {
 public:
  void integer(std::uint64_t value) {
    for (unsigned byte = 0; byte < 8; ++byte) bytes_ += static_cast<char>(value >> (8 * byte) & 0xffU);
  }
  void time(StoreTime value) { integer(static_cast<std::uint64_t>(value.time_since_epoch().count())); }
  void number(double value) { integer(std::bit_cast<std::uint64_t>(value)); }
  void vector(const base::Vec3d& v) {
    number(v.x);
    number(v.y);
    number(v.z);
  }
  void text(std::string_view text) {
    integer(text.size());
    bytes_ += text;
  }
  template <std::size_t N>
  void raw(const std::array<unsigned char, N>& bytes) {
    bytes_.append(bytes.begin(), bytes.end());
  }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

/// Its mirror. After a read beyond the end everything is 0 and is_whole() false.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : rest_(bytes) {}

  std::uint64_t integer() {
    std::uint64_t value = 0;
    const auto bytes = take(8);
    for (std::size_t i = 0; i < bytes.size(); ++i)
      value |= std::uint64_t{static_cast<unsigned char>(bytes[i])} << (8 * i);
    return value;
  }
  StoreTime time() { return StoreTime(std::chrono::microseconds(static_cast<std::int64_t>(integer()))); }
  double number() { return std::bit_cast<double>(integer()); }
  base::Vec3d vector() {
    base::Vec3d v;
    v.x = number();
    v.y = number();
    v.z = number();
    return v;
  }
  std::string text() { return std::string(take(integer())); }
  template <std::size_t N>
  std::array<unsigned char, N> raw() {
    std::array<unsigned char, N> value{};
    const auto bytes = take(N);
    std::copy(bytes.begin(), bytes.end(), value.begin());
    return value;
  }
  bool is_whole() const { return is_good_ && rest_.empty(); }

 private:
  std::string_view take(std::uint64_t count) {
    if (count > rest_.size()) {
      is_good_ = false;
      rest_ = {};
      return {};
    }
    const auto bytes = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return bytes;
  }

  std::string_view rest_;
  bool is_good_ = true;
};

constexpr std::uint64_t kIsRemoval = 1, kHasObservedAt = 2, kHasSensor = 4, kHasBaseline = 8;

}  // namespace

Checksum row_checksum(RowKind kind, std::uint64_t number, std::string_view bytes) {
  Writer writer;
  writer.integer(static_cast<unsigned char>(kind));
  writer.integer(number);
  writer.text(bytes);
  const Sha256 hash = sha256(writer.take());
  Checksum checksum{};
  std::copy_n(hash.begin(), checksum.size(), checksum.begin());
  return checksum;
}

void toggle(Checksum& sum, const Checksum& of_row) {
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] ^= of_row[i];
}

std::string encode(const Change& change) {
  const auto& facts = change.facts;
  const auto& d = facts.description;
  Writer writer;
  writer.integer((change.is_removal ? kIsRemoval : 0) | (d.observed_at ? kHasObservedAt : 0) |
                 (d.sensor ? kHasSensor : 0) | (facts.baseline_bytes > 0 ? kHasBaseline : 0));
  writer.time(facts.accepted_at);
  writer.text(d.id);
  if (change.is_removal) return writer.take();
  writer.number(d.observed_at.value_or(0));
  writer.vector(d.sensor.value_or(base::Vec3d{}));
  writer.integer(d.vertex_count);
  writer.integer(d.triangle_count);
  writer.vector(d.bounds.min);
  writer.vector(d.bounds.max);
  writer.integer(facts.size_bytes);
  writer.raw(facts.sha256);
  writer.text(d.read_options);
  if (facts.baseline_bytes > 0) {
    writer.integer(facts.baseline_bytes);
    writer.raw(facts.baseline_sha256);
  }
  return writer.take();
}

std::optional<Change> decode_change(Revision revision, std::string_view bytes) {
  Reader reader(bytes);
  Change change;
  auto& facts = change.facts;
  auto& d = facts.description;
  const std::uint64_t flags = reader.integer();
  facts.revision = revision;
  facts.accepted_at = reader.time();
  d.id = reader.text();
  change.is_removal = (flags & kIsRemoval) != 0;
  if (!change.is_removal) {
    const double observed_at = reader.number();
    const base::Vec3d sensor = reader.vector();
    if ((flags & kHasObservedAt) != 0) d.observed_at = observed_at;
    if ((flags & kHasSensor) != 0) d.sensor = sensor;
    d.vertex_count = reader.integer();
    d.triangle_count = reader.integer();
    d.bounds.min = reader.vector();
    d.bounds.max = reader.vector();
    facts.size_bytes = reader.integer();
    facts.sha256 = reader.raw<32>();
    d.read_options = reader.text();
    if ((flags & kHasBaseline) != 0) {
      facts.baseline_bytes = reader.integer();
      facts.baseline_sha256 = reader.raw<32>();
    }
  }
  if (!reader.is_whole() || !is_block_id(d.id)) return std::nullopt;
  return change;
}

std::string encode(const Constant& constant) {
  Writer writer;
  writer.text(constant.key);
  writer.text(constant.value);
  return writer.take();
}

std::optional<Constant> decode_constant(std::string_view bytes) {
  Reader reader(bytes);
  Constant constant;
  constant.key = reader.text();
  constant.value = reader.text();
  if (!reader.is_whole()) return std::nullopt;
  return constant;
}

std::string encode(const StoreState& state) {
  Writer writer;
  writer.integer(state.commit);
  writer.integer(state.is_open ? 1 : 0);
  writer.integer(state.last_revision);
  writer.integer(state.history_floor);
  writer.time(state.history_floor_at);
  writer.integer(state.row_count);
  writer.raw(state.rows);
  return writer.take();
}

std::optional<StoreState> decode_state(std::string_view bytes) {
  Reader reader(bytes);
  StoreState state;
  state.commit = reader.integer();
  state.is_open = reader.integer() != 0;
  state.last_revision = reader.integer();
  state.history_floor = reader.integer();
  state.history_floor_at = reader.time();
  state.row_count = reader.integer();
  state.rows = reader.raw<16>();
  if (!reader.is_whole()) return std::nullopt;
  return state;
}

}  // namespace spectra::store
