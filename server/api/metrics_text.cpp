#include "server/api/metrics_text.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

#include "server/access/role.hpp"
#include "server/net/prometheus_text.hpp"
#include "server/session/version.hpp"
#include "server/stream/duration_histogram.hpp"

namespace spectra::api {
namespace {

class Metrics {
 public:
  void gauge(std::string name, std::string help, double value) {
    metrics_.push_back({std::move(name), std::move(help), value, false, "", ""});
  }
  void counter(std::string name, std::string help, double value) {
    metrics_.push_back({std::move(name), std::move(help), value, true, "", ""});
  }
  /// One of several of a name, told apart by whose it is.
  void of_role(std::string name, std::string help, access::AccessRole role, double value, bool is_counter) {
    metrics_.push_back({std::move(name), std::move(help), value, is_counter, "role", std::string(to_string(role))});
  }
  void durations(std::string name, std::string help, const std::string& what,
                 const stream::DurationHistogram& histogram) {
    const auto counts = histogram.counts();
    net::Metric metric{std::move(name), std::move(help), 0, false, "what", what};
    metric.distribution = {{stream::DurationHistogram::kBounds_s.begin(), stream::DurationHistogram::kBounds_s.end()},
                           {counts.counts.begin(), counts.counts.end()},
                           counts.sum_s};
    metrics_.push_back(std::move(metric));
  }
  void info(std::string name, std::string help, std::string label, std::string text) {
    metrics_.push_back({std::move(name), std::move(help), 1, false, std::move(label), std::move(text)});
  }
  std::string text() const { return net::prometheus_text(metrics_); }

 private:
  std::vector<net::Metric> metrics_;
};

double as_double(std::uint64_t count) {
  return static_cast<double>(count);
}

double resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  double total_pages = 0;
  double resident_pages = 0;
  statm >> total_pages >> resident_pages;
  return resident_pages * static_cast<double>(sysconf(_SC_PAGESIZE));
}

double open_descriptors() {
  std::error_code error;
  double count = 0;
  for (std::filesystem::directory_iterator it("/proc/self/fd", error), end; !error && it != end; it.increment(error)) {
    count += 1;
  }
  return count > 0 ? count - 1 : 0;  // without the one that looks
}

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace

std::string metrics_text(const session::ServedScene& served, const sources::MapKeeper& map,
                         const net::NetMetrics& net) {
  Metrics out;
  out.info("spectra_build_info", "The version that runs.", "version", std::string(session::kVersion));
  out.gauge("spectra_viewers", "Viewers connected now.", static_cast<double>(net.viewers));
  out.counter("spectra_viewers_total", "Viewers that have connected.", as_double(net.viewers_total));
  out.counter("spectra_viewers_cut_total", "Viewers cut by a deadline or a full queue.", as_double(net.viewers_cut));
  out.gauge("spectra_connections", "TCP connections open now.", static_cast<double>(net.connections_open));
  out.counter("spectra_connections_total", "TCP connections accepted.", as_double(net.connections_accepted));
  out.counter("spectra_connections_refused_total", "TCP connections over the limit.",
              as_double(net.connections_refused));
  out.counter("spectra_tls_handshakes_failed_total", "TLS handshakes that came to nothing.",
              as_double(net.handshakes_failed));
  out.counter("spectra_accept_failures_total", "Times that no descriptor was left for a connection.",
              as_double(net.accept_failures));
  out.counter("spectra_http_requests_total", "HTTP requests, upgrades included.", as_double(net.requests));
  out.counter("spectra_http_requests_delayed_total",
              "HTTP requests that waited for their turn: too many, or too many bytes, of an address.",
              as_double(net.requests_delayed));
  out.counter("spectra_http_requests_refused_total", "HTTP requests refused by a check.",
              as_double(net.requests_refused));
  out.counter("spectra_messages_received_total", "WebSocket messages from viewers.", as_double(net.messages_received));
  out.counter("spectra_messages_sent_total", "JSON messages to viewers.", as_double(net.messages_sent));
  out.counter("spectra_frames_sent_total", "Tile frames to viewers.", as_double(net.frames_sent));
  out.counter("spectra_frame_bytes_sent_total", "Bytes of tile frames to viewers.", as_double(net.frame_bytes_sent));
  out.gauge("spectra_senders", "Senders of blocks connected to /ingest now.", static_cast<double>(net.senders));
  out.counter("spectra_blocks_received_total", "Block messages received over /ingest.", as_double(net.blocks_received));
  out.counter("spectra_block_bytes_received_total", "Bytes of block messages received over /ingest.",
              as_double(net.block_bytes_received));
  out.counter("spectra_blocks_refused_total", "Block messages over /ingest that were refused.",
              as_double(net.blocks_refused));
  out.counter("spectra_store_failures_total", "Changes of the map that the store did not take: a full or failing disk.",
              as_double(map.store_failure_count()));
  out.gauge("spectra_frame_cache_bytes", "Encoded frames held for sharing.", as_double(served.cache.size_bytes()));
  out.counter("spectra_frame_cache_hits_total", "Frames that were encoded already.",
              as_double(served.cache.hit_count()));
  out.counter("spectra_frame_cache_misses_total", "Frames that had to be encoded.",
              as_double(served.cache.miss_count()));
  const stream::EncodingTimes& times = served.cache.times();
  for (const auto& [what, histogram] :
       {std::pair{"geometry", &times.geometry}, std::pair{"fusing", &times.fusing},
        std::pair{"colours", &times.colours}, std::pair{"raw_layer", &times.raw_layer}}) {
    out.durations("spectra_encoding_seconds", "What making the frames of a tile took.", what, *histogram);
  }
  for (const access::AccessRole role : access::kRoles) {
    out.of_role("spectra_role_viewers", "Viewers connected now, by role.", role,
                static_cast<double>(net.of(role).viewers), false);
  }
  for (const access::AccessRole role : access::kRoles) {
    out.of_role("spectra_role_frames_sent_total", "Tile frames sent, by role.", role,
                as_double(net.of(role).frames_sent), true);
  }
  for (const access::AccessRole role : access::kRoles) {
    out.of_role("spectra_role_frame_bytes_sent_total", "Their bytes, by role.", role,
                as_double(net.of(role).frame_bytes_sent), true);
  }
  for (const access::AccessRole role : access::kRoles) {
    out.of_role("spectra_role_queued_bytes", "Messages that wait for viewers, without what they share, by role.", role,
                static_cast<double>(net.of(role).queued_bytes), false);
  }
  for (const access::AccessRole role : access::kRoles) {
    out.of_role("spectra_role_viewers_cut_total", "Viewers cut by a deadline or a full queue, by role.", role,
                as_double(net.of(role).viewers_cut), true);
  }
  if (const auto scene = served.scenes.current()) {
    out.gauge("spectra_scene_revision", "Revision of the scene served.", scene->revision());
    out.gauge("spectra_scene_vertices", "Vertices of the scene served.", as_double(scene->vertex_count()));
    out.gauge("spectra_scene_triangles", "Triangles of the scene served.", as_double(scene->triangle_count()));
    out.gauge("spectra_scene_tiles", "Tiles of the scene served.", as_double(scene->tiles().size()));
  }
  out.gauge("process_resident_memory_bytes", "Resident memory.", resident_bytes());
  out.gauge("process_open_fds", "Open descriptors.", open_descriptors());
  out.counter("process_cpu_seconds_total", "Processor time used.", cpu_seconds());
  return out.text();
}

}  // namespace spectra::api
