#include "test_viewer.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <stdexcept>

namespace spectra::stream::testing {
namespace {

// Only a stall lasts so long; no test depends on it otherwise.
constexpr std::chrono::seconds kStall{20};

}  // namespace

TestViewer::TestViewer(std::shared_ptr<const map::SceneSnapshot> scene, FrameCache& cache, jobs::WorkerPool& pool)
    : stream_(ViewerStream::create(std::move(scene), cache, pool, [this] {
        const std::lock_guard lock(mutex_);
        ++wake_count_;
        woken_.notify_all();
      })) {}

TestViewer::~TestViewer() {
  stream_->close();
}

std::vector<ResumedTile> TestViewer::claims() const {
  std::vector<ResumedTile> claims;
  for (const auto& [id, tile] : tiles) {
    if (!tile.colours.empty())
      claims.push_back({id, tile.geometry.revision, !tile.visible.empty() && !tile.temperature.codes.empty()});
  }
  return claims;
}

std::vector<ResumedTile> TestViewer::claims_with_colours() const {
  auto claims = this->claims();
  for (ResumedTile& claim : claims) {
    claim.colour_sequence = tiles.at(claim.tile).colour_sequence;
    claim.has_temperature_sigma = !tiles.at(claim.tile).sigma.codes.empty();
  }
  return claims;
}

std::uint32_t TestViewer::resume(const TestViewer& earlier, const std::vector<ResumedTile>& claims,
                                 const ViewerMemory& memory) {
  const auto [current_count, current_colours] = stream_->resume(claims, memory);
  if (current_count == 0) return 0;
  for (const ResumedTile& claim : claims) {
    tiles[claim.tile] = earlier.tiles.at(claim.tile);
    tiles[claim.tile].generation = 0;
    tiles[claim.tile].colour_sequence = 0;
    // A false claim may be answered with what the viewer has in truth.
    if (tiles[claim.tile].geometry.revision == claim.revision) revisions_.insert(claim.revision);
  }
  for (const std::uint32_t place : current_colours) tiles[claims[place].tile].generation = stream_->generation();
  return current_count;
}

std::size_t TestViewer::wake_count() {
  const std::lock_guard lock(mutex_);
  return wake_count_;
}

std::size_t TestViewer::take(std::size_t most) {
  std::size_t taken = 0;
  while (taken < most) {
    const auto frame = stream_->next_frame(0);
    if (!frame) break;
    receive(*frame);
    ++taken;
    if (acknowledges) acknowledge();
  }
  return taken;
}

void TestViewer::wait_and_take(std::size_t most) {
  {
    std::unique_lock lock(mutex_);
    if (!woken_.wait_for(lock, kStall, [this] { return wake_count_ != seen_wake_count_; })) {
      throw std::runtime_error("the stream stalled");
    }
    seen_wake_count_ = wake_count_;
  }
  take(most);
}

StreamComplete TestViewer::complete() {
  while (true) {
    take();
    if (const auto complete = stream_->take_complete()) {
      completes.push_back(*complete);
      return *complete;
    }
    wait_and_take();
  }
}

void TestViewer::acknowledge() {
  stream_->acknowledge(frames.back().sequence, 0);
}

std::size_t TestViewer::count(protocol::FrameKind kind) const {
  std::size_t count = 0;
  for (const auto& frame : frames) count += frame.kind == kind ? 1U : 0U;
  return count;
}

void TestViewer::receive(const OutgoingFrame& outgoing) {
  std::vector<std::byte> message(outgoing.header.begin(), outgoing.header.end());
  if (outgoing.payload) message.insert(message.end(), outgoing.payload->begin(), outgoing.payload->end());
  ASSERT_EQ(message.size(), outgoing.size_bytes());
  const auto frame = protocol::decoded_frame(message);
  ASSERT_TRUE(frame.has_value());
  const protocol::TileFrameHeader& header = frame.value().header;
  EXPECT_EQ(header.sequence, frames.size() + 1);
  frames.push_back(header);
  taken_bytes += message.size();
  switch (header.kind) {
    case protocol::FrameKind::Geometry: {
      EXPECT_TRUE(revisions_.insert(header.revision).second) << "revision " << header.revision << " came twice";
      const auto geometry = protocol::codec::decoded_geometry(frame.value().payload);
      ASSERT_TRUE(geometry.has_value());
      HeldTile& tile = tiles[header.tile];
      tile = {};
      tile.geometry = header;
      tile.positions_m = geometry.value().positions_m;
      ASSERT_EQ(tile.positions_m.size(), header.vertex_count);
      for (auto& position : tile.positions_m) {
        for (std::size_t axis = 0; axis < 3; ++axis) position[axis] += header.origin_m[axis];
      }
      break;
    }
    case protocol::FrameKind::Colours:
    case protocol::FrameKind::ColoursSubtractGreen: {
      EXPECT_EQ(header.kind, protocol::colour_frame_kind(colour_transform));
      const auto held = tiles.find(header.tile);
      ASSERT_NE(held, tiles.end()) << "colours without geometry";
      EXPECT_EQ(held->second.geometry.revision, header.revision);
      EXPECT_EQ(held->second.geometry.vertex_count, header.vertex_count);
      EXPECT_GE(header.generation, held->second.generation);
      EXPECT_EQ(header.generation, stream_->generation());
      held->second.generation = header.generation;
      held->second.colour_sequence = header.sequence;
      held->second.colours = protocol::codec::decoded_colours(frame.value().payload, colour_transform).value();
      EXPECT_EQ(held->second.colours.size(), header.vertex_count);
      held->second.marks = protocol::codec::decoded_marks(frame.value().payload).value();
      break;
    }
    case protocol::FrameKind::Temperature:
    case protocol::FrameKind::TemperatureSigma:
    case protocol::FrameKind::Visible:
    case protocol::FrameKind::VisibleSubtractGreen: {
      const auto held = tiles.find(header.tile);
      ASSERT_NE(held, tiles.end()) << "a layer without geometry";
      EXPECT_EQ(held->second.geometry.revision, header.revision);
      EXPECT_EQ(held->second.geometry.vertex_count, header.vertex_count);
      EXPECT_EQ(held->second.geometry.origin_m, header.origin_m);
      if (header.kind == protocol::FrameKind::Temperature) {
        held->second.temperature = protocol::codec::decoded_temperature_codes(frame.value().payload).value();
        EXPECT_EQ(held->second.temperature.codes.size(), header.vertex_count);
      } else if (header.kind == protocol::FrameKind::TemperatureSigma) {
        held->second.sigma = protocol::codec::decoded_temperature_codes(frame.value().payload).value();
        EXPECT_EQ(held->second.sigma.codes.size(), header.vertex_count);
      } else {
        EXPECT_EQ(header.kind, protocol::visible_frame_kind(colour_transform));
        held->second.visible = protocol::codec::decoded_colours(frame.value().payload, colour_transform).value();
        EXPECT_EQ(held->second.visible.size(), header.vertex_count);
      }
      break;
    }
    case protocol::FrameKind::Remove:
      // What was removed may come again.
      revisions_.erase(header.revision);
      EXPECT_EQ(tiles.erase(header.tile), 1U);
      EXPECT_EQ(header.payload_size_bytes, 0U);
      break;
    default:
      ADD_FAILURE() << "unexpected kind " << static_cast<int>(header.kind);
  }
}

struct HeldWorkers::State {
  std::mutex mutex;
  std::condition_variable changed;
  unsigned held = 0;
  bool released = false;
};

HeldWorkers::HeldWorkers(jobs::WorkerPool& pool) : state_(std::make_shared<State>()) {
  for (unsigned i = 0; i < pool.thread_count(); ++i) {
    pool.post(
        [state = state_] {
          std::unique_lock lock(state->mutex);
          ++state->held;
          state->changed.notify_all();
          state->changed.wait(lock, [&] { return state->released; });
        },
        std::numeric_limits<int>::min());
  }
  std::unique_lock lock(state_->mutex);
  state_->changed.wait(lock, [&] { return state_->held == pool.thread_count(); });
}

void HeldWorkers::release() {
  const std::lock_guard lock(state_->mutex);
  state_->released = true;
  state_->changed.notify_all();
}

void wait_until_idle(jobs::WorkerPool& pool) {
  // Last in the queue on every thread: they meet only when no other job is left, neither waiting nor running.
  std::mutex mutex;
  std::condition_variable changed;
  unsigned arrived = 0;
  unsigned left = 0;
  for (unsigned i = 0; i < pool.thread_count(); ++i) {
    pool.post(
        [&] {
          std::unique_lock lock(mutex);
          ++arrived;
          changed.notify_all();
          changed.wait(lock, [&] { return arrived == pool.thread_count(); });
          ++left;
          changed.notify_all();
        },
        std::numeric_limits<int>::max());
  }
  std::unique_lock lock(mutex);
  changed.wait(lock, [&] { return left == pool.thread_count(); });
}

}  // namespace spectra::stream::testing
