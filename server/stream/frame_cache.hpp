#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace spectra::stream {

struct EncodingTimes;

/// Encoded geometry and colours, each made once and shared by every viewer with the same need; bounded in bytes, the
/// least recently used goes first. Thread-safe. One for the whole server.
class FrameCache {
 public:
  explicit FrameCache(std::size_t capacity_bytes);
  ~FrameCache();
  std::size_t size_bytes() const;
  std::uint64_t hit_count() const;   ///< Colour frames that were there when a viewer needed them.
  std::uint64_t miss_count() const;  ///< Encodings (geometry or colours) that had to be made.
  const EncodingTimes& times() const;

  struct State;  ///< Seen by server/stream only; outlives the cache while a job of a stream still uses it.
  const std::shared_ptr<State>& state() { return state_; }

 private:
  std::shared_ptr<State> state_;
};

}  // namespace spectra::stream
