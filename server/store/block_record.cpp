#include "server/store/block_record.hpp"

#include <algorithm>
#include <cmath>

namespace spectra::store {
namespace {

bool is_finite(const base::Vec3d& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

}  // namespace

bool is_block_id(std::string_view id) {
  constexpr std::size_t kLongest = 64;
  return !id.empty() && id.size() <= kLongest && std::all_of(id.begin(), id.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
           c == '-';
  });
}

StoreResult<void> check_record(const BlockRecord& record) {
  const auto& d = record.description;
  if (!is_block_id(d.id)) {
    return failure(StoreErrorCode::InvalidRecord, "the id of a block is 1 to 64 of the characters a-z A-Z 0-9 . _ -");
  }
  if (d.observed_at && !std::isfinite(*d.observed_at)) {
    return failure(StoreErrorCode::InvalidRecord, "observed_at is a finite number of Unix seconds");
  }
  if (d.sensor && !is_finite(*d.sensor)) {
    return failure(StoreErrorCode::InvalidRecord, "the sensor's position is three finite numbers of metres");
  }
  if (!is_finite(d.bounds.min) || !is_finite(d.bounds.max)) {
    return failure(StoreErrorCode::InvalidRecord, "the bounds of block " + d.id + " are not finite");
  }
  if (!record.ply) return failure(StoreErrorCode::InvalidRecord, "block " + d.id + " comes without bytes");
  if (d.read_options.size() > kLongestReadOptions) {
    return failure(StoreErrorCode::TooLarge, "the reading options of block " + d.id + " are longer than " +
                                                 std::to_string(kLongestReadOptions) + " bytes");
  }
  if (record.ply->size() + (record.baseline ? record.baseline->size() : 0) > kLargestBlockBytes) {
    return failure(StoreErrorCode::TooLarge, "block " + d.id + " has " + std::to_string(record.ply->size()) +
                                                 " bytes; the store takes at most " +
                                                 std::to_string(kLargestBlockBytes) + " in one block");
  }
  return success();
}

SharedBytes body_of(const BlockRecord& record) {
  if (!record.baseline || record.baseline->empty()) return record.ply;
  std::string body;
  body.reserve(record.ply->size() + record.baseline->size());
  return std::make_shared<const std::string>(body.append(*record.ply).append(*record.baseline));
}

bool is_body_of(const BlockFacts& facts, std::string_view body) {
  if (body.size() != facts.body_bytes() || sha256(body.substr(0, facts.size_bytes)) != facts.sha256) return false;
  return facts.baseline_bytes == 0 || sha256(body.substr(facts.size_bytes)) == facts.baseline_sha256;
}

}  // namespace spectra::store
