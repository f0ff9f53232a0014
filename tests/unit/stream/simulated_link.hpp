#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <queue>
#include <vector>

#include "protocol/tile_frame.hpp"
#include "server/stream/viewer_stream.hpp"

namespace spectra::stream::testing {

struct LinkSpeed {
  double bytes_per_s = 5e6 / 8;
  double round_trip_s = 0.1;
};

/// A viewer at the end of a radio link, in simulated time: bytes leave at the rate of the link one after the other, arrive
/// half a round trip later, and are acknowledged at once, which takes the other half. Encoding takes no simulated time.
class SimulatedLink {
 public:
  struct Arrival {
    double at_s;
    protocol::TileFrameHeader header;
    std::size_t size_bytes;
  };

  SimulatedLink(std::shared_ptr<const map::SceneSnapshot> scene, FrameCache& cache, jobs::WorkerPool& pool,
                LinkSpeed speed);
  ~SimulatedLink();
  SimulatedLink(const SimulatedLink&) = delete;
  SimulatedLink& operator=(const SimulatedLink&) = delete;

  ViewerStream& stream() { return *stream_; }
  double now_s() const { return now_s_; }

  /// Calls `action` at that time, which is not in the past.
  void at(double time_s, std::function<void()> action);
  /// Lets time pass until nothing is left to happen.
  void run();
  /// Acknowledgements stop to reach the server.
  void stop_acknowledging() { acknowledges_ = false; }

  std::vector<Arrival> arrivals;
  std::map<protocol::TileId, std::vector<std::byte>> colours;  ///< The payload that arrived last for each tile.
  std::map<std::uint32_t, double> completed_s;  ///< When the completion of a generation was known to the server.
  std::size_t most_in_flight_bytes = 0;
  std::size_t most_queued_bytes = 0;  ///< As the stream itself tells.

 private:
  struct Event {
    double at_s;
    std::uint64_t order;
    std::function<void()> action;
    bool operator>(const Event& other) const { return at_s != other.at_s ? at_s > other.at_s : order > other.order; }
  };

  void send_what_may_go();

  jobs::WorkerPool& pool_;
  LinkSpeed speed_;
  std::shared_ptr<ViewerStream> stream_;
  std::priority_queue<Event, std::vector<Event>, std::greater<>> events_;
  std::uint64_t event_count_ = 0;
  double now_s_ = 0;
  double link_free_s_ = 0;
  std::size_t in_flight_bytes_ = 0;
  bool acknowledges_ = true;
};

}  // namespace spectra::stream::testing
