#include "simulated_link.hpp"

#include <algorithm>
#include <utility>

#include "test_viewer.hpp"

namespace spectra::stream::testing {

SimulatedLink::SimulatedLink(std::shared_ptr<const map::SceneSnapshot> scene, FrameCache& cache, jobs::WorkerPool& pool,
                             LinkSpeed speed)
    : pool_(pool), speed_(speed), stream_(ViewerStream::create(std::move(scene), cache, pool, [] {})) {}

SimulatedLink::~SimulatedLink() {
  stream_->close();
}

void SimulatedLink::at(double time_s, std::function<void()> action) {
  events_.push({time_s, event_count_++, std::move(action)});
}

void SimulatedLink::run() {
  send_what_may_go();
  while (!events_.empty()) {
    const Event event = events_.top();
    events_.pop();
    now_s_ = event.at_s;
    event.action();
    send_what_may_go();
  }
}

void SimulatedLink::send_what_may_go() {
  while (true) {
    wait_until_idle(pool_);
    bool is_anything_sent = false;
    while (auto frame = stream_->next_frame(now_s_)) {
      is_anything_sent = true;
      const auto size_bytes = frame->size_bytes();
      std::vector<std::byte> message(frame->header.begin(), frame->header.end());
      if (frame->payload) message.insert(message.end(), frame->payload->begin(), frame->payload->end());
      const auto header = protocol::decoded_frame(message).value().header;
      in_flight_bytes_ += size_bytes;
      most_in_flight_bytes = std::max(most_in_flight_bytes, in_flight_bytes_);
      link_free_s_ = std::max(link_free_s_, now_s_) + static_cast<double>(size_bytes) / speed_.bytes_per_s;
      at(link_free_s_ + speed_.round_trip_s / 2, [this, header, size_bytes, payload = frame->payload] {
        arrivals.push_back({now_s_, header, size_bytes});
        if (header.kind == protocol::FrameKind::Colours) colours[header.tile] = *payload;
        if (!acknowledges_) return;
        at(now_s_ + speed_.round_trip_s / 2, [this, sequence = header.sequence, size_bytes] {
          in_flight_bytes_ -= size_bytes;
          stream_->acknowledge(sequence, now_s_);
        });
      });
    }
    most_queued_bytes = std::max(most_queued_bytes, static_cast<std::size_t>(stream_->stats().queued_bytes));
    if (const auto complete = stream_->take_complete()) completed_s[complete->generation] = now_s_;
    if (!is_anything_sent) return;
  }
}

}  // namespace spectra::stream::testing
