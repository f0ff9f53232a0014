#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <vector>

#include "protocol/codec/draco_codec.hpp"
#include "protocol/tile_frame.hpp"
#include "server/stream/viewer_stream.hpp"

namespace spectra::stream::testing {

/// What a viewer holds of one tile.
struct HeldTile {
  protocol::TileFrameHeader geometry;
  std::vector<std::array<float, 3>> positions_m;  ///< Relative to the scene origin.
  std::uint32_t generation = 0;                   ///< Of the colours; 0 = none of this connection.
  std::uint32_t colour_sequence = 0;              ///< Of the frame that brought them; 0 = they were resumed.
  std::vector<protocol::codec::ColourBytes> colours;
  std::vector<std::uint8_t> marks;                    ///< That came with them, if any.
  std::vector<protocol::codec::ColourBytes> visible;  ///< Raw layers.
  protocol::codec::DecodedTemperatureCodes temperature;
  protocol::codec::DecodedTemperatureCodes sigma;
};

/// A client on a perfect link: takes the frames of a stream, decodes them and expects of each what the protocol says
/// (rising sequence, colours only for the revision held, no revision twice, generations never falling).
class TestViewer {
 public:
  TestViewer(std::shared_ptr<const map::SceneSnapshot> scene, FrameCache& cache, jobs::WorkerPool& pool);
  ~TestViewer();
  TestViewer(const TestViewer&) = delete;
  TestViewer& operator=(const TestViewer&) = delete;

  ViewerStream& stream() { return *stream_; }

  /// The tiles it holds with colours, as another stream is told of them.
  std::vector<ResumedTile> claims() const;
  /// The same, with how sure temperatures are and the frames that brought the colours.
  std::vector<ResumedTile> claims_with_colours() const;
  /// Before it subscribes: holds the tiles of `earlier` that it claims. Returns how many are current.
  std::uint32_t resume(const TestViewer& earlier, const std::vector<ResumedTile>& claims,
                       const ViewerMemory& memory = {});

  /// Takes frames as they come, until the stream says complete. Fails the test when nothing comes for a long time.
  StreamComplete complete();
  /// Takes what can be had at once, at most so many frames; returns their number.
  std::size_t take(std::size_t most = static_cast<std::size_t>(-1));
  /// Waits until there may be something new, then takes it.
  void wait_and_take(std::size_t most = static_cast<std::size_t>(-1));
  /// Acknowledges everything that was taken.
  void acknowledge();

  bool acknowledges = true;                                                      ///< After every frame.
  protocol::ColourTransform colour_transform = protocol::ColourTransform::None;  ///< What it subscribed with.
  std::map<protocol::TileId, HeldTile> tiles;
  std::vector<protocol::TileFrameHeader> frames;  ///< All that was ever taken.
  std::vector<StreamComplete> completes;
  std::size_t taken_bytes = 0;
  std::size_t wake_count();

  std::uint32_t last_generation() const { return stream_->generation(); }
  std::size_t count(protocol::FrameKind kind) const;

 private:
  void receive(const OutgoingFrame& frame);

  std::mutex mutex_;
  std::condition_variable woken_;
  std::size_t wake_count_ = 0;
  std::size_t seen_wake_count_ = 0;
  std::set<std::uint32_t> revisions_;
  std::shared_ptr<ViewerStream> stream_;
};

/// Holds every worker of a pool until it is released, so that nothing is encoded meanwhile.
class HeldWorkers {
 public:
  explicit HeldWorkers(jobs::WorkerPool& pool);
  ~HeldWorkers() { release(); }
  void release();

 private:
  struct State;
  std::shared_ptr<State> state_;
};

/// Returns when the pool has nothing waiting and nothing running.
void wait_until_idle(jobs::WorkerPool& pool);

}  // namespace spectra::stream::testing
